"""The readings of a study as an array, and what had to be left out of it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bgars.files.csv_cells import harmless
from bgars.studies.characteristics import CHARACTERISTICS, Characteristic, part_readings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bgars.studies.study_folder import Study

__all__ = ["LeftOut", "Readings", "readings_csv", "study_readings"]


@dataclass(frozen=True)
class LeftOut:
    """Something that could not be used.

    Attributes
    ----------
    part, ball : str
        Ball "" = a reading of the part.
    measured, runs : int
        In how many of so many runs it was measured. None at all: a missing or bridged ball, say; only in some: the
        gauge failed on it.
    where : str
        The first run without it.
    """

    part: str
    ball: str
    measured: int
    runs: int
    where: str

    def __str__(self) -> str:
        what = f"ball {self.ball} of part {self.part}" if self.ball else f"part {self.part}"
        return f"{what}: measured in {self.measured} of {self.runs} runs, not in {self.where}"


@dataclass(frozen=True, eq=False)
class Readings:
    """Complete readings of one characteristic.

    Attributes
    ----------
    characteristic : Characteristic
    labels : tuple of (str, str)
        Part and ball of each row.
    values : (n, k, r) float64
        n measurands, k placements, r repeats.
    left_out : tuple of LeftOut
    """

    characteristic: Characteristic
    labels: tuple[tuple[str, str], ...]
    values: NDArray[np.float64]
    left_out: tuple[LeftOut, ...]


def study_readings(study: Study, characteristic: Characteristic) -> Readings:
    """Return the readings; each ball of each part is a measurand of its own.

    A ball is a feature with limits of its own, and the gauge reads it like any other: pooled over balls, a few parts
    give as many measurands as a study needs.
    """
    k, r = len(study.placements), study.repeats
    labels, rows, left_out = [], [], []
    for part in study.parts:
        runs = sorted(
            (run for run in study.runs if run.part == part), key=lambda run: study.placements.index(run.placement)
        )
        tables = [part_readings(run.result, characteristic) for run in runs]
        for ball in dict.fromkeys(name for table in tables for name in table):
            row = [table.get(ball, math.nan) for table in tables]
            measured = sum(math.isfinite(value) for value in row)
            if measured == len(row):
                labels.append((part, ball))
                rows.append(row)
            else:
                where = next(str(run.path) for run, value in zip(runs, row, strict=True) if not math.isfinite(value))
                left_out.append(LeftOut(part, ball, measured, len(row), where))
    values = np.array(rows, dtype=np.float64).reshape(-1, k, r)
    return Readings(characteristic, tuple(labels), values, tuple(left_out))


def readings_csv(study: Study) -> str:
    """All readings as CSV text, one line each: for a spreadsheet or another program; empty = not measured."""
    lines = ["part,placement,repeat,ball,characteristic,value"]
    for run in study.runs:
        for characteristic in CHARACTERISTICS:
            for ball, value in part_readings(run.result, characteristic).items():
                told = f"{value:.6f}" if math.isfinite(value) else ""
                names = (run.part, run.placement, run.repeat, ball, characteristic.name)
                lines.append(",".join([*(_cell(name) for name in names), told]))
    return "\n".join(lines) + "\n"


def _cell(text: str) -> str:
    text = harmless(text)
    return '"' + text.replace('"', '""') + '"' if set(text) & set(',"\r\n') else text
