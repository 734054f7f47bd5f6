"""TOML and JSON as people write them: bounded, never too deep, and a mistake that is common is named with its cure."""

from __future__ import annotations

import json
import re
import sys
from typing import TYPE_CHECKING, Any

from bgars.errors import FileFormatError
from bgars.files.safe_files import read_text

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

if TYPE_CHECKING:
    from pathlib import Path

__all__ = ["read_values"]

MAX_BYTES = 1_000_000
"""Largest recipe: lists of some thousand lights have a tenth of it."""
MAX_DOTS = 32
LONG_KEY = re.compile(r"(?:[\w\"'-]{1,64}[ \t]{0,8}\.[ \t]{0,8}){33}")
"""Of 34 parts or more, with blanks between, wherever it stands: in tables within a line, too."""
BETWEEN_WORDS = re.compile(r"[\s,={}\[\]]+")
MAX_DEPTH = 20
"""Deepest nesting of tables and lists; the recipes need four."""
BACKSLASH = re.compile(r'"[^"\n]*\\[^"\n]*"')
CURLED = re.compile("[\u201c\u201d\u201e\u2018\u2019\u00ab\u00bb]")
"""Quotes of word processors."""
DECIMAL_COMMA = re.compile(r"=\s*[-+]?\d+,\d+\s*(#.*)?$", re.ASCII)
BARE_WORD = re.compile(r"^\s*[\w.\"-]+\s*=\s*(?P<word>[A-Za-z_./\\~][^\s\"'#]*)\s*(#.*)?$")
WORDS = {"true", "false", "inf", "nan"}


def read_values(path: Path) -> dict[str, Any]:
    """Read a ``.toml`` file, or a ``.json`` file with one object.

    Raises
    ------
    FileFormatError
        The file is missing, no regular file, too large, too deep, or does not parse.
    """
    is_json = path.suffix.lower() == ".json"
    kind = "JSON" if is_json else "TOML"
    text = read_text(path, MAX_BYTES)
    if text.encoding == "cp1252":
        msg = f"{path}: is not valid {kind} (its bytes are no UTF-8; save it as UTF-8)"
        raise FileFormatError(msg)
    if not is_json:
        _refuse_long_keys(text.content, path)
    try:
        values = json.loads(text.content) if is_json else tomllib.loads(text.content.replace("\r\n", "\n"))
    except RecursionError as error:
        msg = f"{path}: is not valid {kind} (nested too deeply)"
        raise FileFormatError(msg) from error
    except ValueError as error:  # both decoders' errors
        reason = " ".join(str(error).split())[:200]
        msg = f"{path}: is not valid {kind} ({reason}){'' if is_json else _cure(text.content, reason)}"
        raise FileFormatError(msg) from error
    if not isinstance(values, dict):
        msg = f"{path}: must hold one object, got {type(values).__name__}"
        raise FileFormatError(msg)
    _refuse_deep(values, path)
    return values


def _refuse_long_keys(content: str, path: Path) -> None:
    """A key of many parts makes the parser's time grow with their square."""
    for number, line in enumerate(content.splitlines(), start=1):
        if line.count(".") <= MAX_DOTS or line.lstrip().startswith("#"):
            continue
        # Not the numbers of a list, which dots are in, too.
        dots = max(word.count(".") for word in BETWEEN_WORDS.split(line))
        spaced = LONG_KEY.search(line)
        dots = max(dots, 0 if spaced is None else spaced[0].count("."))
        if dots > MAX_DOTS:
            msg = f"{path}: line {number}: a key of {dots + 1} parts or more; recipes need three at most"
            raise FileFormatError(msg)


def _refuse_deep(values: Any, path: Path) -> None:  # noqa: ANN401 - whatever a file holds
    level = [values]
    for _ in range(MAX_DEPTH):
        level = [
            inner
            for value in level
            for inner in (value.values() if isinstance(value, dict) else value)
            if isinstance(inner, dict | list)
        ]
        if not level:
            return
    msg = f"{path}: is nested more than {MAX_DEPTH} levels deep"
    raise FileFormatError(msg)


def _cure(content: str, reason: str) -> str:
    """What to write instead, where the mistake is a common one."""
    found = re.search(r"line (\d+)", reason)
    lines = content.splitlines()
    number = int(found[1]) if found else len(lines)
    line = lines[number - 1] if 0 < number <= len(lines) else ""
    if CURLED.search(line):
        return f"; write straight quotes: {_shown(CURLED.sub(chr(34), line.strip()))}"
    if BACKSLASH.search(line):
        return (
            f"; write the path with / instead of \\, or in single quotes: {_shown(line.strip().replace(chr(92), '/'))}"
        )
    if DECIMAL_COMMA.search(line):
        return f"; write numbers with a decimal point: {_shown(re.sub(r'(?<=[0-9]),(?=[0-9])', '.', line.strip()))}"
    word = BARE_WORD.match(line)
    if word and word["word"] not in WORDS:
        quoted = word["word"].replace("\\", "/")
        return f"; write text in quotes: {_shown(line.strip().replace(word['word'], chr(34) + quoted + chr(34)))}"
    return ""


def _shown(line: str) -> str:
    longest = 100
    return line if len(line) <= longest else f"{line[:longest]}..."
