"""Patterns in a control chart that chance hardly makes: the eight rules of Nelson."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

__all__ = ["NELSON", "nelson_signals", "parse_rules"]

NELSON = {
    1: "Nelson 1: beyond 3 sigma",
    2: "Nelson 2: 9 in a row on one side",
    3: "Nelson 3: 6 in a row rising or falling",
    4: "Nelson 4: 14 in a row up and down in turn",
    5: "Nelson 5: 2 of 3 beyond 2 sigma on one side",
    6: "Nelson 6: 4 of 5 beyond 1 sigma on one side",
    7: "Nelson 7: 15 in a row within 1 sigma",
    8: "Nelson 8: 8 in a row beyond 1 sigma, on both sides",
}


def parse_rules(text: str) -> tuple[int, ...]:
    """Return the rules that are asked for, such as ``"1,2,5"`` or ``"all"``.

    Raises
    ------
    InputError
        No such rule.

    Examples
    --------
    >>> parse_rules("2, 5"), parse_rules("")
    ((2, 5), ())
    """
    if text.strip() == "all":
        return tuple(NELSON)
    found = []
    for piece in filter(None, (piece.strip() for piece in text.split(","))):
        if not piece.isdecimal() or int(piece) not in NELSON:
            msg = f"nelson: knows the rules 1 to 8, separated by commas, or all; got {piece!r}"
            raise InputError(msg)
        found.append(int(piece))
    return tuple(sorted(set(found)))


def nelson_signals(deviations: NDArray[np.float64], rules: Iterable[int]) -> Iterator[tuple[int, str]]:
    """Yield place and rule of each pattern; a signal stands at the value that completes it.

    Parameters
    ----------
    deviations : (m,) float64
        From the centre, in sigma of the charted values.
    rules : iterable of int
        1 to 8.

    References
    ----------
    L. S. Nelson, The Shewhart control chart: tests for special causes, Journal of Quality Technology 16 (1984) 237.

    Examples
    --------
    >>> list(nelson_signals(np.array([0.1, -0.2, 3.5]), [1]))
    [(2, 'Nelson 1: beyond 3 sigma')]
    """
    for rule in rules:
        fewest, window, holds = RULES[rule]
        for at in range(fewest - 1, len(deviations)):
            if holds(deviations[max(0, at + 1 - window) : at + 1]):
                yield at, NELSON[rule]


def _beyond(count: int, sigmas: float) -> Callable[[NDArray[np.float64]], bool]:
    """Whether so many values, the last one among them, lie beyond so many sigma on one side."""

    def holds(window: NDArray[np.float64]) -> bool:
        return any(side * window[-1] > sigmas and int((side * window > sigmas).sum()) >= count for side in (1.0, -1.0))

    return holds


def _runs(window: NDArray[np.float64]) -> bool:
    steps = np.diff(window)
    return bool((steps > 0).all() or (steps < 0).all())


def _alternates(window: NDArray[np.float64]) -> bool:
    steps = np.sign(np.diff(window))
    return bool(steps.all() and (steps[1:] == -steps[:-1]).all())


def _is_calm(window: NDArray[np.float64]) -> bool:
    return bool((np.abs(window) < 1.0).all())


def _is_torn(window: NDArray[np.float64]) -> bool:
    return bool((np.abs(window) > 1.0).all() and (window > 0).any() and (window < 0).any())


RULES: dict[int, tuple[int, int, Callable[[NDArray[np.float64]], bool]]] = {
    1: (1, 1, _beyond(1, 3.0)),
    2: (9, 9, _beyond(9, 0.0)),
    3: (6, 6, _runs),
    4: (14, 14, _alternates),
    5: (2, 3, _beyond(2, 2.0)),
    6: (4, 5, _beyond(4, 1.0)),
    7: (15, 15, _is_calm),
    8: (8, 8, _is_torn),
}
"""Values that can hold the pattern of a rule, as at the start of a chart; those that it looks at; whether it holds."""
