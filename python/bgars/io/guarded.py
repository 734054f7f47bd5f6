"""Arrays out of .npy, .npz and TIFF files whoever made them: what a header claims is checked before it is believed."""

from __future__ import annotations

import math
import zipfile
from contextlib import contextmanager
from typing import IO, TYPE_CHECKING, Any

import numpy as np
import tifffile

from bgars.errors import FileFormatError
from bgars.files.safe_files import need_readable
from bgars.io.decoders.tiff import page_pixels, quiet
from bgars.io.decoders.tiff_photometric import is_palette
from bgars.io.described_tiff import description_of
from bgars.io.images import MAX_MEGAPIXELS

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.typing import NDArray

__all__ = ["decoding", "load_npy", "load_npz", "load_tiff", "stored_shape"]

MAX_VALUES = int(MAX_MEGAPIXELS * 1e6) * 4
"""Of one array: four a pixel of the largest image."""
MAX_MEMBERS = 64
NUMBERS = "buif"
NPY_MAGIC_BYTES = 8
RGB = 3


@contextmanager
def decoding(path: Path, what: str) -> Iterator[None]:
    """Turn whatever a decoder raises into one line that names the file and what it is not."""
    need_readable(path)
    try:
        yield
    except (FileFormatError, ImportError):
        raise
    except MemoryError as error:
        msg = f"{path}: there is not enough memory for it"
        raise MemoryError(msg) from error
    except OSError as error:
        msg = f"{path}: cannot be read ({error.strerror or _line(error)})"
        raise FileFormatError(msg) from error
    # Damaged files reach the odd corners of every decoder; all of it means one thing.
    except Exception as error:
        msg = f"{path}: is not {what} ({type(error).__name__}: {_line(error)})"
        raise FileFormatError(msg) from error


def load_npy(path: Path, what: str) -> NDArray[Any]:
    """Return the array of a ``.npy`` file.

    Raises
    ------
    FileFormatError
        Missing, cut off, too large, or no plain numbers.
    """
    with decoding(path, what), path.open("rb") as file:
        return _npy(file, path.stat().st_size, path)


def load_npz(path: Path, what: str) -> dict[str, NDArray[Any]]:
    """Return the arrays of a ``.npz`` file by name; those that are no plain numbers are left out."""
    found: dict[str, NDArray[Any]] = {}
    with decoding(path, what), zipfile.ZipFile(path) as archive:
        members = [member for member in archive.infolist() if member.filename.endswith(".npy")]
        if not 1 <= len(members) <= MAX_MEMBERS:
            msg = f"{path}: is not {what}: must hold 1 to {MAX_MEMBERS} arrays, got {len(members)}"
            raise FileFormatError(msg)
        for member in members:
            with archive.open(member) as file:
                try:
                    found[member.filename.removesuffix(".npy")] = _npy(file, member.file_size, path)
                except FileFormatError:
                    continue
    if not found:
        msg = f"{path}: is not {what}: holds no array of numbers"
        raise FileFormatError(msg)
    return found


def stored_shape(path: Path, what: str) -> tuple[int, ...]:
    """Return the shape that the header of a ``.npy`` or TIFF file claims.

    Raises
    ------
    FileFormatError
        As of the loading functions.
    """
    if path.suffix.lower() == ".npy":
        return load_npy(path, what).shape
    with decoding(path, what), quiet(), tifffile.TiffFile(path) as tiff:
        page = tiff.pages.first
        return (*page.shape, RGB) if is_palette(page) else tuple(page.shape)


def _npy(file: IO[bytes], size_bytes: int, path: Path) -> NDArray[Any]:
    """An array whose header agrees with the size of its file."""
    version = np.lib.format.read_magic(file)
    read_header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, fortran_order, dtype = read_header(file)
    values = math.prod(shape)
    if dtype.kind not in NUMBERS or dtype.hasobject:
        msg = f"{path}: must hold plain numbers, got {dtype}"
        raise FileFormatError(msg)
    if any(size < 1 for size in shape) or values > MAX_VALUES or values * dtype.itemsize > size_bytes:
        msg = f"{path}: is cut off or damaged: its header claims {dtype} of shape {shape} in {size_bytes} bytes"
        raise FileFormatError(msg)
    content = file.read(values * dtype.itemsize)
    if len(content) != values * dtype.itemsize:
        msg = f"{path}: is cut off: {len(content)} of {values * dtype.itemsize} bytes of its values are there"
        raise FileFormatError(msg)
    array = np.frombuffer(content, dtype)
    ordered: NDArray[Any] = array.reshape(shape[::-1]).T if fortran_order else array.reshape(shape)
    return ordered


def load_tiff(path: Path, what: str) -> tuple[NDArray[Any], dict[str, Any]]:
    """Return the image of a TIFF of one page, and the fields of its description where that is ours or of our like.

    Raises
    ------
    FileFormatError
        Missing, damaged, several pages, or a header that claims more than the file can hold.
    """
    with decoding(path, what), quiet(), tifffile.TiffFile(path) as tiff:
        page = tiff.pages.first
        _check_page(path, page, path.stat().st_size)
        if page.tags.get("NewSubfileType") is None and _has_second(tiff):
            msg = f"{path}: must hold one image, got several pages; save the one that counts alone"
            raise FileFormatError(msg)
        return page_pixels(path, page, 0, workers=1), description_of(tiff)


def _check_page(path: Path, page: tifffile.TiffPage, size_bytes: int) -> None:
    """Raise unless the decoder's work is bounded by what the file really holds."""
    shape, counts = page.shape, page.databytecounts
    values = math.prod(shape)
    reasons = (
        (page.dtype is None or page.dtype.kind not in NUMBERS, "holds no plain numbers"),
        (values < 1 or values > MAX_VALUES, f"its header claims shape {shape}"),
        (len(counts) != len(page.dataoffsets) or len(counts) > max(values, 1), "its table of strips is damaged"),
        # Decoders fill up what is missing, piece by piece, for as long as the header claims.
        (len(counts) != math.prod(page.chunked), "its table of strips does not fit its size"),
        (math.prod(page.chunks) > MAX_VALUES, f"its header claims pieces of {page.chunks}"),
        (any(count > size_bytes for count in counts), "its strips reach over the end of the file"),
        (any(offset > size_bytes for offset in page.dataoffsets), "its strips reach over the end of the file"),
        (len(counts) * math.prod(page.chunks) > 4 * MAX_VALUES, "its pieces are larger than the image"),
        (page.compression == 1 and sum(counts) < int(page.nbytes), "its strips hold too little"),
    )
    for holds, reason in reasons:
        if holds:
            msg = f"{path}: is cut off or damaged: {reason}"
            raise FileFormatError(msg)


def _has_second(tiff: tifffile.TiffFile) -> bool:
    try:
        tiff.pages[1]
    except IndexError:
        return False
    return True


def _line(error: BaseException) -> str:
    return " ".join(str(error).split())[:200]
