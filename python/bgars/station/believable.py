"""Whether directions of lights can be believed: no table of them is written where one is nonsense."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bgars.errors import CalibrationError
from bgars.files.light_names import light_name

if TYPE_CHECKING:
    from bgars.records.capture import Capture
    from bgars.records.remark import Remark
    from bgars.station.light_bundle import LightSolution

__all__ = ["need_believable"]

MOST_U_DEG = 10.0
"""Standard uncertainty from which on a direction by eye is better."""
MISFIT = 3.0
"""Reduced chi square from which on balls contradict each other."""
MOST_NAMES = 4
EXPLAINED = frozenset({"two-highlights", "wrong-outline"})
"""Doubts that name why a direction is hardly known; its uncertainty holds both answers."""


def need_believable(solution: LightSolution, captures: list[Capture], sphere: str, findings: list[Remark]) -> None:
    """Refuse lights at or below the board, and lights whose direction is hardly known unless `findings` say why.

    Raises
    ------
    CalibrationError
        With the names of these lights, and the likely cause.
    """
    elevation_deg = np.degrees(np.arcsin(np.clip(solution.directions[:, 2], -1.0, 1.0)))
    named = {one.light for one in findings if one.code in EXPLAINED}
    wrong = [
        f"{light_name(index, captures[0].files)} (elevation {elevation_deg[index]:.0f} deg, u {u_deg:.0f} deg)"
        for index, u_deg in enumerate(solution.u_deg)
        if elevation_deg[index] <= 0.0 or not (u_deg <= MOST_U_DEG or named & {None, index})
    ]
    if not wrong:
        return
    shown = ", ".join(wrong[:MOST_NAMES]) + (f", and {len(wrong) - MOST_NAMES} more" if wrong[MOST_NAMES:] else "")
    if sphere == "matt":
        cause = "is it a mirror ball (sphere mirror), or was the response not calibrated?"
    elif len(captures) > 1 and solution.reduced_chi_square > MISFIT:
        cause = "are the images of all folders in the same order of lights, and is each outline that of the ball?"
    else:
        cause = "is it a matt ball (sphere matt), is the outline that of the ball, or are its highlights no lamps?"
    msg = f"{captures[0].name}: at or below the board, or not known to {MOST_U_DEG:g} deg: {shown}: {cause}"
    raise CalibrationError(msg)
