"""Which files bgars wrote: known by what is in them, never by their names."""

from __future__ import annotations

import json
import re
import struct
import zlib
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from bgars.errors import InputError

if TYPE_CHECKING:
    import os
    from collections.abc import Iterable

__all__ = ["foreign_files", "is_own", "need_new_or_own", "sign"]

HEAD_BYTES, TAIL_BYTES = 4096, 1 << 16
SIGNATURE = b"bgars"
PNG_START, PNG_HEADER_END = b"\x89PNG\r\n\x1a\n", 33
PNG_TEXT = b"tEXtSoftware\0" + SIGNATURE
JPEG_START = b"\xff\xd8"
JPEG_COMMENT = b"\xff\xfe" + struct.pack(">H", 2 + len(SIGNATURE)) + SIGNATURE
STL_HEADER_BYTES = 80
OWN_JSON = re.compile(rb'\A\s*\{\s*"(?:format"\s*:\s*"bgars-|bgars"\s*:\s*")')
OWN_TEXT = {
    # Generators of pages, descriptions of TIFF files, comments of meshes, metadata of tables.
    ".html": re.compile(rb'<meta name="generator" content="bgars'),
    ".svg": re.compile(rb"\A<svg [^>]*><title>Balls: outline"),
    ".tif": re.compile(rb'"content": "bgars '),
    ".ply": re.compile(rb"\Aply\n.*comment bgars mesh", re.DOTALL),
    ".obj": re.compile(rb"\A# bgars mesh"),
    ".png": re.compile(re.escape(PNG_TEXT)),
    ".jpg": re.compile(b"\\A" + re.escape(JPEG_START + JPEG_COMMENT)),
    ".stl": re.compile(b"\\A" + SIGNATURE),
    ".parquet": re.compile(SIGNATURE),
    ".gsf": re.compile(rb"\nTitle = bgars "),
    ".sdf": re.compile(rb"\AbISO-1\.0bgars"),
    ".npz": re.compile(rb"ball_height_um\.npy|coefficients\.npy"),
    ".toml": re.compile(rb'\A(?:#[^\n]*\n)*(?:format = "bgars-|diffuse_level = )'),
    ".md": re.compile(rb"(?:Command:|Written by) `(?:bgars experiment|python -m experiments) "),
    ".glb": re.compile(rb'"generator":\s*"bgars'),
}
OWN_TABLES = (
    b"name,row,col,present,verdict,reasons,",
    b"part,placement,repeat,ball,characteristic,value",
    b"strip,place,serial,verdict,reason,",
)
MARKS = ("summary.json", "result.json")
"""Each says, in its own content, whose run its folder holds."""
SIBLINGS = {".npy": "summary.json", ".glb": "summary.json", ".x3p": "summary.json"}
"""Kinds that hold no text, or only packed: own where the run that lies beside them lists them."""


def is_own(path: Path) -> bool:
    """Whether bgars wrote a file."""
    try:
        with path.open("rb") as file:
            head = file.read(HEAD_BYTES)
            size = file.seek(0, 2)
            file.seek(max(size - TAIL_BYTES, 0))
            tail = file.read(TAIL_BYTES)
    except OSError:
        return False
    suffix = path.suffix.lower()
    if suffix == ".json":
        return OWN_JSON.match(head) is not None or _is_message_of_own(path)
    if suffix == ".csv":
        return head.startswith(OWN_TABLES)
    if suffix in SIBLINGS and path.name in _listed(path.with_name(SIBLINGS[suffix])):
        return True
    known = OWN_TEXT.get(suffix)
    # Descriptions and tables of contents may lie at either end.
    return known is not None and any(known.search(part) for part in (head, tail))


def need_new_or_own(output: str | os.PathLike[str], *inputs: str | os.PathLike[str] | None) -> None:
    """Raise InputError where a file of results would replace an input, or a file that bgars did not write.

    Parameters
    ----------
    output : path
        File to be written; need not exist.
    inputs : paths or None
        Files that the command reads.
    """
    path = Path(output)
    if not path.is_file():
        return
    for given in inputs:
        if given is not None and Path(given).is_file() and path.samefile(given):
            msg = f"{path}: is read by this command, and results never replace inputs; name another file"
            raise InputError(msg)
    if not is_own(path):
        msg = f"{path}: exists, and bgars did not write it; move it away, or name another file"
        raise InputError(msg)


def foreign_files(folder: Path, names: Iterable[str]) -> list[str]:
    """Which of these names a folder has that are not of bgars."""
    return sorted(name for name in names if (folder / name).exists() and not is_own(folder / name))


def sign(path: Path) -> None:
    """Say in a picture or a mesh that bgars wrote it; files of other kinds say so already."""
    suffix = path.suffix.lower()
    if suffix == ".stl":
        with path.open("r+b") as file:
            if file.seek(0, 2) > STL_HEADER_BYTES:
                file.seek(0)
                file.write(SIGNATURE + b" mesh")
        return
    if suffix not in {".png", ".jpg"} or is_own(path):
        return
    content = path.read_bytes()
    if suffix == ".png" and content.startswith(PNG_START):
        chunk = struct.pack(">I", len(PNG_TEXT) - 4) + PNG_TEXT + struct.pack(">I", zlib.crc32(PNG_TEXT))
        path.write_bytes(content[:PNG_HEADER_END] + chunk + content[PNG_HEADER_END:])
    elif suffix == ".jpg" and content.startswith(JPEG_START):
        path.write_bytes(JPEG_START + JPEG_COMMENT + content[len(JPEG_START) :])


def _listed(mark: Path) -> frozenset[str]:
    """The files that a run says it wrote."""
    with suppress(OSError, ValueError, RecursionError):
        content = mark.read_bytes()
        if OWN_JSON.match(content):
            return frozenset(name for name in json.loads(content).get("files", ()) if isinstance(name, str))
    return frozenset()


def _is_message_of_own(path: Path) -> bool:
    """Whether a message for a factory is that of the result beside it: format and time are its own."""
    with suppress(OSError, ValueError, RecursionError, AttributeError):
        result = path.with_name("result.json")
        if path.name != result.name and OWN_JSON.match(result.read_bytes()[:HEAD_BYTES]):
            time = json.loads(result.read_bytes()).get("inspected_utc")
            message = json.loads(path.read_bytes())
            return bool(time) and message.get("MessageName", "").startswith("CFX.") and message["TimeStamp"] == time
    return False
