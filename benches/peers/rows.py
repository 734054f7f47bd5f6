"""What a script reports: one JSON object a line on its standard output."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from timing import Timed

Bound = Literal["at least", "at most"]


def met(value: float, bound: Bound, limit: float | None) -> bool | None:
    """Whether a value keeps its limit; None where there is none."""
    if limit is None:
        return None
    return value >= limit if bound == "at least" else value <= limit


@dataclass(frozen=True)
class Ratio:
    """One line of the ratio table.

    Attributes
    ----------
    ratio : float
        Where the limit is a least ratio: peer seconds / bgars seconds (how many times as fast). Where it is a greatest
        one: bgars seconds / peer seconds (how many times as long).
    """

    group: str
    what: str
    size: str
    threads: int
    bgars_s: float
    peer: str
    peer_s: float
    ratio: float
    bound: Bound
    limit: float | None
    met: bool | None
    kind: str = "ratio"


@dataclass(frozen=True)
class Check:
    """A figure that is no time: an error, a count, bytes."""

    group: str
    what: str
    size: str
    threads: int
    value: float
    unit: str
    bound: Bound
    limit: float | None
    met: bool | None
    kind: str = "check"


@dataclass(frozen=True)
class Point:
    """A point of the scaling plot."""

    group: str
    shape: str
    megapixels: float
    threads: int
    seconds: float
    iterations: int
    kind: str = "point"


@dataclass(frozen=True)
class Roofline:
    """Work of one pass over a pixel beside what the machine copies in that time."""

    group: str
    what: str
    size: str
    threads: int
    bytes_per_pixel: float
    operations_per_pixel: float
    seconds: float
    pixels: int
    copy_bytes_per_s: float
    kind: str = "roofline"


@dataclass(frozen=True)
class Skipped:
    """A measurement that could not be made here, and why."""

    group: str
    what: str
    why: str
    kind: str = "skipped"


Row = Ratio | Check | Point | Roofline | Skipped


def emit(row: Row) -> None:
    """Hand a row to whoever started this script."""
    sys.stdout.write(json.dumps(asdict(row)) + "\n")
    sys.stdout.flush()


def emit_ratio(
    group: str,
    what: str,
    size: str,
    threads: int,
    peer: str,
    timed: Timed,
    bound: Bound = "at least",
    limit: float | None = None,
) -> None:
    """Hand over a comparison."""
    ratio = timed.speedup if bound == "at least" else 1.0 / timed.speedup
    emit(
        Ratio(
            group, what, size, threads, timed.bgars_s, peer, timed.peer_s, ratio, bound, limit, met(ratio, bound, limit)
        )
    )


def emit_check(
    group: str,
    what: str,
    size: str,
    threads: int,
    value: float,
    unit: str,
    bound: Bound = "at most",
    limit: float | None = None,
) -> None:
    """Hand over a figure that is no time."""
    value = float(value)
    emit(Check(group, what, size, threads, value, unit, bound, limit, met(value, bound, limit)))


def has(group: str, what: str, *modules: str) -> bool:
    """Whether every module of a peer is installed; a skipped row says which are not."""
    missing = [module for module in modules if find_spec(module) is None]
    if missing:
        emit(Skipped(group, what, f"not installed: {', '.join(missing)}"))
    return not missing
