"""The part as the camera saw it, small enough for a page, and the side files that keep it."""

from __future__ import annotations

import io
import json
import math
from base64 import b64encode
from dataclasses import asdict, dataclass
from hashlib import sha256
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

from bgars.errors import FileFormatError
from bgars.files.light_names import light_name
from bgars.io.surface_file import SURFACE_FILE, read_surface, surface_bytes

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from bgars.records.capture import Capture
    from bgars.records.part_surface import PartSurface

__all__ = [
    "PHOTOGRAPH_FILE",
    "SIDE_FILE",
    "Lamp",
    "Photograph",
    "lamps_of",
    "photograph_of",
    "read_side_files",
    "side_files",
]

PHOTOGRAPH_FILE = "photograph.jpg"
SIDE_FILE = "report.json"
MAX_SIDE_PX = 1400
QUALITY = 82
SMALL_SHARE = 0.5
"""Of the image: what is used is shown alone where it takes less."""
MAX_BYTES = 8 << 20
HEADROOM = 1.1
"""White is kept for what is drawn over the photograph."""


@dataclass(frozen=True)
class Photograph:
    """A picture of the part and where it lies.

    Attributes
    ----------
    jpeg : bytes
        The file.
    left_um, right_um, bottom_um, top_um : float
        Its edges; x right, y up, origin at the centre of the image.
    meaning : str
        What it shows, in words.
    """

    jpeg: bytes
    left_um: float
    right_um: float
    bottom_um: float
    top_um: float
    meaning: str

    @property
    def data_uri(self) -> str:
        """The file as an address that holds its content."""
        return f"data:image/jpeg;base64,{b64encode(self.jpeg).decode('ascii')}"


@dataclass(frozen=True)
class Lamp:
    """A light as the rig gives it: image file, azimuth, elevation."""

    image: str
    azimuth_deg: float
    elevation_deg: float


def photograph_of(capture: Capture) -> Photograph:
    """Return the mean of the images, thinned to a drawable size, the square root of its grey levels."""
    window = _window(capture.mask)
    step = max(1, math.ceil(max(capture.mask[window].shape) / MAX_SIDE_PX))
    total: NDArray[np.float32] = np.zeros(capture.mask[window][::step, ::step].shape, dtype=np.float32)
    for image in capture.images:
        total += image[window][::step, ::step]
    rows, cols = capture.mask.shape
    pitch_um = capture.pixel_pitch_um or 1.0
    # Thinned pixels are squares of `step` pixels from the top left: the last may reach over the edge.
    high_um, wide_um = (size * step * pitch_um for size in total.shape)
    left_um, top_um = (window[1].start - cols / 2) * pitch_um, (rows / 2 - window[0].start) * pitch_um
    meaning = f"mean of the {len(capture.images)} images, square root of the grey levels"
    if step > 1:
        meaning += f", every {step}th pixel"
    jpeg = io.BytesIO()
    Image.fromarray(_stretched(total)).save(jpeg, "jpeg", quality=QUALITY)
    return Photograph(jpeg.getvalue(), left_um, left_um + wide_um, top_um - high_um, top_um, meaning)


def _window(mask: NDArray[np.bool_]) -> tuple[slice, slice]:
    """The pixels to show: all, or those around what is used where that is a small part, as one part of a strip."""
    rows, cols = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not rows.size:
        return slice(0, mask.shape[0]), slice(0, mask.shape[1])
    window = slice(int(rows[0]), int(rows[-1]) + 1), slice(int(cols[0]), int(cols[-1]) + 1)
    return (
        window if mask[window].size <= SMALL_SHARE * mask.size else (slice(0, mask.shape[0]), slice(0, mask.shape[1]))
    )


def _stretched(values: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Grey levels from the 0.5th percentile (black) to the 99.5th (white)."""
    dark, bright = (float(level) for level in np.percentile(values, (0.5, 99.5)))
    if not bright > dark:
        return np.full(values.shape, 128, np.uint8)
    levels = 255.0 * np.sqrt(np.clip((values - dark) / (bright - dark), 0.0, 1.0)) / HEADROOM
    picture: NDArray[np.uint8] = np.rint(levels).astype(np.uint8)
    return picture


def lamps_of(capture: Capture) -> tuple[Lamp, ...]:
    """Return the lights of a capture, in the order of its images."""
    numbers = range(len(capture.images))
    names = [file.name for file in capture.files] or [light_name(index, what="image") for index in numbers]
    angles = zip(capture.rig.azimuths_deg, capture.rig.elevations_deg, strict=True)
    return tuple(Lamp(name, float(a), float(e)) for name, (a, e) in zip(names, angles, strict=True))


def side_files(photograph: Photograph, lamps: tuple[Lamp, ...], surface: PartSurface | None) -> dict[str, bytes]:
    """Return the files that let the page be written again: names and contents."""
    content = None if surface is None else surface_bytes(surface)
    place = {name: value for name, value in asdict(photograph).items() if name != "jpeg"}
    values = {
        "format": "bgars-page",
        "photograph": {"file": PHOTOGRAPH_FILE, **place},
        "lights": [asdict(lamp) for lamp in lamps],
        # By its checksum: the file of an earlier inspection must not be taken for this one's.
        "surface": None if content is None else {"file": SURFACE_FILE, "sha256": sha256(content).hexdigest()},
    }
    text = json.dumps(values, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    files = {PHOTOGRAPH_FILE: photograph.jpeg, SIDE_FILE: text.encode("utf-8")}
    return files if content is None else files | {SURFACE_FILE: content}


def read_side_files(path: Path) -> tuple[Photograph | None, tuple[Lamp, ...], PartSurface | None, tuple[str, ...]]:
    """Read what :func:`side_files` wrote, nothing where there is nothing; and warnings of what cannot be used.

    Raises
    ------
    FileFormatError
        The file is there, but is not what was written.
    """
    if not path.is_file():
        return None, (), None, ()
    try:
        values: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        place = values["photograph"]
        left_um, right_um, bottom_um, top_um = (
            float(place[f"{name}_um"]) for name in ("left", "right", "bottom", "top")
        )
        meaning = str(place["meaning"])
        lamps = tuple(
            Lamp(str(row["image"]), float(row["azimuth_deg"]), float(row["elevation_deg"])) for row in values["lights"]
        )
        surface = values.get("surface")
        digest = None if surface is None else str(surface["sha256"])
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        msg = f"{path}: is not what `bgars inspect` writes beside its result ({error!r}); remove it to do without"
        raise FileFormatError(msg) from error
    photograph = _read_jpeg(path.with_name(PHOTOGRAPH_FILE), (left_um, right_um, bottom_um, top_um), meaning)
    return photograph, lamps, *_surface(path.with_name(SURFACE_FILE), digest)


def _surface(path: Path, digest: str | None) -> tuple[PartSurface | None, tuple[str, ...]]:
    """The height map that belongs to the result; None where there is none, or, with a warning, only another one's."""
    if digest is None or not path.is_file():
        return None, ()
    try:
        found = sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        msg = f"{path}: cannot be read ({error.strerror})"
        raise FileFormatError(msg) from error
    if found != digest:
        names = f"is not the file that {SIDE_FILE} names: cut off, or of another inspection"
        return None, (f"{path}: {names}; the 3-D view shows spheroids instead of the surface",)
    return read_surface(path), ()


def _read_jpeg(path: Path, edges_um: tuple[float, float, float, float], meaning: str) -> Photograph | None:
    """The photograph; None where it was taken away."""
    if not path.is_file():
        return None
    try:
        jpeg = path.read_bytes()
        whole = len(jpeg) <= MAX_BYTES and jpeg[:2] == b"\xff\xd8" and jpeg[-2:] == b"\xff\xd9"
    except OSError as error:
        msg = f"{path}: cannot be read ({error.strerror})"
        raise FileFormatError(msg) from error
    if not whole or not all(map(math.isfinite, edges_um)) or edges_um[0] >= edges_um[1] or edges_um[2] >= edges_um[3]:
        msg = f"{path}: must be a whole JPEG of at most {MAX_BYTES >> 20} MB with its place in {SIDE_FILE}"
        raise FileFormatError(msg)
    return Photograph(jpeg, *edges_um, meaning)
