"""Figs. 10 to 12: profiles of one ball over I_d, I_s and h, and the errors behind them."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from bgars.experiments.curves import draw_errors
from bgars.experiments.measure import COLUMNS, FILTER, NAIVE, Measurement, measure_all, profile_px
from bgars.experiments.outcome import Experiment, Outcome, Picture
from bgars.experiments.setting import DIFFUSE, HARDNESS, SPECULAR, Setting
from bgars.experiments.style import TRUTH_STYLE, new_figure, panels, tidy, value_colors
from bgars.experiments.words import change, method_table, of_method, span, split_by_gain
from bgars.normals import METHODS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from bgars.experiments.outcome import Run
    from bgars.records import FloatArray

__all__ = ["FIG10", "FIG11", "FIG12"]

METHODS_A_LINE = 4


def run(how: Run, *, name: str, field: str, symbol: str, values: tuple[float, ...]) -> Outcome:
    """Every method at every value."""
    measurements: list[Measurement] = []
    _, truth = Setting().photograph(how.radius_px)
    for index, value in enumerate(values):
        measurements += measure_all(Setting().with_value(field, value), how.radius_px)
        how.report((index + 1) / len(values))

    def value_of(one: Measurement) -> float:
        return float(getattr(one.setting, field))

    better, worse = split_by_gain(measurements, value_of)
    true_px = profile_px(np.where(truth.mask, truth.height_px, np.float32(np.nan)))
    rises = {
        method: span((float(np.nanmax(one.profile_px)) for one in of_method(measurements, method)), 0)
        for method in METHODS
    }
    label = name.replace("fig", "Fig. ")
    figure = draw(measurements, symbol, field, values, true_px)
    others = [
        f"{method}: mean error {span(one.mean_deg_nz03 for one in of_method(measurements, method))} deg, height RMSE "
        f"{span((one.height_rmse_px for one in of_method(measurements, method)), 2)} px."
        for method in METHODS
        if method not in {NAIVE, FILTER}
    ]
    gains = f"{symbol} = {change(measurements, value_of, better)}" if better else ""
    losses = f"{symbol} = {change(measurements, value_of, worse)}" if worse else ""
    return Outcome(
        pictures=(Picture(name, figure, f"Profiles through the centre over {symbol}, and both errors."),),
        columns=COLUMNS,
        rows=[one.row for one in measurements],
        table=method_table(symbol, measurements, value_of),
        about=(
            f"One row of the height map through the centre, brought to a common minimum; the true one rises "
            f"{np.nanmax(true_px):.0f} px between its last pixel centres. " + " ".join(others)
        ),
        agrees=(f"the filter lowers the mean error at {gains}.",) if better else (),
        differs=((f"it raises it at {losses}.",) if worse else ())
        + (
            f"no profile of the paper's two methods has the true height: {NAIVE} rises {rises[NAIVE]} px, {FILTER} "
            f"{rises[FILTER]} px over the sweep.",
        ),
        holds=f"{label}: the filter is better than naive least squares at {gains}." if better else "",
        limit=f"{label}: the filter is worse than naive least squares at {losses}." if worse else "",
    )


def draw(
    measurements: list[Measurement], symbol: str, field: str, values: tuple[float, ...], true_px: FloatArray
) -> Figure:
    """Profiles, a panel a method; errors of all methods below."""
    methods = list(dict.fromkeys(one.method for one in measurements))
    cols = min(len(methods), METHODS_A_LINE)
    lines = -(-len(methods) // cols)
    figure = new_figure(12.5, 3.9 * lines + 3.2)
    parts: Any = figure.subfigures(2, 1, height_ratios=(3.9 * lines, 3.2))
    upper, lower = parts
    places = [axes for line in panels(upper, lines, cols, sharex=True, sharey=True) for axes in line]
    size = measurements[0].height_px.shape
    x_px = np.arange(size[1]) + 0.5 - size[1] / 2
    for axes, method in zip(places, methods, strict=False):
        axes.plot(x_px, true_px, **TRUTH_STYLE)
        for one, value, color in zip(of_method(measurements, method), values, value_colors(len(values)), strict=True):
            axes.plot(x_px, one.profile_px, color=color, linewidth=1.7, label=f"{symbol} = {value:g}")
        axes.set_title(method)
        axes.set_aspect("equal")
        axes.set_xlabel("x (px)")
        tidy(axes)
    for axes in places[len(methods) :]:
        axes.set_visible(False)
    places[0].set_ylabel("height above the\nlowest point (px)")
    upper.legend(*places[0].get_legend_handles_labels(), loc="outside upper center", ncols=len(values) + 1)
    draw_errors(
        lower,
        measurements,
        lambda one: float(getattr(one.setting, field)),
        f"{symbol}{'' if 0.0 in values else ' (logarithmic)'}",
        log=0.0 not in values,
    )
    return figure


FIG10, FIG11, FIG12 = (
    Experiment(
        name,
        f"Fig. {name[3:]}: profiles of one ball over {symbol}",
        f"profiles and errors of every method over {symbol} = {', '.join(f'{value:g}' for value in values)}",
        partial(run, name=name, field=field, symbol=symbol, values=values),
    )
    for name, field, symbol, values in (
        ("fig10", "i_d", "I_d", DIFFUSE),
        ("fig11", "i_s", "I_s", SPECULAR),
        ("fig12", "hardness", "h", HARDNESS),
    )
)
