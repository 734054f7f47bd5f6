"""Matrices as programs print and read them: NumPy, Python, MATLAB, C."""

from __future__ import annotations

import re

__all__ = ["as_lines"]

HEAD = re.compile(r"\s*(?:[A-Za-z_]\w*\s*=\s*)?(?:(?:np|numpy)\.)?(?:(?:as)?array\s*\()?\s*(?=[\[({])")
TYPE = re.compile(r",\s*dtype\s*=\s*[\w.'\"<>]+")
INNER = re.compile(r"[\[({]([^\[\](){}]*)[\])}]")
ROW = re.compile(r"[^;\n]+")
FLOAT_OF_C = re.compile(r"(?<=[\d.])f\b")
BETWEEN = re.compile(r"[\s,;\[\](){}]*")
NUMBERS = re.compile(r"[\s\d.,+\-eE]*")


def as_lines(text: str) -> list[tuple[int, str]] | None:
    r"""Return the rows of a matrix, each with the number of its line counted from 0; None for any other text.

    Rows end at brackets, where a matrix has brackets within brackets, else at semicolons and ends of lines.

    Examples
    --------
    >>> as_lines("L = [0.1 0.2 0.9; 0.3 0.2 0.8];")
    [(0, '0.1 0.2 0.9'), (0, '0.3 0.2 0.8')]
    >>> as_lines("array([[0, 0, 1],\n       [0, 0.6, 0.8]])")
    [(0, '0, 0, 1'), (1, '0, 0.6, 0.8')]
    >>> as_lines("a.png [0, 0, 1]") is None
    True
    """
    head = HEAD.match(text)
    if head is None:
        return None
    body = TYPE.sub("", text[head.end() :])
    inner = [each for each in INNER.finditer(body) if each[1].strip()]
    if not inner or BETWEEN.fullmatch(INNER.sub("", body)) is None:
        return None
    first = text.count("\n", 0, head.end())
    rows: list[tuple[int, str]] = []
    for each in inner:
        # Of several rows in brackets each is one, however many lines it takes.
        parts = [each] if len(inner) > 1 else list(ROW.finditer(body, each.start(1), each.end(1)))
        for part in parts:
            content = part[1] if len(inner) > 1 else part[0]
            row = " ".join(FLOAT_OF_C.sub("", content).split()).strip(", ")
            if NUMBERS.fullmatch(row) is None:
                return None
            if row:
                rows.append((first + body.count("\n", 0, part.start()), row))
    return rows
