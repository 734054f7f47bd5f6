"""Reference values of a study: what the parts really are, measured by something better."""

from __future__ import annotations

import csv
import math
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

from bgars.errors import FileFormatError, InputError
from bgars.files.safe_files import need_readable
from bgars.records.ball_result import BallResult
from bgars.records.keys import old_names
from bgars.studies.characteristics import CHARACTERISTICS

if TYPE_CHECKING:
    from os import PathLike

    from bgars.studies.study_folder import Study

__all__ = ["COLUMNS", "References", "check_references", "read_references"]

COLUMNS = ("part", "ball", "characteristic", "reference")
References = dict[tuple[str, str, str], float]
"""Reference value by part, ball ("" = the part) and characteristic."""


def read_references(path: str | PathLike[str]) -> References:
    """Read a CSV file with the columns part, ball, characteristic, reference.

    References are in the unit that the characteristic names; the ball is empty for a characteristic of the part.

    Parameters
    ----------
    path : path
        CSV in UTF-8; its first line is ``part,ball,characteristic,reference``.

    Returns
    -------
    dict of (str, str, str) to float
        Reference by part, ball ("" = the part) and characteristic, for :func:`bgars.gauge_rr`.

    Raises
    ------
    FileFormatError
        The file cannot be read, or has other columns.
    InputError
        An unknown characteristic, a value that is no number, a line that comes twice; file and line are named.
    """
    path = Path(path)
    need_readable(path)
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            rows = list(csv.reader(file))
    except OSError as error:
        msg = f"{path}: cannot be read ({error.strerror})"
        raise FileFormatError(msg) from error
    except (UnicodeDecodeError, csv.Error) as error:
        msg = f"{path}: is not CSV in UTF-8 ({error})"
        raise FileFormatError(msg) from error
    heading = tuple(cell.strip() for cell in rows[0]) if rows else ()
    if heading != COLUMNS:
        msg = f"{path}: line 1: must be {','.join(COLUMNS)}, got {','.join(heading)!r}"
        raise FileFormatError(msg)
    known = [each.name for each in CHARACTERISTICS]
    old = old_names(BallResult)
    references: References = {}
    for number, cells in enumerate(rows[1:], 2):
        if not any(cell.strip() for cell in cells):
            continue
        if len(cells) != len(COLUMNS):
            msg = f"{path}: line {number}: must have {len(COLUMNS)} cells, got {len(cells)}"
            raise FileFormatError(msg)
        part, ball, name, text = (cell.strip() for cell in cells)
        if name in old:
            told = f"{path}: {name} is called {old[name]} now; the next release removes the old name"
            warnings.warn(told, FutureWarning, stacklevel=2)
            name = old[name]
        if name not in known:
            msg = f"{path}: line {number}: characteristic must be one of {', '.join(known)}, got {name!r}"
            raise InputError(msg)
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            msg = f"{path}: line {number}: reference must be a finite number, got {text!r}"
            raise InputError(msg)
        if (part, ball, name) in references:
            msg = f"{path}: line {number}: {part} {ball} {name} comes twice"
            raise InputError(msg)
        references[part, ball, name] = value
    if not references:
        msg = f"{path}: holds no reference value"
        raise InputError(msg)
    return references


def check_references(references: References, study: Study, path: str | PathLike[str] = "references") -> None:
    """Refuse references of parts or balls that the study does not have: a misspelt name would go unnoticed.

    Raises
    ------
    InputError
        File and name are named.
    """
    balls = {run.part: {"", *(ball.name for ball in run.result.balls)} for run in study.runs}
    for part, ball, name in references:
        if part not in balls:
            msg = f"{path}: part must be one of {', '.join(study.parts)}, got {part!r}"
            raise InputError(msg)
        of = next(each.of for each in CHARACTERISTICS if each.name == name)
        if ball not in balls[part] or (ball == "") != (of == "part"):
            rule = "must be empty for" if of == "part" else f"must be a ball of part {part} for"
            msg = f"{path}: ball {rule} {name}, got {ball!r}"
            raise InputError(msg)
