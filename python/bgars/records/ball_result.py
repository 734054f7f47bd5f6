"""The result for one ball."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

from bgars.records.found_balls import BallKind
from bgars.records.keys import Key, as_plain
from bgars.records.renamed import renamed

__all__ = ["BallResult", "Verdict"]

Verdict = Literal["pass", "fail", "undecided"]


@renamed(q="aspect_ratio", u_q="u_aspect_ratio", flat_um="flat_top_depth_um", u_flat_um="u_flat_top_depth_um")
@dataclass(frozen=True, repr=False)
class BallResult:
    """One ball, or a place that should have one.

    NaN = not measured; ``u_..`` are standard uncertainties (k = 1).

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
    diameter_um, centre_z_um, top_um, aspect_ratio, flat_top_depth_um : float
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

    name: Annotated[str, Key("name of the ball in the recipe's view, such as B7")]
    row: Annotated[int | None, Key("row from 0 at the top of the image; null off the lattice")]
    col: Annotated[int | None, Key("column from 0 at the left of the image; null off the lattice")]
    present: Annotated[bool, Key("false: a ball is missing here")]
    verdict: Annotated[Verdict, Key("of this ball")]
    reasons: Annotated[tuple[str, ...], Key("why the verdict is not pass")]
    kind: Annotated[BallKind, Key("ball; extra: where none should be; bridged: joined to a neighbour")] = "ball"
    x_um: Annotated[float, Key("centre, to the right of the image's centre, in um")] = math.nan
    u_x_um: Annotated[float, Key("standard uncertainty (k = 1) of x_um, in um")] = math.nan
    y_um: Annotated[float, Key("centre, above the image's centre, in um")] = math.nan
    u_y_um: Annotated[float, Key("standard uncertainty (k = 1) of y_um, in um")] = math.nan
    x_nominal_um: Annotated[float, Key("its place in the best-fitting grid, in um")] = math.nan
    y_nominal_um: Annotated[float, Key("its place in the best-fitting grid, in um")] = math.nan
    true_position_um: Annotated[float, Key("distance of the centre from that place (a radius), in um")] = math.nan
    u_true_position_um: Annotated[float, Key("standard uncertainty (k = 1) of true_position_um, in um")] = math.nan
    diameter_um: Annotated[float, Key("horizontal diameter, in um")] = math.nan
    u_diameter_um: Annotated[float, Key("standard uncertainty (k = 1) of diameter_um, in um")] = math.nan
    centre_z_um: Annotated[float, Key("height of the centre above the local board, in um")] = math.nan
    u_centre_z_um: Annotated[float, Key("standard uncertainty (k = 1) of centre_z_um, in um")] = math.nan
    top_um: Annotated[float, Key("height of the top above the local board, in um")] = math.nan
    u_top_um: Annotated[float, Key("standard uncertainty (k = 1) of top_um, in um")] = math.nan
    aspect_ratio: Annotated[float, Key("vertical over horizontal radius; 1 = sphere", was="q")] = math.nan
    u_aspect_ratio: Annotated[float, Key("standard uncertainty (k = 1) of aspect_ratio", was="u_q")] = math.nan
    flat_top_depth_um: Annotated[float, Key("missing height of a flat top, in um", was="flat_um")] = math.nan
    u_flat_top_depth_um: Annotated[
        float, Key("standard uncertainty (k = 1) of flat_top_depth_um, in um", was="u_flat_um")
    ] = math.nan
    seating_deviation_um: Annotated[float, Key("distance of the top below the seating plane, in um")] = math.nan
    regression_deviation_um: Annotated[float, Key("distance of the top below the regression plane, in um")] = math.nan
    lights_used: Annotated[int, Key("lights whose shadow of this ball was usable", ge=0)] = 0
    budget: Annotated[
        dict[str, dict[str, float]],
        Key(
            "standard uncertainty (k = 1) of readings by cause, in um, largest first",
            names=("x_um", "y_um", "diameter_um", "top_um"),
            is_late=True,
        ),
    ] = field(default_factory=dict)

    def __repr__(self) -> str:
        """Name, verdict and the readings that are asked for first."""
        return (
            f"BallResult({self.name!r}, {self.verdict}, top_um={self.top_um:.2f}, diameter_um={self.diameter_um:.2f})"
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the record as plain Python values; None where something was not measured."""
        return as_plain(self)
