"""The threshold of the specular filter, 50 in the paper."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bgars.normals.pixelwise import DEFAULT_THRESHOLD

from experiments.measure import COLUMNS, FILTER, NAIVE, Measurement, measure
from experiments.outcome import Experiment, Outcome, Picture
from experiments.setting import Setting
from experiments.style import MARKERS, OKABE_ITO, new_figure, panels, tidy
from experiments.words import listed, markdown_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from experiments.outcome import Row, Run

__all__ = ["THRESHOLD"]

LEVELS = (5.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 90.0, 100.0, 110.0, 120.0)
SHOWN_I_D = (0.05, 0.1, 0.5, 1.0)


def run(how: Run) -> Outcome:
    """The filter at every threshold, and least squares beside it."""
    naive: dict[float, Measurement] = {}
    filtered: dict[float, list[Measurement]] = {}
    for index, i_d in enumerate(SHOWN_I_D):
        setting = Setting(i_d=i_d)
        capture, truth = setting.photograph(how.radius_px)
        naive[i_d] = measure(capture, truth, setting, method=NAIVE)
        filtered[i_d] = [measure(capture, truth, setting, method=FILTER, threshold=level) for level in LEVELS]
        how.report((index + 1) / len(SHOWN_I_D))
    rows: list[Row] = []
    for i_d in SHOWN_I_D:
        rows.append(naive[i_d].row | {"threshold": ""})
        rows += [one.row | {"threshold": level} for level, one in zip(LEVELS, filtered[i_d], strict=True)]
    best = {
        i_d: min(zip(filtered[i_d], LEVELS, strict=True), key=lambda pair: pair[0].mean_deg_nz03) for i_d in SHOWN_I_D
    }
    at_default = {i_d: filtered[i_d][LEVELS.index(DEFAULT_THRESHOLD)] for i_d in SHOWN_I_D}
    bests = listed(f"{best[i_d][1]:g} (I_d = {i_d:g}, {best[i_d][0].mean_deg_nz03:.1f} deg)" for i_d in SHOWN_I_D)
    defaults = ", ".join(f"{at_default[i_d].mean_deg_nz03:.1f} at I_d = {i_d:g}" for i_d in SHOWN_I_D)
    good = [i_d for i_d in SHOWN_I_D if at_default[i_d].mean_deg_nz03 <= 1.1 * best[i_d][0].mean_deg_nz03]
    poor = [i_d for i_d in SHOWN_I_D if i_d not in good]
    columns = [f"I_d = {i_d:g} (deg)" for i_d in SHOWN_I_D]
    table = [
        [f"{level:g}", *(f"{filtered[i_d][index].mean_deg_nz03:.2f}" for i_d in SHOWN_I_D)]
        for index, level in enumerate(LEVELS)
    ]
    table.append(["no filter", *(f"{naive[i_d].mean_deg_nz03:.2f}" for i_d in SHOWN_I_D)])
    return Outcome(
        pictures=(
            Picture("threshold", draw(naive, filtered), f"Errors of {FILTER} over its threshold; dashed: {NAIVE}."),
        ),
        columns=(*COLUMNS, "threshold"),
        rows=rows,
        table=markdown_table(["threshold (of 255)", *columns], table),
        about=f"Best of the thresholds tried: {bests}.",
        agrees=(
            (f"{DEFAULT_THRESHOLD:g} is within 10 % of the best threshold at I_d = {listed(good)}.",) if good else ()
        ),
        differs=(
            (
                f"no one threshold serves all: {DEFAULT_THRESHOLD:g} gives {defaults} deg, more than 10 % above the "
                f"best at I_d = {listed(poor)}.",
            )
            if poor
            else ()
        ),
        limit=f"Threshold: no single value serves all; the best are {bests}." if poor else "",
    )


def draw(naive: dict[float, Measurement], filtered: dict[float, list[Measurement]]) -> Figure:
    """Both errors over the threshold."""
    figure = new_figure(11.5, 4.2)
    (line,) = panels(figure, 1, 2, sharex=True)
    for axes, name, title in (
        (line[0], "mean_deg_nz03", "mean angular error,\nn_z > 0.3 (deg)"),
        (line[1], "height_rmse_px", "height RMSE (px)"),
    ):
        for i_d, color, marker in zip(naive, OKABE_ITO, MARKERS, strict=False):
            errors = [getattr(one, name) for one in filtered[i_d]]
            axes.plot(LEVELS, errors, color=color, marker=marker, markersize=5, label=f"I_d = {i_d:g}")
            axes.axhline(getattr(naive[i_d], name), color=color, linestyle="--", linewidth=1.1)
        axes.axvline(DEFAULT_THRESHOLD, color="0.5", linestyle=":", linewidth=1.4)
        axes.set_ylim(bottom=0.0)
        axes.set_xlabel("threshold of the filter (grey levels of 255; dotted: the paper's)")
        axes.set_ylabel(title)
        tidy(axes)
    line[0].plot([], [], color="0.3", linestyle="--", label="no filter, same colour")
    figure.legend(*line[0].get_legend_handles_labels(), loc="outside lower center", ncols=5)
    return figure


THRESHOLD = Experiment(
    "threshold", "Threshold of the filter", "error of the specular filter with thresholds of 5 to 120 grey levels", run
)
