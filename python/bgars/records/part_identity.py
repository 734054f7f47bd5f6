"""Which part it is that was inspected: what tells it from the next one."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from typing import Annotated, Any

from bgars.errors import InputError
from bgars.records.keys import Key

__all__ = ["PartIdentity"]

MOST_CHARACTERS = 200


@dataclass(frozen=True)
class PartIdentity:
    """Where a part comes from and who looked at it; "" = not known. Its serial number is that of the result.

    Attributes
    ----------
    lot : str
        Lot or order.
    substrate : str
        Strip, tray or panel that carries the part.
    position : str
        Place on the substrate, such as "3,7".
    station : str
        Machine that took the images.
    operator : str
        Who ran it.
    captured_utc : str
        When the last image was written, as ISO 8601, UTC.
    round : int or None
        Which inspection of this serial number: 1 is the first, 2 the next, such as after rework. A store counts it
        where it is not stated.

    Raises
    ------
    InputError
        A value that is no printable line of at most 200 characters, or a round below 1.

    Examples
    --------
    >>> PartIdentity(lot="L7", position="3,7").known()
    {'lot': 'L7', 'position': '3,7'}
    """

    lot: Annotated[str, Key("lot or order")] = ""
    substrate: Annotated[str, Key("strip, tray or panel that carries the part")] = ""
    position: Annotated[str, Key("place on the substrate")] = ""
    station: Annotated[str, Key("machine that took the images")] = ""
    operator: Annotated[str, Key("who ran the machine")] = ""
    captured_utc: Annotated[str, Key("when the last image was written: ISO 8601, UTC")] = ""
    round: Annotated[
        int | None,
        Key(
            "inspection of this serial number: 1 = the first, 2 = the next, such as after rework; null = not known",
            ge=1,
            is_late=True,
        ),
    ] = None

    def __post_init__(self) -> None:
        """Refuse what would not stay one line in a log, a name of a file or a cell of a table."""
        if self.round is not None and (type(self.round) is not int or self.round < 1):
            msg = f"round: must be 1 or more, got {self.round!r}"
            raise InputError(msg)
        for entry in fields(self):
            if entry.name == "round":
                continue
            value = getattr(self, entry.name)
            if not isinstance(value, str) or len(value) > MOST_CHARACTERS or not (value.isprintable() or not value):
                msg = f"{entry.name}: must be one printable line of at most {MOST_CHARACTERS} characters, got {value!r}"
                raise InputError(msg)

    def known(self) -> dict[str, Any]:
        """Return what is known, by name."""
        return {name: value for name, value in asdict(self).items() if value}
