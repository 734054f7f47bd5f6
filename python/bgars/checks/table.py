"""Order and handedness of the lights, in words."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bgars.checks.ambient import LIT_QUANTILE, shadow_floor
from bgars.checks.cast_shadows import judge_shadows
from bgars.checks.geometry import judge_table
from bgars.checks.hypotheses import HALF_TURN, either, half_turned
from bgars.records.findings import Finding

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bgars.checks.cast_shadows import ShadowVerdict
    from bgars.checks.hypotheses import Hypothesis
    from bgars.checks.view import View
    from bgars.records.capture import Capture

__all__ = ["check_table"]

TURNED = (
    "cast shadows fall towards the lights: every light stands on the other side (x and y have the wrong sign, the "
    "directions point from the light to the surface, the images are shifted by half the ring, or upside down)"
)
TURNED_ADVICE = "change the sign of x and y in the table of lights, or turn the images by 180 degrees"


def check_table(capture: Capture, view: View) -> tuple[list[Finding], NDArray[np.float64]]:
    """Compare the table of lights with what the images show.

    Parameters
    ----------
    capture : Capture
    view : View
        Of the capture; its lights stand above the surface.

    Returns
    -------
    findings : list of Finding
    lights : (L, 3) float64
        The table that the images were taken under, as far as they tell.
    """
    verdict = judge_table(view)
    lights = view.lights if verdict.better is None or verdict.only_saddles else verdict.better.lights
    shadows = judge_shadows(view.with_lights(lights))
    if shadows.turned:
        shadows = judge_shadows(_without_veil(capture, view.with_lights(lights)))
    findings = []
    if verdict.better is not None:
        cause = _cause(view, verdict.better, shadows)
        told, advice = cause.told, cause.advice
        if verdict.only_saddles:
            told, advice = f"either the part is a saddle, or {told}", f"if it is none, {advice}"
        findings.append(
            Finding(
                cause.kind,
                "warning" if verdict.only_saddles else "error",
                f"{told} (t = {min(verdict.t, 999.0):.0f} over {verdict.tiles:.0f} parts of the image)",
                advice,
                value=min(verdict.t, 999.0),
                unit="t",
            )
        )
    elif shadows.turned:
        findings.append(Finding("order", "error", TURNED, TURNED_ADVICE, value=min(shadows.t, 999.0), unit="t"))
    if shadows.turned:
        lights = lights * HALF_TURN
    return findings, lights


def _cause(view: View, found: Hypothesis, shadows: ShadowVerdict) -> Hypothesis:
    """What is told: with the half turn where cast shadows say so, both where they say nothing."""
    other = half_turned(view.lights, view.names, found)
    if not shadows.turned:
        return found if shadows.told or other is None else either(found, other)
    if other is not None:
        return other
    told = f"{found.told}, and all by half a turn besides"
    return replace(found, told=told, advice=f"{found.advice}; then change the sign of x and y of all lights")


def _without_veil(capture: Capture, view: View) -> View:
    """Take ambient light away: under it cast shadows are not dark, and what is dark nevertheless is something else."""
    found = shadow_floor(capture, view.lights)
    if found is None or found.floor <= 0.0:
        return view
    lit = float(np.median(np.quantile(view.values[:, view.use], LIT_QUANTILE, axis=0)))
    return replace(view, values=view.values - np.float32(found.floor / found.lit * lit))
