"""Image formats that are read: how each is known by its bytes, and which decoder reads it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from bgars.errors import FileFormatError
from bgars.files.safe_files import need_regular

if TYPE_CHECKING:
    from collections.abc import Callable

    from bgars.records.pixels import PixelArray

__all__ = ["IMAGE_FORMATS", "IMAGE_SUFFIXES", "ImageFormat", "format_of", "read_pixels"]

HEAD_BYTES = 64


class ImageFormat(NamedTuple):
    """A kind of image file.

    Attributes
    ----------
    name : str
        What it is called.
    suffixes : tuple of str
        Lower-case endings of its files.
    magics : tuple of bytes
        How its files begin; empty where only the ending tells.
    decoder : str
        Module of :mod:`bgars.io.decoders` that reads it where the compiled decoder does not.
    core : bool
        The compiled decoder reads it.
    stack : bool
        One file may hold the images of all lights.
    lossy : bool
        Made for the eye: hardly ever proportional to light.
    """

    name: str
    suffixes: tuple[str, ...]
    magics: tuple[bytes, ...]
    decoder: str
    core: bool = False
    stack: bool = False
    lossy: bool = False


IMAGE_FORMATS = (
    # By their endings, since many of them begin as TIFF files do.
    ImageFormat(
        "camera raw",
        (".dng", ".nef", ".cr2", ".cr3", ".arw", ".raf", ".orf", ".rw2", ".pef", ".srw"),
        (),
        "raw",
    ),
    ImageFormat("PNG", (".png",), (b"\x89PNG\r\n\x1a\n",), "pillow", core=True),
    ImageFormat("TIFF", (".tif", ".tiff"), (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"), "tiff", core=True, stack=True),
    ImageFormat("JPEG", (".jpg", ".jpeg"), (b"\xff\xd8\xff",), "pillow", core=True, lossy=True),
    ImageFormat("BMP", (".bmp",), (b"BM",), "pillow", core=True),
    ImageFormat("PNM", (".pgm", ".ppm", ".pnm"), (b"P2", b"P3", b"P5", b"P6"), "pillow", core=True),
    ImageFormat("WebP", (".webp",), (b"RIFF",), "pillow", lossy=True),
    ImageFormat("GIF", (".gif",), (b"GIF87a", b"GIF89a"), "pillow", lossy=True),
    ImageFormat("OpenEXR", (".exr",), (b"\x76\x2f\x31\x01",), "exr"),
    ImageFormat("Radiance HDR", (".hdr",), (b"#?RADIANCE", b"#?RGBE"), "hdr"),
    ImageFormat("PFM", (".pfm",), (b"PF", b"Pf"), "pfm"),
    ImageFormat("NumPy array", (".npy",), (b"\x93NUMPY",), "npy", stack=True),
    ImageFormat("TGA", (".tga",), (), "pillow"),
)
"""The decoders that a file can reach: nothing else is ever started, whatever its bytes or its name."""

IMAGE_SUFFIXES = frozenset(suffix for kind in IMAGE_FORMATS for suffix in kind.suffixes)

NOT_READ = {
    b"%!PS": "PostScript",
    b"\xc5\xd0\xd3\xc6": "PostScript (EPS)",
    b"%PDF": "PDF",
    b"8BPS": "Photoshop",
    b"\0\0\0\x0cjP  ": "JPEG 2000",
    b"\xff\x4f\xff\x51": "JPEG 2000",
    b"\xff\x0a": "JPEG XL",
    b"\0\0\0\x0cJXL ": "JPEG XL",
    b"<svg": "SVG",
    b"<?xml": "XML",
    b"<!DOCTYPE": "a web page",
    b"<html": "a web page",
}
"""Formats that are recognised in order to name them."""
LFS_POINTER = b"version https://git-lfs"


def format_of(path: Path) -> ImageFormat:
    """Return the format of an image file, by its first bytes (camera raw and TGA: by its ending).

    Raises
    ------
    FileFormatError
        No such file, an empty one, no regular one, or no format that is read.
    """
    if need_regular(path, "image file") == 0:
        msg = f"{path}: is empty (0 bytes), not an image"
        raise FileFormatError(msg)
    try:
        with path.open("rb") as file:
            head = file.read(HEAD_BYTES)
    except OSError as error:
        msg = f"{path}: cannot be read ({error.strerror})"
        raise FileFormatError(msg) from error
    suffix = path.suffix.lower()
    for kind in IMAGE_FORMATS:
        if (not kind.magics and suffix in kind.suffixes) or head.startswith(kind.magics or (b"\xff\xff\xff\xff\xff",)):
            return kind
    name = next((name for magic, name in NOT_READ.items() if head.startswith(magic)), None)
    if head[4:8] == b"ftyp":
        name = "HEIF, AVIF or a film"
    if head.startswith(LFS_POINTER):
        msg = f"{path}: cannot be decoded as an image (it is a Git LFS pointer: git lfs pull fetches the image)"
        raise FileFormatError(msg)
    told = "unknown file format" if name is None else f"it is {name}, which is not read; convert it to PNG or TIFF"
    msg = f"{path}: cannot be decoded as an image ({told})"
    raise FileFormatError(msg)


def read_pixels(path: Path, max_megapixels: float, kind: ImageFormat | None = None) -> PixelArray:
    """Return the pixels of an image file as (H, W) or (H, W, channels), without the compiled decoder.

    Raises
    ------
    FileFormatError
        The file cannot be decoded, is too large, or needs an optional package that is not installed.
    """
    kind = format_of(path) if kind is None else kind
    try:
        return _decoder(kind.decoder)(path, kind, max_megapixels)
    except (FileFormatError, MemoryError):
        raise
    except ImportError as error:
        extra = {"raw": "raw", "exr": "exr"}.get(kind.decoder)
        if extra is None:
            msg = f"{path}: {kind.name} of this kind is not read; save it without compression or with LZW ({error})"
        else:
            msg = f"{path}: {kind.name} needs an optional package: pip install 'bgars[{extra}]' ({error})"
        raise FileFormatError(msg) from error
    except Exception as error:  # decoders raise whatever their libraries raise; here all of it means one thing
        reason = " ".join(str(error).split())[:200]
        msg = f"{path}: cannot be decoded as an image ({type(error).__name__}: {reason})"
        raise FileFormatError(msg) from error


def _decoder(name: str) -> Callable[[Path, ImageFormat, float], PixelArray]:
    """Return a decoder, imported when it is needed."""
    from bgars.io import decoders  # noqa: PLC0415 - so are its libraries

    read: Callable[[Path, ImageFormat, float], PixelArray] = getattr(decoders, f"read_{name}")
    return read
