"""Names of balls after JEDEC JEP95 (SPP-010): letters for rows from the top of the image, numbers for columns."""

from __future__ import annotations

import re

from bgars.errors import InputError

__all__ = ["ROW_LETTERS", "ball_name", "ball_place", "mirrored_name"]

ROW_LETTERS = "ABCDEFGHJKLMNPRTUVWY"
"""No I, O, Q, S, X, Z: too like 1, 0, 0, 5, a mark, 2."""
NAME = re.compile(rf"([{ROW_LETTERS}]+)([1-9][0-9]*)")


def ball_name(row: int, col: int) -> str:
    """Name of a place, row and column counted from 0 at the top left.

    Examples
    --------
    >>> ball_name(0, 0), ball_name(8, 11), ball_name(20, 0)
    ('A1', 'J12', 'AA1')
    """
    letters, rest = "", row + 1
    while rest > 0:
        rest, place = divmod(rest - 1, len(ROW_LETTERS))
        letters = ROW_LETTERS[place] + letters
    return f"{letters}{col + 1}"


def ball_place(name: str) -> tuple[int, int]:
    """Row and column of a name, from 0.

    Raises
    ------
    InputError
        No such name: letters I, O, Q, S, X and Z are not used, columns start at 1.

    Examples
    --------
    >>> ball_place("J12"), ball_place("AA1")
    ((8, 11), (20, 0))
    """
    match = NAME.fullmatch(name)
    if match is None:
        msg = f"ball name: must be row letters of {ROW_LETTERS} and a column from 1, such as 'A1', got {name!r}"
        raise InputError(msg)
    row = 0
    for letter in match[1]:
        row = row * len(ROW_LETTERS) + ROW_LETTERS.index(letter) + 1
    return row - 1, int(match[2]) - 1


def mirrored_name(name: str, cols: int) -> str:
    """Name of the same ball when columns are counted from the other side.

    Examples
    --------
    >>> mirrored_name("B1", 5)
    'B5'
    """
    row, col = ball_place(name)
    return ball_name(row, cols - 1 - col)
