"""Which part a capture shows: from its side file, a code in its images, or the name of its folder."""

from __future__ import annotations

import importlib
import re
from dataclasses import dataclass, field, fields, replace
from datetime import datetime, timezone
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bgars.errors import InputError
from bgars.files.encodable import encodable, is_encodable
from bgars.io.recipe import RECIPE_NAME, CaptureRecipe, read_recipe
from bgars.io.strict_toml import read_values
from bgars.records.part_identity import PartIdentity
from bgars.records.station import Station

if TYPE_CHECKING:
    from bgars.records.capture import Capture

__all__ = ["CODE", "Naming", "identity_of", "with_capture"]

CODE = "code"
"""A pattern that asks for the code in the images."""
NAMES = ("serial", *(entry.name for entry in fields(PartIdentity) if entry.name != "captured_utc"))
SHORT, LONG = "?", ""
"""What follows a repetition that is to be as short, or as long, as it can be."""
DEFAULT_PATTERN = "{serial}"


@dataclass(frozen=True)
class Naming:
    """How a part is identified.

    ``[part]`` in its capture.toml takes precedence, then the pattern, then what is the same for all.

    Attributes
    ----------
    pattern : str
        Of the folder's name, with ``{serial}`` and, where they are in it, ``{lot}``, ``{substrate}``, ``{position}``,
        ``{station}``, ``{operator}``, ``{round}`` (a whole number); ``/`` reaches into the folders above. ``code``:
        the DataMatrix or QR code that the images show.
    common : PartIdentity
        Of all parts.

    Raises
    ------
    InputError
        A pattern without ``{serial}``, or with an unknown name.

    Examples
    --------
    >>> serial, identity = Naming("{lot}/{serial}_{position}").of_name(Path("in/L7/SN12_3"))
    >>> serial, identity.known()
    ('SN12', {'lot': 'L7', 'position': '3'})
    """

    pattern: str = DEFAULT_PATTERN
    common: PartIdentity = field(default_factory=PartIdentity)

    def __post_init__(self) -> None:
        """Check the pattern."""
        if self.pattern == CODE:
            _need_reader()
        else:
            self._expression()

    def of_name(self, folder: Path, *, side: Path | None = None) -> tuple[str, PartIdentity]:
        """Return serial number and identity as the folder's name and its side file say.

        Parameters
        ----------
        folder : Path
            Of the capture, as it is named.
        side : Path, optional
            Where its side file lies, if elsewhere.

        Raises
        ------
        InputError
            The name does not follow the pattern, or in more than one way, and the side file names no serial number.
        """
        if not is_encodable(folder.name):
            msg = f"{encodable(str(folder))}: its name must be UTF-8"
            raise InputError(msg)
        known = _side_file(folder if side is None else side)
        found: dict[str, Any] = {}
        if self.pattern != CODE:
            depth = self.pattern.count("/") + 1
            told = "/".join(folder.absolute().parts[-depth:])
            match, other = (self._expression(many).fullmatch(told) for many in (SHORT, LONG))
            if match is not None and other is not None and match.groupdict() == other.groupdict():
                found = match.groupdict()
                if "round" in found:
                    found["round"] = int(found["round"])
            elif not known.get("serial"):
                msg = f"{folder}: its name must follow the pattern {self.pattern!r}, got {told!r}"
                if match is not None and other is not None:
                    ways = f"{match['serial']!r} or {other['serial']!r}"
                    msg = f"{folder}: its name fits {self.pattern!r} in more than one way: serial number {ways}"
                raise InputError(msg)
        values = self.common.known() | found | known
        return _printable(folder, values.pop("serial", "")), PartIdentity(**values)

    def of_capture(self, folder: Path, capture: Capture, serial: str) -> str:
        """Return the serial number, read from the images where the pattern is ``code`` and nothing named one.

        Raises
        ------
        InputError
            The images show no code that can be read, or several that differ.
        """
        if self.pattern != CODE or serial:
            return serial
        texts = _read_code(capture)
        if not texts:
            msg = f"{folder}: no DataMatrix or QR code can be read in its images"
            raise InputError(msg)
        if len(texts) > 1:
            told = ", ".join(repr(text) for text in sorted(texts))
            msg = f"{folder}: its images show several codes, and which one is the serial number is not known: {told}"
            raise InputError(msg)
        return _printable(folder, texts[0])

    def _expression(self, many: str = SHORT) -> re.Pattern[str]:
        """The pattern as a regular expression; every name once, each as short, or as long, as it can be."""
        pieces = re.split(r"\{(\w*)\}", self.pattern)
        names = pieces[1::2]
        unknown = next((name for name in names if name not in NAMES), None)
        if unknown is not None:
            msg = f"serial-from: knows {', '.join(f'{{{name}}}' for name in NAMES)}, got {{{unknown}}}"
            raise InputError(msg)
        if "serial" not in names or len(set(names)) < len(names):
            msg = f"serial-from: must hold {{serial}}, and each name once, got {self.pattern!r}"
            raise InputError(msg)
        forms = {"round": f"0*[1-9][0-9]{{0,5}}{many}"}
        told = "".join(
            f"(?P<{piece}>{forms.get(piece, f'[^/]+{many}')})" if at % 2 else re.escape(piece)
            for at, piece in enumerate(pieces)
        )
        return re.compile(told)


def identity_of(capture: Capture, common: PartIdentity, station: Path | None = None) -> tuple[str, PartIdentity]:
    """Return serial number ("" = not named) and identity of a single capture: its side file, else what is common.

    `station` is its station file, if it is not the one that its side file names.
    """
    known = {} if capture.folder is None else _side_file(capture.folder)
    values = common.known() | known
    serial = _printable(capture.folder, values.pop("serial", ""))
    return serial, with_capture(PartIdentity(**values), capture, station)


def _printable(folder: Path | None, serial: str) -> str:
    """A serial number, unless it would not stay one line in a log, an environment variable or a name of a file."""
    if serial and not serial.isprintable():
        where = "" if folder is None else f"{encodable(str(folder))}: "
        msg = f"{where}serial: must be one printable line, got {serial!r}"
        raise InputError(msg)
    return serial


def with_capture(identity: PartIdentity, capture: Capture, station: Path | None = None) -> PartIdentity:
    """Return an identity with the time of the last image, and the name in the station file where no other is stated."""
    name = identity.station or _station_name(capture, station)
    return replace(identity, captured_utc=_last_written_utc(capture), station=name)


def _station_name(capture: Capture, file: Path | None) -> str:
    """What a station file calls its station; "" without one, and for the name of those that nobody named."""
    if file is None and capture.folder is not None:
        recipe = _recipe(capture.folder)
        file = None if recipe is None or recipe.station is None else capture.folder / recipe.station
    name = "" if file is None else str(read_values(file).get("name", ""))
    return "" if name == Station().name else name


def _last_written_utc(capture: Capture) -> str:
    """When the youngest image was written, as ISO 8601, UTC; "" without files."""
    times = [path.stat().st_mtime for path in capture.files]
    return datetime.fromtimestamp(max(times), timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ") if times else ""


def _side_file(folder: Path) -> dict[str, Any]:
    recipe = _recipe(folder)
    part = None if recipe is None else recipe.part
    return {} if part is None else {name: value for name, value in vars(part).items() if value}


def _recipe(folder: Path) -> CaptureRecipe | None:
    path = folder / RECIPE_NAME
    return read_recipe(path) if path.is_file() else None


def _read_code(capture: Capture) -> list[str]:
    """The different codes in the images' mean, which has no cast shadow of full depth; else in the first that has any.

    Bar codes are left out: rows of balls look like short ones.
    """
    reader = _need_reader()
    kinds = reader.barcode_formats_from_str("DataMatrix|QRCode|MicroQRCode")
    images = [np.asarray(image, dtype=np.float32) for image in capture.images]
    for image in [np.mean(images, axis=0), *images]:
        top = float(np.percentile(image, 99.5))
        grey = np.clip(image * (255.0 / max(top, 1e-9)), 0, 255).astype(np.uint8)
        found = reader.read_barcodes(np.ascontiguousarray(grey), formats=kinds)
        texts = [" ".join(str(each.text).split()) for each in found if each.text]
        if texts:
            return list(dict.fromkeys(texts))
    return []


def _need_reader() -> Any:  # noqa: ANN401 - a module
    try:
        return importlib.import_module("zxingcpp")
    except ImportError:
        msg = "serial-from code: needs zxing-cpp, which is not installed; install it with: pip install 'bgars[codes]'"
        raise InputError(msg) from None
