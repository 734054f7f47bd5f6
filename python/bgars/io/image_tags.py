"""What the headers of image files say beyond their pixels: which way is up, how many images, whether there is alpha."""

from __future__ import annotations

import io
import struct
from typing import TYPE_CHECKING, Any, BinaryIO, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    from bgars.io.image_formats import ImageFormat

__all__ = ["ImageTags", "read_tags", "upright"]

UPRIGHT = 1
ORIENTATION, SUBFILE, EXTRA_SAMPLES, PROFILE = 274, 254, 338, 34675
OPACITY = (1, 2)
"""Kinds of a further channel that are one, associated or not; 0 is unspecified (TIFF 6.0, section 18)."""
BITS, PHOTOMETRIC = 258, 262
WHITE_IS_ZERO = 0
REDUCED = 1
SHORT, LONG = 3, 4
MAX_PAGES = 10_000
MAX_CHUNKS = 10_000
EXIF_BYTES = 1 << 16
PNG_WITH_ALPHA = (4, 6)
GAMMA_ONE = 100_000
"""PNG (ISO/IEC 15948), 11.3.3.2: the exponent times this."""
WEBP_ALPHA = 0x10
TGA_ALPHA_BITS = 0x0F
JPEG_SCAN, JPEG_END, JPEG_APP1 = 0xDA, 0xD9, 0xE1


class ImageTags(NamedTuple):
    """What a header says.

    Attributes
    ----------
    orientation : int
        As in EXIF: 1 is upright.
    pages : int
        Full images in the file.
    alpha : bool
        The file has a channel of opacity.
    preview_first : bool
        The first page is a reduced copy.
    profile : bool
        The file declares sRGB or another profile for the display of its colours.
    white_bits : bool
        A pixel is one bit, and 0 means white (TIFF).
    gamma : float
        Exponent with which samples were made from light (PNG, chunk gAMA); 1 where the file names none.
    extra : bool
        The file has a further channel that it does not call opacity (TIFF), such as near infrared.
    """

    orientation: int = UPRIGHT
    pages: int = 1
    alpha: bool = False
    preview_first: bool = False
    profile: bool = False
    white_bits: bool = False
    gamma: float = 1.0
    extra: bool = False


def read_tags(path: Path, kind: ImageFormat) -> ImageTags:
    """Return the tags of a file; a damaged header has none, since the decoder will say what is wrong."""
    readers = {"TIFF": _tiff_tags, "JPEG": _jpeg_tags, "PNG": _png_tags, "WebP": _webp_tags, "TGA": _tga_tags}
    reader = readers.get(kind.name)
    if reader is None:
        return ImageTags()
    try:
        with path.open("rb") as file:
            return reader(file)
    except (OSError, struct.error, IndexError, ValueError, OverflowError):
        return ImageTags()


def upright(image: NDArray[Any], orientation: int) -> NDArray[Any]:
    """Turn an image (rows, columns, ...) upright, as its EXIF orientation (1 to 8) says.

    Examples
    --------
    >>> upright(np.array([[1, 2, 3], [4, 5, 6]]), 6).tolist()
    [[4, 1], [5, 2], [6, 3]]
    """
    if orientation >= 5:  # noqa: PLR2004 - rows are columns
        image = np.swapaxes(image, 0, 1)
    if orientation in (2, 3, 6, 7):
        image = image[:, ::-1]
    if orientation in (3, 4, 7, 8):
        image = image[::-1]
    return np.ascontiguousarray(image)


def _tiff_tags(file: BinaryIO) -> ImageTags:
    pages = list(_directories(file))
    full = [page for page in pages if not page.get(SUBFILE, 0) & REDUCED] or pages
    first = full[0] if full else {}
    orientation, count = _valid(first.get(ORIENTATION, UPRIGHT)), max(len(full), 1)
    preview_first = bool(pages) and first is not pages[0]
    white_bits = first.get(PHOTOMETRIC) == WHITE_IS_ZERO and first.get(BITS, 1) == 1
    further = first.get(EXTRA_SAMPLES)
    is_opacity, is_other = further in OPACITY, further is not None and further not in OPACITY
    return ImageTags(orientation, count, is_opacity, preview_first, PROFILE in first, white_bits, extra=is_other)


def _directories(file: BinaryIO, only_first: bool = False) -> Iterator[dict[int, int]]:
    """Yield the first numbers in each image file directory of a TIFF structure, of a profile the offset."""
    head = file.read(16)
    order = "<" if head[:2] == b"II" else ">"
    big = struct.unpack_from(order + "H", head, 2)[0] == 43  # noqa: PLR2004 - BigTIFF
    counts, entry_bytes, offsets = ("Q", 20, "Q") if big else ("H", 12, "I")
    offset = struct.unpack_from(order + offsets, head, 8 if big else 4)[0]
    seen: set[int] = set()
    while offset and offset not in seen and len(seen) < MAX_PAGES:
        seen.add(offset)
        file.seek(offset)
        count = struct.unpack(order + counts, file.read(struct.calcsize(counts)))[0]
        if count > 0xFFFF:  # noqa: PLR2004 - more than any writer makes
            return
        entries = file.read(count * entry_bytes)
        values = {}
        for place in range(0, count * entry_bytes, entry_bytes):
            tag, form = struct.unpack_from(order + "HH", entries, place)
            number = struct.unpack_from(order + ("Q" if big else "I"), entries, place + 4)[0]
            value_at = place + (12 if big else 8)
            if (form in (SHORT, LONG) or tag == PROFILE) and number >= 1:
                values[tag] = struct.unpack_from(order + ("H" if form == SHORT else "I"), entries, value_at)[0]
        yield values
        if only_first:
            return
        offset = struct.unpack(order + offsets, file.read(struct.calcsize(offsets)))[0]


def _jpeg_tags(file: BinaryIO) -> ImageTags:
    file.seek(2)
    for _ in range(MAX_CHUNKS):
        marker = file.read(2)
        if len(marker) < 2 or marker[0] != 0xFF or marker[1] in (JPEG_SCAN, JPEG_END):  # noqa: PLR2004
            break
        (length,) = struct.unpack(">H", file.read(2))
        body = file.read(length - 2) if length > 2 else b""  # noqa: PLR2004 - it counts itself
        if marker[1] == JPEG_APP1 and body.startswith(b"Exif\0\0"):
            return ImageTags(_exif_orientation(body[6:]))
    return ImageTags()


def _png_tags(file: BinaryIO) -> ImageTags:
    file.seek(8)
    orientation, alpha, pages, profile, gamma = UPRIGHT, False, 1, False, 1.0
    for _ in range(MAX_CHUNKS):
        length, name = struct.unpack(">I4s", file.read(8))
        if name == b"IHDR":
            alpha = file.read(length)[9] in PNG_WITH_ALPHA
        elif name == b"eXIf" and length <= EXIF_BYTES:
            orientation = _exif_orientation(file.read(length))
        elif name == b"acTL":  # an animation
            (pages,) = struct.unpack_from(">I", file.read(length))
        elif name == b"gAMA" and length == 4:  # noqa: PLR2004 - one number
            gamma = struct.unpack(">I", file.read(length))[0] / GAMMA_ONE or 1.0
        elif name == b"IEND":
            break
        else:
            alpha |= name == b"tRNS"
            profile |= name in (b"sRGB", b"iCCP")
            file.seek(length, io.SEEK_CUR)
        file.seek(4, io.SEEK_CUR)
    return ImageTags(orientation, pages, alpha, profile=profile, gamma=gamma)


def _webp_tags(file: BinaryIO) -> ImageTags:
    file.seek(12)
    orientation, alpha = UPRIGHT, False
    for _ in range(MAX_CHUNKS):
        head = file.read(8)
        if len(head) < 8:  # noqa: PLR2004 - the end
            break
        name, length = struct.unpack("<4sI", head)
        if name == b"VP8X":
            alpha = bool(file.read(length)[0] & WEBP_ALPHA)
        elif name == b"EXIF" and length <= EXIF_BYTES:
            orientation = _exif_orientation(file.read(length).removeprefix(b"Exif\0\0"))
        else:
            file.seek(length, io.SEEK_CUR)
        file.seek(length & 1, io.SEEK_CUR)
    return ImageTags(orientation, alpha=alpha)


def _tga_tags(file: BinaryIO) -> ImageTags:
    head = file.read(18)
    return ImageTags(alpha=head[16] == 32 and head[17] & TGA_ALPHA_BITS > 0)  # noqa: PLR2004 - bits a pixel


def _exif_orientation(content: bytes) -> int:
    try:
        return _valid(next(_directories(io.BytesIO(content), only_first=True), {}).get(ORIENTATION, UPRIGHT))
    except (struct.error, IndexError):
        return UPRIGHT


def _valid(orientation: int) -> int:
    return orientation if orientation in range(1, 9) else UPRIGHT
