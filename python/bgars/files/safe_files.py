"""Files that a caller names: only regular ones are opened, and text is bounded and of any common encoding."""

from __future__ import annotations

import codecs
import stat
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from bgars.errors import FileFormatError

if TYPE_CHECKING:
    import os

__all__ = [
    "MAX_TEXT_BYTES",
    "Text",
    "decode_text",
    "need_readable",
    "need_regular",
    "read_bounded",
    "read_text",
    "shown",
]

MAX_TEXT_BYTES = 8_000_000
"""Largest text file that is read: 65,536 lines of a response table have 3 MB."""
MARKS = {
    codecs.BOM_UTF32_LE: "utf-32-le",
    codecs.BOM_UTF32_BE: "utf-32-be",
    codecs.BOM_UTF8: "utf-8",
    codecs.BOM_UTF16_LE: "utf-16-le",
    codecs.BOM_UTF16_BE: "utf-16-be",
}
"""Byte order marks; that of UTF-16 is the beginning of that of UTF-32, which therefore stands first."""
KINDS = {
    stat.S_ISDIR: "a folder",
    stat.S_ISFIFO: "a named pipe",
    stat.S_ISCHR: "a device",
    stat.S_ISBLK: "a device",
    stat.S_ISSOCK: "a socket",
}
TEXT_CONTROLS = frozenset(b"\t\n\v\f\r\x1a")


class Text(NamedTuple):
    """Text of a file, and how its bytes were read."""

    content: str
    encoding: str


def need_regular(path: str | os.PathLike[str], what: str = "file") -> int:
    """Return the size in bytes of a regular file.

    Opening a pipe or a device would wait or never end, so these are refused unopened; so are names that no file can
    have, and links that lead in a circle.

    Raises
    ------
    FileFormatError
        There is none, it is something else, or its name is impossible.
    """
    try:
        found = Path(path).stat()
    except FileNotFoundError as error:
        is_link = Path(path).is_symlink()
        msg = f"{shown(path)}: is a link to what is not there" if is_link else f"{shown(path)}: no such {what}"
        raise FileFormatError(msg) from error
    except OSError as error:
        msg = f"{shown(path)}: cannot be read ({error.strerror or error})"
        raise FileFormatError(msg) from error
    except ValueError as error:  # a NUL in the name
        msg = f"{shown(path)}: is no possible name of {_a(what)} ({error})"
        raise FileFormatError(msg) from error
    if not stat.S_ISREG(found.st_mode):
        kind = next((name for is_kind, name in KINDS.items() if is_kind(found.st_mode)), "no regular file")
        msg = f"{shown(path)}: is {kind}, not {_a(what)}"
        raise FileFormatError(msg)
    return found.st_size


def _a(what: str) -> str:
    return f"an {what}" if what[:1] in "aeiou" else f"a {what}"


def shown(path: str | os.PathLike[str]) -> str:
    """A name as it can be printed on one line."""
    text = str(path).encode("unicode_escape", "replace").decode("ascii") if not str(path).isprintable() else str(path)
    longest = 200
    return text if len(text) <= longest else f"{text[:longest]}..."


def need_readable(path: str | os.PathLike[str], what: str = "file") -> int:
    """Return the size of a file that is about to be read; as :func:`need_regular`, in the words of a reader."""
    try:
        return need_regular(path, what)
    except FileFormatError as error:
        reason = str(error).removeprefix(f"{shown(path)}: ")
        if reason.startswith("cannot be read"):
            raise
        msg = f"{shown(path)}: cannot be read ({reason})"
        raise FileFormatError(msg) from error


def read_bounded(path: str | os.PathLike[str], max_bytes: int = MAX_TEXT_BYTES, what: str = "file") -> bytes:
    """Return the bytes of a regular file of at most `max_bytes`.

    Raises
    ------
    FileFormatError
        As :func:`need_regular`, or the file is larger or cannot be read.
    """
    size = need_readable(path, what)
    if size <= max_bytes:
        try:
            with Path(path).open("rb") as file:
                content = file.read(max_bytes + 1)
        except OSError as error:
            msg = f"{path}: cannot be read ({error.strerror})"
            raise FileFormatError(msg) from error
        if len(content) <= max_bytes:
            return content
        size = len(content)
    msg = f"{path}: is larger than {_a(what)} of this kind may be ({size} bytes, at most {max_bytes})"
    raise FileFormatError(msg)


def read_text(path: str | os.PathLike[str], max_bytes: int = MAX_TEXT_BYTES) -> Text:
    """Return the text of a file and its encoding.

    Raises
    ------
    FileFormatError
        As :func:`read_bounded`, or the bytes are no text.
    """
    return decode_text(read_bounded(path, max_bytes), path)


def decode_text(content: bytes, path: str | os.PathLike[str]) -> Text:
    r"""Return the text of some bytes.

    As a byte order mark says, else UTF-8, else UTF-16 where a third of the bytes is zero, else Windows-1252.

    Raises
    ------
    FileFormatError
        The bytes are no text.

    Examples
    --------
    >>> decode_text("8\n".encode("utf-16"), "lights.lp")
    Text(content='8\n', encoding='utf-16-le')
    >>> decode_text(b"m\xfcnze_1.png 0 0 1", "lights.lp").encoding
    'cp1252'
    """
    for mark, encoding in MARKS.items():
        if content.startswith(mark):
            return Text(_decoded(content[len(mark) :], encoding, path), encoding)
    zeros = content.count(0)
    if zeros > len(content) // 3:
        odd = content[1::2].count(0)
        return _checked(Text(_decoded(content, "utf-16-le" if 2 * odd > zeros else "utf-16-be", path), "utf-16"), path)
    control = next((place for place, byte in enumerate(content) if byte < 0x20 and byte not in TEXT_CONTROLS), None)  # noqa: PLR2004 - the first printable code
    if control is not None:
        msg = f"{path}: is not a text file (byte {content[control]:#04x} at {control})"
        raise FileFormatError(msg)
    try:
        return Text(content.decode("utf-8"), "utf-8")
    except UnicodeDecodeError:
        return Text(content.decode("cp1252", "replace"), "cp1252")


def _decoded(content: bytes, encoding: str, path: str | os.PathLike[str]) -> str:
    try:
        return content.decode(encoding)
    except UnicodeDecodeError as error:
        msg = f"{path}: is not a text file ({error.reason} at byte {error.start}, read as {encoding})"
        raise FileFormatError(msg) from error


def _checked(text: Text, path: str | os.PathLike[str]) -> Text:
    if "\0" in text.content:
        msg = f"{path}: is not a text file (byte 0x00 at {text.content.index(chr(0))})"
        raise FileFormatError(msg)
    return text
