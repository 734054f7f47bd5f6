"""Gauge repeatability and reproducibility of one characteristic, from its variance components."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from scipy import special

from bgars.studies.anova import Anova, crossed_anova

if TYPE_CHECKING:
    from bgars.records.ball_result import Verdict
    from bgars.records.part_recipe import PartRecipe
    from bgars.studies.readings import Readings

__all__ = ["ACCEPTABLE_PERCENT", "UNACCEPTABLE_PERCENT", "GaugeFigures", "Spread", "gauge_figures"]

STUDY_SIGMAS = 6.0
"""Study variation: 6 sigma, 99.73 % of a normal distribution (AIAG MSA, 4th ed.)."""
NDC_FACTOR = 1.41
ACCEPTABLE_PERCENT, UNACCEPTABLE_PERCENT = 10.0, 30.0
"""AIAG MSA, 4th ed., chapter II D: under 10 % acceptable, over 30 % not, between depends on the use."""
CONFIDENCE = 0.95
NAMES = ("GRR", "EV", "AV", "interaction", "PV", "TV")


@dataclass(frozen=True)
class Spread:
    """A source of variation; NaN = the design does not show it.

    Attributes
    ----------
    name : str
        GRR, EV (repeatability), AV (placement), interaction (part x placement), PV (parts), TV (total).
    sigma : float
        Standard deviation, in the unit of the characteristic.
    study_variation : float
        6 sigma.
    percent_study : float
        Of TV's sigma.
    percent_tolerance : float
        Study variation of the tolerance.
    """

    name: str
    sigma: float
    study_variation: float
    percent_study: float
    percent_tolerance: float


@dataclass(frozen=True)
class GaugeFigures:
    """Gauge R&R of one characteristic.

    Attributes
    ----------
    characteristic : str
    unit : str
    measurands, placements, repeats : int
        Of the readings that were used.
    mean : float
        Of all readings.
    tolerance : float or None
    spreads : tuple of Spread
        In the order of `NAMES`.
    ev_low, ev_high : float
        95 % confidence interval of the repeatability's sigma.
    ndc : int or None
        Number of distinct categories, 1.41 PV / GRR, cut to a whole number.
    anova : Anova
    worst_measurand : str
        With the largest spread of its repeats.
    worst_sigma : float
        That spread.
    verdict : Verdict or None
        By percent of tolerance; None without limits.
    reason : str
    """

    characteristic: str
    unit: str
    measurands: int
    placements: int
    repeats: int
    mean: float
    tolerance: float | None
    spreads: tuple[Spread, ...]
    ev_low: float
    ev_high: float
    ndc: int | None
    anova: Anova
    worst_measurand: str
    worst_sigma: float
    verdict: Verdict | None
    reason: str

    def spread(self, name: str) -> Spread:
        """The source of variation of that name."""
        return self.spreads[NAMES.index(name)]


def gauge_figures(readings: Readings, recipe: PartRecipe | None) -> GaugeFigures:
    """Return the gauge R&R of complete readings.

    EV^2 is the variance of repeats, AV^2 that of placements, GRR^2 = EV^2 + AV^2 + interaction^2, TV^2 = GRR^2 + PV^2.

    Parameters
    ----------
    readings : Readings
        At least one measurand.
    recipe : PartRecipe or None
        Whose limits give the tolerance.

    References
    ----------
    AIAG, Measurement Systems Analysis, 4th ed., 2010, chapter III B and appendix A.
    """
    values, characteristic = readings.values, readings.characteristic
    n, k, r = values.shape
    anova = crossed_anova(values)
    ev2, av2, interaction2, pv2 = anova.repeatability, anova.placement, anova.interaction, anova.part
    grr2 = ev2 + _known(av2) + _known(interaction2)
    variances = dict(zip(NAMES, (grr2, ev2, av2, interaction2, pv2, grr2 + _known(pv2)), strict=True))
    variances["interaction"] = math.nan if min(n, k) == 1 else interaction2
    tolerance = characteristic.tolerance(recipe)
    total = math.sqrt(variances["TV"])
    spreads = []
    for name, variance in variances.items():
        sigma = math.sqrt(variance)
        share = 100.0 * sigma / total if total > 0 and math.isfinite(pv2) else math.nan
        of_tolerance = math.nan if tolerance is None else 100.0 * STUDY_SIGMAS * sigma / tolerance
        spreads.append(Spread(name, sigma, STUDY_SIGMAS * sigma, share, of_tolerance))
    grr = math.sqrt(grr2)
    ndc = None if math.isnan(pv2) or grr == 0 else max(1, math.floor(NDC_FACTOR * math.sqrt(pv2) / grr))
    ev = math.sqrt(ev2)
    df = anova.repeatability_df
    high, low = (float(special.chdtri(df, side)) for side in ((1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2))
    own = values.var(axis=2, ddof=1).mean(axis=1) ** 0.5
    worst = int(own.argmax())
    verdict, reason = _verdict(characteristic.title, spreads[0].percent_tolerance)
    if verdict is not None and grr == 0:
        verdict, reason = "undecided", f"{characteristic.title}: no spread at all, check the runs"
    return GaugeFigures(
        characteristic.name,
        characteristic.unit,
        n,
        k,
        r,
        float(values.mean()),
        tolerance,
        tuple(spreads),
        ev_low=ev * math.sqrt(df / high),
        ev_high=ev * math.sqrt(df / low),
        ndc=ndc,
        anova=anova,
        worst_measurand=" ".join(readings.labels[worst]).strip(),
        worst_sigma=float(own[worst]),
        verdict=verdict,
        reason=reason,
    )


def _known(variance: float) -> float:
    return 0.0 if math.isnan(variance) else variance


def _verdict(title: str, percent: float) -> tuple[Verdict | None, str]:
    if math.isnan(percent):
        return None, f"{title}: no limit in the recipe, so GRR is not judged"
    told = f"{title}: GRR is {percent:.1f} % of the tolerance"
    if percent > UNACCEPTABLE_PERCENT:
        return "fail", f"{told}, over {UNACCEPTABLE_PERCENT:g} %: not fit to judge it"
    if percent > ACCEPTABLE_PERCENT:
        return (
            "undecided",
            f"{told}, between {ACCEPTABLE_PERCENT:g} % and {UNACCEPTABLE_PERCENT:g} %: depends on the use",
        )
    return "pass", f"{told}, at most {ACCEPTABLE_PERCENT:g} %"
