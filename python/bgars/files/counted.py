"""A number and its noun."""

from __future__ import annotations

__all__ = ["counted"]


def counted(number: int, noun: str) -> str:
    """Return a number and its noun, regular and in the right number.

    Examples
    --------
    >>> counted(1, "ball"), counted(0, "ball")
    ('1 ball', '0 balls')
    """
    return f"{number} {noun}{'' if number == 1 else 's'}"
