"""Where the parts of a strip, tray or panel are in one image."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

from bgars.errors import InputError
from bgars.records.keys import Key

__all__ = ["MOST_PARTS", "StripLayout", "StripPlace"]

MOST_PARTS = 4096


class StripPlace(NamedTuple):
    """A place with a part: rows from the top, columns from the left of the image, both from 0."""

    name: str
    row: int
    col: int
    x_um: float
    y_um: float


@dataclass(frozen=True)
class StripLayout:
    """An array of like parts that one image shows.

    Attributes
    ----------
    rows, cols : int
        Of parts, as the image shows them.
    pitch_x_um, pitch_y_um : float
        Distance of neighbouring parts along x and y.
    offset_um : (float, float)
        Middle of the array against the middle of the image: x right, y up.
    window_um : (float, float) or None
        Width and height around a part's place that belong to it alone; the pitches by default.
    empty : tuple of str
        Places without a part.

    Raises
    ------
    InputError
        Sizes that are not positive, a window larger than the pitches, or a name that is no place.

    Examples
    --------
    >>> strip = StripLayout(rows=2, cols=3, pitch_x_um=9000.0, pitch_y_um=8000.0, empty=("R1C2",))
    >>> [place.name for place in strip.places()]
    ['R1C1', 'R1C3', 'R2C1', 'R2C2', 'R2C3']
    >>> strip.places()[0].x_um, strip.places()[0].y_um
    (-9000.0, 4000.0)
    """

    rows: Annotated[int, Key("rows of parts, as the image shows them")]
    cols: Annotated[int, Key("columns of parts")]
    pitch_x_um: Annotated[float, Key("distance of neighbouring columns, in um")]
    pitch_y_um: Annotated[float, Key("distance of neighbouring rows, in um")]
    offset_um: Annotated[tuple[float, float], Key("middle of the array against that of the image, in um")] = (0.0, 0.0)
    window_um: Annotated[
        tuple[float, float] | None, Key("width and height of what belongs to a part, in um; null = the pitches")
    ] = None
    empty: Annotated[tuple[str, ...], Key("names of places without a part")] = ()

    def __post_init__(self) -> None:
        """Check the sizes and the names."""
        for name, count in (("rows", self.rows), ("cols", self.cols)):
            if count < 1:
                msg = f"strip.{name}: must be 1 or more, got {count}"
                raise InputError(msg)
        if self.rows * self.cols > MOST_PARTS:
            msg = f"strip.rows x strip.cols: must be {MOST_PARTS} parts or fewer, got {self.rows} x {self.cols}"
            raise InputError(msg)
        pitches = (("pitch_x_um", self.pitch_x_um), ("pitch_y_um", self.pitch_y_um))
        for (name, pitch_um), window_um in zip(pitches, self.window_um or (None, None), strict=True):
            if not (math.isfinite(pitch_um) and pitch_um > 0):
                msg = f"strip.{name}: must be finite and above 0, got {pitch_um:g}"
                raise InputError(msg)
            if window_um is not None and not 0 < window_um <= pitch_um:
                msg = f"strip.window_um: must be above 0 and at most {name} ({pitch_um:g}), got {window_um:g}"
                raise InputError(msg)
        if not all(map(math.isfinite, self.offset_um)):
            msg = f"strip.offset_um: must be finite, got {self.offset_um}"
            raise InputError(msg)
        known = {_name(row, col) for row in range(self.rows) for col in range(self.cols)}
        for name in self.empty:
            if name not in known:
                last = _name(self.rows - 1, self.cols - 1)
                msg = f"strip.empty: must be places of the strip, R1C1 to {last}, got {name!r}"
                raise InputError(msg)
        if not known - set(self.empty):
            msg = f"strip.empty: must leave a part, got all {len(known)} places"
            raise InputError(msg)

    @property
    def window(self) -> tuple[float, float]:
        """Width and height of what belongs to a part, in um."""
        return self.window_um or (self.pitch_x_um, self.pitch_y_um)

    def places(self) -> tuple[StripPlace, ...]:
        """Return the places that carry a part, in reading order."""
        return tuple(
            StripPlace(
                _name(row, col),
                row,
                col,
                self.offset_um[0] + (col - (self.cols - 1) / 2) * self.pitch_x_um,
                self.offset_um[1] + ((self.rows - 1) / 2 - row) * self.pitch_y_um,
            )
            for row in range(self.rows)
            for col in range(self.cols)
            if _name(row, col) not in self.empty
        )

    def place(self, name: str) -> StripPlace:
        """Return a place by its name.

        Raises
        ------
        InputError
            There is none, or it is empty.
        """
        found = next((place for place in self.places() if place.name == name), None)
        if found is None:
            msg = f"strip: has no part at {name!r}"
            raise InputError(msg)
        return found


def _name(row: int, col: int) -> str:
    return f"R{row + 1}C{col + 1}"
