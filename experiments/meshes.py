"""Figs. 4 and 6: the mesh of the naive method, and the mesh behind the filter."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from bgars.normals.methods import METHODS
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from experiments.measure import COLUMNS, FILTER, NAIVE, Measurement, measure
from experiments.outcome import Experiment, Outcome, Picture
from experiments.setting import DIFFUSE, Setting
from experiments.style import new_figure
from experiments.surface import COLORS, draw_surface
from experiments.words import listed, row_table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bgars.normals.methods import Method
    from bgars.records.pixels import FloatArray
    from numpy.typing import NDArray

    from experiments.outcome import Row, Run

__all__ = ["FIG4", "FIG6", "shape_residuals_px"]

TITLE = 1.0
"""Height of a title in its panel: above the tip of the steepest cone."""
CORE = 0.8
"""Part of the radius over which a surface is compared with a cone: nearer the rim a hemisphere is steeper than both."""
SHAPE_COLUMNS = ("rise_px", "cone_residual_px", "spheroid_residual_px")


def shape_residuals_px(height_px: FloatArray, radius_px: float) -> tuple[float, float]:
    """How far a surface is from the best cone, and from the best spheroid, both upright and centred in the image.

    ``z = a + b r`` and ``z = a + b sqrt(R^2 - r^2)``, by least squares over r < 0.8 R.

    Parameters
    ----------
    height_px : (H, W) float32
        Heights around the image centre.
    radius_px : float
        Radius R of the silhouette.

    Returns
    -------
    cone, spheroid : float
        Root mean square residuals in pixels.

    Examples
    --------
    >>> import numpy as np
    >>> y, x = np.mgrid[-20:21, -20:21]
    >>> cone, spheroid = shape_residuals_px(np.float32(30 - np.hypot(x, y)), 20.0)
    >>> cone < 1e-5 < spheroid
    True
    """
    rows, cols = height_px.shape
    r_px = np.hypot(np.arange(rows)[:, None] + 0.5 - rows / 2, np.arange(cols) + 0.5 - cols / 2)
    core = (r_px < CORE * radius_px) & np.isfinite(height_px)
    z, r = height_px[core].astype(np.float64), r_px[core]
    return _residual(z, r), _residual(z, np.sqrt(radius_px**2 - r**2))


def _residual(z: NDArray[np.float64], shape: NDArray[np.float64]) -> float:
    design = np.column_stack([np.ones_like(shape), shape])
    solution = np.linalg.lstsq(design, z, rcond=None)[0]
    return float(np.sqrt(np.mean((z - design @ solution) ** 2)))


def run(how: Run, *, stem: str, methods: Sequence[Method]) -> Outcome:
    """Surfaces of each method over I_d, true to scale and to one colour scale."""
    measurements: list[Measurement] = []
    true_height_px = None
    for index, i_d in enumerate(DIFFUSE):
        setting = Setting(i_d=i_d)
        capture, truth = setting.photograph(how.radius_px)
        true_height_px = np.where(truth.mask, truth.height_px, np.float32(np.nan))
        measurements += [measure(capture, truth, setting, method=method) for method in methods]
        how.report(0.5 * (index + 1) / len(DIFFUSE))
    if true_height_px is None:
        raise AssertionError
    true_height_px -= np.nanmin(true_height_px)
    true_rise_px = float(np.nanmax(true_height_px))
    figure = draw(measurements, methods, true_height_px)
    residuals = {id(one): shape_residuals_px(one.height_px, how.radius_px) for one in measurements}
    rows: list[Row] = []
    for one in measurements:
        cone, spheroid = residuals[id(one)]
        rows.append(one.row | dict(zip(SHAPE_COLUMNS, (one.rise_px, cone, spheroid), strict=True)))
    pictures = (Picture(stem, figure, _caption(methods)),)
    agrees, differs = verdicts(rows, methods)
    cones = [f"{row['i_d']:g}" for row in rows if row["method"] == FILTER and is_cone(row)]
    return Outcome(
        pictures=pictures,
        columns=(*COLUMNS, *SHAPE_COLUMNS),
        rows=rows,
        table=row_table(
            {
                "method": "{method}",
                "I_d": "{i_d:g}",
                "mean (deg)": "{mean_deg_nz03:.2f}",
                "height RMSE (px)": "{height_rmse_px:.2f}",
                "rise (px)": "{rise_px:.1f}",
                "from a cone (px)": "{cone_residual_px:.2f}",
                "from a spheroid (px)": "{spheroid_residual_px:.2f}",
            },
            rows,
        ),
        about=(
            f"Integrated over the silhouette of the hemisphere, R = {how.radius_px} px; its pixels truly rise "
            f"{true_rise_px:.0f} px. The last two columns say what the surface looks like within {CORE:g} R: RMS "
            "distance from the best upright cone z = a + b r, and from the best spheroid z = a + b sqrt(R^2 - r^2). "
            "The smaller names the shape."
        ),
        agrees=agrees,
        differs=differs,
        holds=_holds(rows, methods),
        limit=(
            f"Fig. 6: with little diffuse light the filtered surface is still nearer to a cone than to a ball "
            f"(I_d = {listed(cones)})."
            if cones
            else ""
        ),
    )


def draw(measurements: list[Measurement], methods: Sequence[Method], true_height_px: FloatArray) -> Any:  # noqa: ANN401
    """A line of surfaces a method, the truth first."""
    heights = Normalize(0.0, max(one.rise_px for one in measurements))
    figure = new_figure(12.5, 2.6 * len(methods) + 0.2)
    grid = figure.subplots(len(methods), len(DIFFUSE) + 1, squeeze=False, subplot_kw={"projection": "3d"})
    for line, method in zip(grid, methods, strict=True):
        draw_surface(line[0], true_height_px, heights)
        line[0].set_title(f"truth\nrise {np.nanmax(true_height_px):.0f} px", y=TITLE)
        shown = [one for one in measurements if one.method == method]
        for axes, one in zip(line[1:], shown, strict=True):
            draw_surface(axes, one.height_px, heights)
            # A normal drawn to the sphere of the circle proves nothing, however well it looks.
            measured = f"\n{one.measured_percent_nz03:.0f} % measured" if method == "reflectance" else ""
            axes.set_title(f"{method}, I_d = {one.setting.i_d:g}\nrise {one.rise_px:.0f} px{measured}", y=TITLE)
    figure.colorbar(ScalarMappable(heights, COLORS), ax=grid, label="height (px)", shrink=0.75, pad=0.01)
    return figure


def is_cone(row: Row) -> bool:
    """Whether a cone fits better than a spheroid."""
    return float(row["cone_residual_px"]) < float(row["spheroid_residual_px"])


def verdicts(rows: list[Row], methods: Sequence[Method]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Where each method leaves a cone and where a ball."""
    agrees, differs = [], []
    for method in methods:
        own = [row for row in rows if row["method"] == method]
        cones = [float(row["i_d"]) for row in own if is_cone(row)]
        balls = [float(row["i_d"]) for row in own if not is_cone(row)]
        if method == NAIVE and cones:
            agrees.append(f"{method} makes cones at I_d = {listed(cones)}.")
        if method == NAIVE and balls:
            differs.append(f"{method} makes no cone at I_d = {listed(balls)}, where diffuse light outweighs the lobe.")
        if method != NAIVE and balls:
            agrees.append(f"{method} makes balls at I_d = {listed(balls)}.")
        if method != NAIVE and cones:
            differs.append(f"{method} leaves cones at I_d = {listed(cones)}.")
    return tuple(agrees), tuple(differs)


def _caption(methods: Sequence[Method]) -> str:
    return f"Surfaces by {listed(methods)}, true to scale, with a common minimum, closed at the rim; one colour scale."


def _holds(rows: list[Row], methods: Sequence[Method]) -> str:
    naive = [float(row["i_d"]) for row in rows if row["method"] == NAIVE and is_cone(row)]
    balls = [float(row["i_d"]) for row in rows if row["method"] == FILTER and not is_cone(row)]
    if len(methods) == 1:
        return f"Fig. 4: naive least squares turns the ball into a cone (I_d = {listed(naive)})." if naive else ""
    both = [i_d for i_d in balls if i_d in naive]
    return f"Fig. 6: the filter turns the cone back into a ball at I_d = {listed(both)}." if both else ""


FIG4 = Experiment(
    "fig4",
    "Fig. 4: the naive mesh",
    "the naive mesh in 3-D over I_d: cones where a ball should be",
    partial(run, stem="fig4", methods=(NAIVE,)),
)
FIG6 = Experiment(
    "fig6",
    "Fig. 6: the filtered mesh against the naive one",
    "the mesh of every method in 3-D over I_d, against the naive one",
    partial(run, stem="fig6", methods=METHODS),
)
