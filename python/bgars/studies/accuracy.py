"""Cg, Cgk, bias and linearity: repeats of known parts against their reference values."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

if TYPE_CHECKING:
    from bgars.records.part_recipe import PartRecipe
    from bgars.studies.readings import Readings
    from bgars.studies.references import References

__all__ = ["MIN_RUNS", "TYPICAL_RUNS", "Accuracy", "accuracy_figures"]

MIN_RUNS, TYPICAL_RUNS = 10, 25
"""Runs of a part that Cg needs at all, and that it should have."""
TOLERANCE_SHARE = 0.2
TARGET = 1.33
SIGMAS = 6.0
MIN_LINE = 3
"""Measurands with a reference that a line needs."""


@dataclass(frozen=True, eq=False)
class Accuracy:
    """Against references; NaN = not known: too few runs, no limits, no references.

    Attributes
    ----------
    characteristic : str
    runs : int
        Of each part.
    cg, cgk : float
        Of the worst measurand, see `cg_measurand` and `cgk_measurand`.
    cg_measurand, cgk_measurand : str
    references : int
        Measurands with a reference.
    bias, u_bias, bias_p : float
        Mean deviation of the measurands' means from their references, its standard error over the measurands, and the
        p-value of Student's test that it is zero.
    slope, intercept, slope_p : float
        Line through bias against reference; the p-value that the slope is zero.
    linearity : float
        |slope| x 6 TV sigma.
    points : tuple of (float, float)
        Reference and bias of each measurand.
    """

    characteristic: str
    runs: int
    cg: float
    cg_measurand: str
    cgk: float
    cgk_measurand: str
    references: int
    bias: float
    u_bias: float
    bias_p: float
    slope: float
    intercept: float
    slope_p: float
    linearity: float
    points: tuple[tuple[float, float], ...]


def accuracy_figures(
    readings: Readings, recipe: PartRecipe | None, references: References, total_sigma: float
) -> Accuracy:
    """Return what can be said of one characteristic.

    Cg = 0.2 T / (6 s) and Cgk = (0.1 T - |mean - reference|) / (3 s), over all runs of a part; the worst measurand
    counts.
    Bias and linearity take each measurand once, by its mean: runs of one ball share its error, so that taking them for
    independent would make every bias significant.

    Parameters
    ----------
    readings : Readings
    recipe : PartRecipe or None
        Whose limits give the tolerance T; Cg and Cgk need a lowest and a highest limit, or a distance's highest.
    references : References
    total_sigma : float
        TV of the gauge study.

    References
    ----------
    ISO 22514-7:2021 (capability of measurement processes); AIAG, Measurement Systems Analysis, 4th ed., chapter III B
    (bias, linearity).
    """
    name = readings.characteristic.name
    flat = readings.values.reshape(len(readings.labels), -1)
    runs = flat.shape[1]
    means, sigmas = flat.mean(axis=1), flat.std(axis=1, ddof=1)
    known = np.array([references.get((part, ball, name), math.nan) for part, ball in readings.labels])
    tolerance = readings.characteristic.tolerance(recipe)
    names = [" ".join(label).strip() for label in readings.labels]
    cg = cgk = np.full(len(names), math.nan)
    if tolerance is not None and runs >= MIN_RUNS and (sigmas > 0).all():
        cg = TOLERANCE_SHARE * tolerance / (SIGMAS * sigmas)
        cgk = (TOLERANCE_SHARE / 2 * tolerance - np.abs(means - known)) / (SIGMAS / 2 * sigmas)
    has = np.isfinite(known)
    bias, reference = (means - known)[has], known[has]
    count = len(bias)
    mean = float(bias.mean()) if count else math.nan
    u = float(bias.std(ddof=1) / math.sqrt(count)) if count > 1 else math.nan
    p = float(2.0 * special.stdtr(count - 1, -abs(mean) / u)) if count > 1 and u > 0 else math.nan
    slope = intercept = slope_p = math.nan
    if count >= MIN_LINE and np.ptp(reference) > 0:
        from scipy import stats  # noqa: PLC0415 - slow to import, and rarely needed

        line = stats.linregress(reference, bias)
        slope, intercept, slope_p = float(line.slope), float(line.intercept), float(line.pvalue)
    return Accuracy(
        name,
        runs,
        *_worst(cg, names),
        *_worst(cgk, names),
        references=count,
        bias=mean,
        u_bias=u,
        bias_p=p,
        slope=slope,
        intercept=intercept,
        slope_p=slope_p,
        linearity=abs(slope) * SIGMAS * total_sigma,
        points=tuple((float(x), float(y)) for x, y in zip(reference, bias, strict=True)),
    )


def _worst(values: np.ndarray, names: list[str]) -> tuple[float, str]:
    if not np.isfinite(values).any():
        return math.nan, ""
    at = int(np.nanargmin(values))
    return float(values[at]), names[at]
