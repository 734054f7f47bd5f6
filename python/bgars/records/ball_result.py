"""The result for one ball."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from typing import Any, Literal

from bgars.records.found_balls import BallKind
from bgars.records.plain_values import DIGITS, _plain

__all__ = ["BallResult", "Verdict"]

Verdict = Literal["pass", "fail", "undecided"]


@dataclass(frozen=True, repr=False)
class BallResult:
    """One ball, or a place that should have one; NaN = not measured. ``u_..`` are standard uncertainties (k = 1).

    Attributes
    ----------
    name : str
        In the recipe's view.
    row, col : int or None
        From 0 at the top left of the image; None off the lattice.
    present : bool
        False for a missing ball, and for a place that the images do not show (its verdict is then undecided).
    kind : {"ball", "extra", "bridged"}
        See :class:`bgars.records.found_balls.FoundBall`.
    x_um, y_um : float
        Centre; x right, y up, origin at the centre of the image.
    x_nominal_um, y_nominal_um : float
        Its place in the best-fitting grid.
    true_position_um : float
        Distance of the centre from that place.
    diameter_um, centre_z_um, top_um, q, flat_um : float
        As in :class:`bgars.records.measured_balls.MeasuredBall`.
    seating_deviation_um, regression_deviation_um : float
        Distance of the apex below either plane.
    lights_used : int
        Lights whose shadow was usable.
    verdict : {"pass", "fail", "undecided"}
    reasons : tuple of str
        Why it is not "pass".
    budget : dict of dict of float
        Of ``x_um y_um diameter_um top_um``: standard uncertainty by cause, um, largest first.
    """

    name: str
    row: int | None
    col: int | None
    present: bool
    verdict: Verdict
    reasons: tuple[str, ...]
    kind: BallKind = "ball"
    x_um: float = math.nan
    u_x_um: float = math.nan
    y_um: float = math.nan
    u_y_um: float = math.nan
    x_nominal_um: float = math.nan
    y_nominal_um: float = math.nan
    true_position_um: float = math.nan
    u_true_position_um: float = math.nan
    diameter_um: float = math.nan
    u_diameter_um: float = math.nan
    centre_z_um: float = math.nan
    u_centre_z_um: float = math.nan
    top_um: float = math.nan
    u_top_um: float = math.nan
    q: float = math.nan
    u_q: float = math.nan
    flat_um: float = math.nan
    u_flat_um: float = math.nan
    seating_deviation_um: float = math.nan
    regression_deviation_um: float = math.nan
    lights_used: int = 0
    budget: dict[str, dict[str, float]] = field(default_factory=dict)

    def __repr__(self) -> str:
        """Name, verdict and the readings that are asked for first."""
        return (
            f"BallResult({self.name!r}, {self.verdict}, top_um={self.top_um:.2f}, diameter_um={self.diameter_um:.2f})"
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the record as plain Python values; None where something was not measured."""
        return {entry.name: _plain(getattr(self, entry.name), DIGITS) for entry in fields(self)}
