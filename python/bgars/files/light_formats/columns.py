"""Lines of an optional name and numbers, as people separate them: blanks, tabs, commas, semicolons, decimal commas."""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from bgars.files.light_formats.matrices import as_lines

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["Line", "Row", "Style", "as_number", "by_number", "data_lines", "find_style", "parse_row"]

NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?|[-+]?(nan|inf)", re.IGNORECASE | re.ASCII)
DECIMAL_COMMA = re.compile(r"[-+]?\d+,\d+([eE][-+]?\d+)?", re.ASCII)
NUMBER_AT_END = re.compile(r"(?<![\d.])(\d{1,6})(?:\.0*)?$", re.ASCII)
PLAIN_INTEGER = re.compile(r"[-+]?\d+", re.ASCII)
NAME_WITH_SUFFIX = re.compile(r".*\.[A-Za-z][A-Za-z0-9]{1,4}")
SUFFIX_AND_NUMBER = re.compile(rf"(?P<name>{NAME_WITH_SUFFIX.pattern})\s+(?P<number>{NUMBER.pattern})", re.IGNORECASE)
QUOTED = re.compile(r"(?P<quote>[\"'])(?P<name>.*?)(?P=quote)\s*[,;\t ]?(?P<rest>.*)")
QUOTED_DECIMAL_COMMA = re.compile(r"\"[-+]?\d+,\d+\"", re.ASCII)
BRACKETED = re.compile(r"(?P<name>.*?)[\s,;]*[\[({](?P<vector>[^\[\](){}]*)[\])}]")
MINUS = re.compile(r"(?<![^\s,;=\[({eEdD\"'])\N{MINUS SIGN}(?=[\d.])")
FORTRAN = re.compile(r"(?<![\w.])([-+]?(?:\d+\.\d*|\.\d+))[dD]([-+]?\d{1,3})(?![\w.])", re.ASCII)
"""Double precision has the exponent D there, and always a point (ISO/IEC 1539-1, 13.7.2.3.3)."""
SEPARATOR_OF_EXCEL = re.compile(r"\s*\"?sep=.\"?\s*", re.IGNORECASE)
BRACKETS = str.maketrans("[](){}", "      ")
LONGEST_NUMBER = 64
AXES = 3
COMMENTS = ("#", "%", "//")


class Line(NamedTuple):
    """A line that says something."""

    number: int
    text: str


class Row(NamedTuple):
    """What a line holds."""

    name: str
    numbers: tuple[float, ...]


@dataclass(frozen=True)
class Style:
    """How a file separates its fields."""

    separator: str | None
    decimal_comma: bool


def data_lines(text: str) -> list[Line]:
    """Return the lines that are neither empty nor comments, without a separator at their ends; or rows of a matrix.

    Numbers with the minus sign of Unicode or the exponent of Fortran (1.0D-01) become plain ones.
    """
    text = FORTRAN.sub(r"\1e\2", MINUS.sub("-", text))
    lines = []
    for number, line in enumerate(text.splitlines(), start=1):
        if number == 1 and SEPARATOR_OF_EXCEL.fullmatch(line):
            continue
        content = re.split(r"(?:^|\s)#", line, maxsplit=1)[0].strip().strip("\x1a")
        if content and not content.startswith(COMMENTS):
            lines.append(Line(number, content))
    rows = as_lines("\n".join(line.text for line in lines))
    if rows is not None:
        return [Line(lines[place].number, row) for place, row in rows]
    return [Line(line.number, line.text.rstrip(";, ") or line.text) for line in lines]


def find_style(lines: Sequence[Line], least: int = AXES) -> Style:
    """Return how the fields of some lines are separated.

    Semicolons separate wherever they occur. Commas are decimal where a line has at least `least` fields between blanks
    that are numbers only with a decimal comma; elsewhere they separate.

    Examples
    --------
    >>> find_style([Line(1, "a.png 0,5 0 0,8")]), find_style([Line(1, "a.png, 0.5, 0, 0.8")])
    (Style(separator=None, decimal_comma=True), Style(separator=',', decimal_comma=False))
    """
    texts = [line.text for line in lines]
    if any(QUOTED_DECIMAL_COMMA.search(text) for text in texts):
        return Style(",", decimal_comma=True)
    if any(";" in text for text in texts):
        decimal = any(DECIMAL_COMMA.fullmatch(part.strip()) for text in texts for part in text.split(";"))
        return Style(";", decimal_comma=decimal)
    if not any("," in text for text in texts):
        return Style(None, decimal_comma=False)
    for text in texts:
        fields = [field for field in text.split() if _is_decimal_comma(field) or PLAIN_INTEGER.fullmatch(field)]
        if len(fields) >= least and any(_is_decimal_comma(field) for field in fields):
            return Style(None, decimal_comma=True)
    return Style(",", decimal_comma=False)


def parse_row(text: str, style: Style) -> Row | None:
    """Return the name ("" where there is none) and the numbers of a line; None where no number ends it."""
    quoted = QUOTED.fullmatch(text)
    if quoted and not QUOTED_DECIMAL_COMMA.fullmatch(f'"{quoted["name"]}"'):
        fields = _split(quoted["rest"], style)
        numbers = [as_number(field, style) for field in fields]
        return None if not numbers or None in numbers else Row(quoted["name"], _all(numbers))
    if text[0] in "[({":  # as programs print vectors
        text = text.translate(BRACKETS).strip(" ,")
    fields = _split(text, style)
    numbers = [as_number(field, style) for field in fields]
    first = len(fields)
    while first > 0 and numbers[first - 1] is not None:
        first -= 1
    if first == len(fields):
        bracketed, between = BRACKETED.fullmatch(text), style.separator or " "
        return None if bracketed is None else parse_row(f"{bracketed['name']}{between}{bracketed['vector']}", style)
    if first == 0:
        return Row("", _all(numbers))
    glued = SUFFIX_AND_NUMBER.fullmatch(fields[0]) if first == 1 and len(fields) == AXES else None
    if glued is not None:  # a.png 0.1, 0.2, 0.9
        return parse_row(style.separator.join([glued["name"], glued["number"], *fields[1:]]), style)  # type: ignore[union-attr]
    if style.separator is not None:
        return Row(fields[0].strip("\"'"), _all(numbers[1:])) if first == 1 else None
    # Names may hold blanks and end in a number; one with a suffix is whole.
    count = len(fields) - first
    if not NAME_WITH_SUFFIX.fullmatch(fields[first - 1]):
        count = min(count, AXES)
    name = text.rsplit(maxsplit=count)[0].strip()
    return Row(name, _all(numbers[len(fields) - count :]))


def as_number(field: str, style: Style) -> float | None:
    """Return the number of a field, or None."""
    field = field.strip().strip("\"'")
    if style.decimal_comma and DECIMAL_COMMA.fullmatch(field):
        field = field.replace(",", ".")
    if len(field) > LONGEST_NUMBER or not NUMBER.fullmatch(field):
        return None
    return float(field)


def by_number(labels: Sequence[str]) -> list[int] | None:
    """Places of some labels in the order of the numbers at their ends; None where these are not one of each.

    Examples
    --------
    >>> by_number(["LED 2", "LED 1", "LED 10"]), by_number(["left", "right"])
    ([1, 0, 2], None)
    """
    ends = [NUMBER_AT_END.search(label) for label in labels]
    numbers = [int(end[1]) for end in ends if end]
    if not len(set(numbers)) == len(numbers) == len(labels):
        return None
    return sorted(range(len(numbers)), key=numbers.__getitem__)


def _is_decimal_comma(field: str) -> bool:
    return DECIMAL_COMMA.fullmatch(field) is not None


def _split(text: str, style: Style) -> list[str]:
    if style.separator is None:
        return text.split()
    if '"' in text:
        try:
            rows = list(csv.reader([text], delimiter=style.separator))
        except csv.Error:  # a field of more than 100,000 characters
            return [text]
        return [field.strip() for row in rows for field in row if field.strip()]
    if style.separator == "," and not style.decimal_comma:
        return [part for field in text.split(",") for part in _numbers_between_blanks(field.strip()) if part]
    return [part.strip() for part in text.split(style.separator) if part.strip()]


def _numbers_between_blanks(field: str) -> list[str]:
    """Fields of ``a, b c``: blanks separate numbers, but belong to names."""
    parts = field.split()
    return parts if all(NUMBER.fullmatch(part) for part in parts) else [field]


def _all(numbers: Sequence[float | None]) -> tuple[float, ...]:
    return tuple(number for number in numbers if number is not None)
