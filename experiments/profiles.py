"""Figs. 10 to 12: profiles of one ball over I_d, I_s and h, and the errors behind them."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from bgars.normals.methods import METHODS

from experiments.curves import draw_errors, marks_in_words
from experiments.measure import COLUMNS, Measurement, measure_all, profile_px
from experiments.outcome import Experiment, Outcome, Picture
from experiments.setting import DIFFUSE, HARDNESS, SPECULAR, Setting
from experiments.style import TRUTH_STYLE, new_figure, panels, tidy, value_colors
from experiments.words import change, method_table, of_method, ranges, span, split_by_gain

if TYPE_CHECKING:
    from bgars.records.pixels import FloatArray
    from matplotlib.figure import Figure

    from experiments.outcome import Run

__all__ = ["FIG10", "FIG11", "FIG12"]

METHODS_A_LINE = 4
WIDTH_IN = 12.5


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
    _, flatter = split_by_gain(measurements, value_of, "height_rmse_px")
    true_px = profile_px(np.where(truth.mask, truth.height_px, np.float32(np.nan)))
    label = name.replace("fig", "Fig. ")
    gains = f"{symbol} = {change(measurements, value_of, better)}" if better else ""
    losses = f"{symbol} = {change(measurements, value_of, worse)}" if worse else ""
    heights = f"{symbol} = {ranges(flatter, values)}" if flatter else ""
    limits = [f"the filter is worse than naive least squares at {losses}"] if worse else []
    limits += [f"the filter's height RMSE is no smaller at {heights}"] if flatter else []
    return Outcome(
        pictures=(
            Picture(
                name,
                draw(measurements, symbol, field, values, true_px),
                f"Profiles through the centre over {symbol}, and both errors.{marks_in_words(measurements)}",
            ),
        ),
        columns=COLUMNS,
        rows=[one.row for one in measurements],
        table=method_table(symbol, measurements, value_of),
        about=(
            "One row of the height map through the centre, brought to a common minimum; between its last pixel centres "
            f"the true one rises {np.nanmax(true_px):.0f} px. "
            + " ".join(_facts(measurements, method) for method in METHODS)
        ),
        agrees=(f"the filter lowers the mean error at {gains}.",) if better else (),
        differs=((f"it raises it at {losses}.",) if worse else ())
        + ((f"its height RMSE is no smaller than that of least squares at {heights}.",) if flatter else ()),
        holds=f"{label}: the filter is better than naive least squares at {gains}." if better else "",
        limit=f"{label}: {'; '.join(limits)}." if limits else "",
    )


def _facts(measurements: list[Measurement], method: str) -> str:
    """Errors and rise of a method over the sweep."""
    own = of_method(measurements, method)
    mean_deg = span((one.mean_deg_nz03 for one in own), 1)
    rmse_px = span((one.height_rmse_px for one in own), 2)
    rise_px = span((float(np.nanmax(one.profile_px)) for one in own), 0)
    measured = span((one.measured_percent_nz03 for one in own), 0)
    share = "" if measured == "100" else f", measured {measured} %"
    return f"{method}: mean error {mean_deg} deg, height RMSE {rmse_px} px, rise {rise_px} px{share}."


def draw(
    measurements: list[Measurement], symbol: str, field: str, values: tuple[float, ...], true_px: FloatArray
) -> Figure:
    """Profiles, a panel a method; errors of all methods below."""
    methods = list(dict.fromkeys(one.method for one in measurements))
    cols = min(len(methods), METHODS_A_LINE)
    lines = -(-len(methods) // cols)
    # Panels true to scale: as wide as their share of the page, and as high as the highest profile needs.
    highest_px = max([float(np.nanmax(true_px)), *(float(np.nanmax(one.profile_px)) for one in measurements)])
    inch_per_px = (WIDTH_IN / cols - 0.45) / np.count_nonzero(np.isfinite(true_px))
    upper_in = lines * (0.9 + 1.1 * inch_per_px * highest_px)
    figure = new_figure(WIDTH_IN, upper_in + 3.2)
    parts: Any = figure.subfigures(2, 1, height_ratios=(upper_in, 3.2))
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
