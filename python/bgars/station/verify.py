"""Readings against a part of known sizes: bias, linearity, repeatability, and whether a stated limit is kept.

In the manner of acceptance tests of measuring machines (ISO 10360, VDI/VDE 2617): calibrated sizes over the range of
use, measured several times, every single error within the maximum permissible error (MPE); the uncertainty of the
calibrated sizes is given to neither side, as ISO 14253-1 asks.
"""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from bgars.errors import CalibrationError, FileFormatError, InputError
from bgars.files.counted import counted
from bgars.files.safe_files import read_text
from bgars.records.remark import Remark
from bgars.records.station import Verification

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from os import PathLike

    from bgars.records.part_result import PartResult

__all__ = ["Known", "read_known", "verify"]

Quantity = Literal["height", "diameter"]
READINGS: dict[Quantity, str] = {"height": "top_um", "diameter": "diameter_um"}
COVERAGE = 2.0
LEAST_SIZES = 3
"""Different sizes that a slope needs."""


class Known(NamedTuple):
    """Calibrated sizes of a ball and their standard uncertainty, micrometres; NaN where not calibrated or stated."""

    height_um: float
    diameter_um: float
    u_um: float


def read_known(path: str | PathLike[str]) -> dict[str, Known]:
    """Read a table of calibrated sizes: CSV with columns name, height_um, diameter_um, u_um; name and one size or more.

    Raises
    ------
    FileFormatError
        The file is missing, lacks a column, or holds no ball.
    InputError
        A value that is no number above 0, more values than columns, or a name that comes twice.
    """
    path = Path(path)
    try:
        table = csv.DictReader(io.StringIO(read_text(path).content, newline=""))
        lines = list(table)
    except csv.Error as error:
        msg = f"{path}: cannot be read as CSV ({error})"
        raise FileFormatError(msg) from error
    columns = set(table.fieldnames or ())
    if "name" not in columns or not columns & {"height_um", "diameter_um"}:
        got = ", ".join(sorted(columns)) or "none"
        got += "; commas separate columns" if ";" in got or "\t" in got else ""
        msg = f"{path}: needs the columns name and height_um or diameter_um, got {got}"
        raise FileFormatError(msg)
    if not lines:
        msg = f"{path}: holds no ball"
        raise FileFormatError(msg)
    found: dict[str, Known] = {}
    for number, line in enumerate(lines, 2):
        if None in line:  # such as 500,3 for 500.3
            msg = f"{path}: line {number}: must have {len(columns)} values, one a column, with decimal points"
            raise InputError(msg)
        name = (line["name"] or "").strip()
        if not name or name in found:
            msg = f"{path}: line {number}: name must be there once, got {name!r}"
            raise InputError(msg)
        sizes = [_size(path, number, key, line.get(key)) for key in ("height_um", "diameter_um", "u_um")]
        found[name] = Known(sizes[0], sizes[1], sizes[2])
    return found


def _size(path: Path, number: int, key: str, text: str | None) -> float:
    if text is None or not text.strip():
        return math.nan
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0):
        msg = f"{path}: line {number}: {key}: must be a number above 0, got {text!r}"
        raise InputError(msg)
    return value


def verify(
    results: Sequence[PartResult],
    known: Mapping[str, Known],
    *,
    quantity: Quantity = "height",
    mpe_um: float | None = None,
) -> tuple[Verification, tuple[Remark, ...]]:
    """Compare readings of a part of known sizes, inspected once or several times, with what is known.

    Parameters
    ----------
    results : sequence of PartResult
        Inspections of that part; take it out and put it back in between.
    known : mapping of str to Known
        By the names of the balls.
    quantity : {"height", "diameter"}
    mpe_um : float, optional
        Maximum permissible error: every single error must keep it.

    Returns
    -------
    Verification
        Bias, slope and repeatability with standard uncertainties.
    tuple of Remark
        ``fail`` where the limit is broken or cannot be shown to be kept, as of a ball that was not measured; ``doubt``
        for a bias or slope that is real.

    Raises
    ------
    CalibrationError
        None of the balls was measured.
    """
    rows = []
    for turn, result in enumerate(results):
        for ball in result.balls:
            size = known.get(ball.name)
            if size is None:
                continue
            true, read = getattr(size, f"{quantity}_um"), getattr(ball, READINGS[quantity])
            if math.isfinite(true) and math.isfinite(read):
                rows.append((turn, ball.name, true, read - true, size.u_um))
    if not rows:
        msg = f"verify: no ball of the table has a {quantity} that was measured (names: {', '.join(list(known)[:4])})"
        raise CalibrationError(msg)
    names = np.array([row[1] for row in rows])
    true, error, u_known = (np.array([row[at] for row in rows]) for at in (2, 3, 4))
    each = [error[names == name] for name in dict.fromkeys(names)]
    spare = sum(len(one) - 1 for one in each)
    repeatability = (
        math.sqrt(sum(float(np.square(one - one.mean()).sum()) for one in each) / spare) if spare else math.nan
    )
    means = np.array([one.mean() for one in each])
    sizes = np.array([true[names == name][0] for name in dict.fromkeys(names)])
    stated = np.where(np.isfinite(u_known), u_known, 0.0)
    bias, u_bias, slope, u_slope = _line(sizes, means, float(np.sqrt(np.mean(stated**2))))
    found = Verification(
        quantity,
        len(results),
        len(each),
        bias,
        u_bias,
        slope,
        u_slope,
        repeatability,
        float(np.abs(error).max()),
        mpe_um,
    )
    read_of = {(row[0], row[1]) for row in rows}
    wanted = [name for name, size in known.items() if math.isfinite(getattr(size, f"{quantity}_um"))]
    unread = [name for turn in range(len(results)) for name in wanted if (turn, name) not in read_of]
    return found, (*_judge(found, names, error, u_known), *_unread(unread, found))


def _unread(names: list[str], found: Verification) -> list[Remark]:
    """Say which balls of the table have no reading: a limit is kept by every ball, or not shown to be kept."""
    if not names:
        return []
    shown = ", ".join(list(dict.fromkeys(names))[:6])
    words = f"{found.quantity}: {len(names)} readings of balls of the table are missing ({shown})"
    if found.mpe_um is None:
        return [Remark("doubt", words, f"unread-{found.quantity}", len(names))]
    return [Remark("fail", f"{words}: not shown to be within the limit", f"unread-{found.quantity}", len(names))]


def _line(sizes: np.ndarray, errors: np.ndarray, u_known: float) -> tuple[float, float, float, float]:
    """Mean error at the mean size and change of error with size, each with its standard uncertainty."""
    count = len(sizes)
    bias = float(errors.mean())
    off = sizes - sizes.mean()
    if len(np.unique(sizes)) < LEAST_SIZES:
        scatter = float(errors.std(ddof=1)) if count > 1 else math.nan
        return bias, math.hypot(scatter / math.sqrt(count), u_known), math.nan, math.nan
    slope = float(off @ errors / (off @ off))
    scatter = math.sqrt(float(np.square(errors - bias - slope * off).sum()) / max(count - 2, 1))
    # The calibrated sizes come from one laboratory: their errors may be alike.
    return bias, math.hypot(scatter / math.sqrt(count), u_known), slope, scatter / math.sqrt(float(off @ off))


def _judge(found: Verification, names: np.ndarray, error: np.ndarray, u_known: np.ndarray) -> tuple[Remark, ...]:
    said: list[Remark] = []
    what = found.quantity
    unstated = list(dict.fromkeys(names[np.isnan(u_known)].tolist()))
    of_these = f"u_um of {counted(len(unstated), 'ball')} is not in the table ({', '.join(unstated[:6])})"
    if found.mpe_um is not None:
        # Each error has the room that the certificate of its own ball leaves it.
        room = found.mpe_um - COVERAGE * u_known
        broken, is_open = int((np.abs(error) > found.mpe_um).sum()), np.abs(error) > room
        words = f"{what}: largest error {found.largest_um:.2f} um, permissible {found.mpe_um:.2f} um"
        if broken:
            said.append(
                Remark(
                    "fail",
                    f"{words}: {counted(broken, 'reading')} beyond it",
                    "mpe",
                    found.largest_um,
                    found.mpe_um,
                    "um",
                )
            )
        elif is_open.any():
            worst = int(np.nanargmax(np.abs(error) - room))
            words = (
                f"{what}: error {abs(error[worst]):.2f} um of {names[worst]}, permissible {found.mpe_um:.2f} um, less "
                f"{found.mpe_um - room[worst]:.2f} um for what its calibrated size leaves open: not shown to be kept"
            )
            said.append(Remark("fail", words, "mpe-open", float(abs(error[worst])), float(room[worst]), "um"))
        elif unstated:
            said.append(Remark("fail", f"{words}, but {of_these}: not shown to be kept", "mpe-open", found.largest_um))
        else:
            said.append(Remark("note", f"{words}: kept", "mpe", found.largest_um, found.mpe_um, "um"))
    elif unstated:
        words = f"{what}: {of_these}, and is taken as 0 where biases are judged"
        said.append(Remark("doubt", words, f"bias-unstated-{what}", len(unstated)))
    if abs(found.bias_um) > COVERAGE * found.u_bias_um:
        words = f"{what}: biased by {found.bias_um:+.2f} um (u {found.u_bias_um:.2f} um)"
        said.append(Remark("doubt", words, f"bias-{what}", found.bias_um, COVERAGE * found.u_bias_um, "um"))
    if math.isfinite(found.slope) and abs(found.slope) > COVERAGE * found.u_slope:
        words = (
            f"{what}: the error grows by {1000 * found.slope:+.1f} um per millimetre (u {1000 * found.u_slope:.1f} um)"
        )
        said.append(Remark("doubt", words, f"slope-{what}", found.slope, COVERAGE * found.u_slope))
    return tuple(said)
