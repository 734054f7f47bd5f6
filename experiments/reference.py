"""Our errors beside those of an independent study of the method."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from experiments.measure import FILTER, NAIVE, measure_all
from experiments.outcome import Experiment, Outcome, Picture
from experiments.setting import Setting
from experiments.style import OKABE_ITO, new_figure, panels, tidy
from experiments.words import row_table

if TYPE_CHECKING:
    from bgars.normals.methods import Method
    from matplotlib.figure import Figure

    from experiments.outcome import Row, Run

__all__ = ["REFERENCE", "STUDY", "TOLERANCE_PERCENT"]

COLUMNS = ("i_d", "i_s", "hardness", "method", "study_deg", "bgars_deg", "difference_percent", "within_5_percent")
TOLERANCE_PERCENT = 5.0
RADIUS_PX = 90


@dataclass(frozen=True)
class StudyValue:
    """Mean errors over n_z > 0.3 that the study reports, to a tenth of a degree.

    Attributes
    ----------
    setting : Setting
        Hemisphere of R = 90 px, 8 lights at 45 deg.
    naive_deg, filter_deg : float
        Least squares; the sorted-gap filter taken literally.
    """

    setting: Setting
    naive_deg: float
    filter_deg: float

    @property
    def label(self) -> str:
        """What differs from the base scene."""
        one = self.setting
        return f"I_d {one.i_d:g}, I_s {one.i_s:g}, h {one.hardness:g}"


BASE = Setting()
STUDY = (
    StudyValue(replace(BASE, i_d=0.05), 17.7, 12.3),
    StudyValue(replace(BASE, i_d=0.1), 15.7, 9.7),
    StudyValue(BASE, 8.8, 5.5),
    StudyValue(replace(BASE, i_d=1.0), 4.3, 10.2),
    StudyValue(replace(BASE, i_s=0.0), 3.2, 3.9),
    StudyValue(replace(BASE, hardness=10.0), 9.5, 6.6),
    StudyValue(replace(BASE, hardness=160.0), 5.2, 4.4),
)


def run(how: Run) -> Outcome:
    """Both methods of the paper in each of the study's settings."""
    methods: tuple[Method, Method] = (NAIVE, FILTER)
    rows: list[Row] = []
    for index, value in enumerate(STUDY):
        ours = measure_all(value.setting, how.radius_px, methods)
        for one, study_deg in zip(ours, (value.naive_deg, value.filter_deg), strict=True):
            percent = 100.0 * (one.mean_deg_nz03 / study_deg - 1.0)
            rows.append(
                {
                    "i_d": value.setting.i_d,
                    "i_s": value.setting.i_s,
                    "hardness": value.setting.hardness,
                    "method": one.method,
                    "study_deg": study_deg,
                    "bgars_deg": one.mean_deg_nz03,
                    "difference_percent": percent,
                    "within_5_percent": "yes" if abs(percent) <= TOLERANCE_PERCENT else "no",
                }
            )
        how.report((index + 1) / len(STUDY))
    off = [row for row in rows if row["within_5_percent"] == "no"]
    largest = max(abs(float(row["difference_percent"])) for row in rows)
    rounding = max(100.0 * 0.05 / float(row["study_deg"]) for row in rows)
    size = "" if how.radius_px == RADIUS_PX else f" The study's radius is {RADIUS_PX} px, here it is {how.radius_px}."
    names = "; ".join(
        f"I_d {row['i_d']:g}, I_s {row['i_s']:g}, h {row['hardness']:g}, {row['method']} "
        f"({float(row['difference_percent']):+.1f} %)"
        for row in off
    )
    return Outcome(
        pictures=(Picture("reference", draw(rows), "Mean error in the study's settings: study and bgars."),),
        columns=COLUMNS,
        rows=rows,
        table=row_table(
            {
                "setting": "I_d {i_d:g}, I_s {i_s:g}, h {hardness:g}",
                "method": "{method}",
                "study (deg)": "{study_deg:.1f}",
                "bgars (deg)": "{bgars_deg:.2f}",
                "difference (%)": "{difference_percent:+.1f}",
            },
            rows,
        ),
        about=(
            "An independent study of the method reports mean errors over n_z > 0.3 to "
            f"a tenth of a degree; that rounding alone is worth up to {rounding:.1f} %.{size}"
        ),
        agrees=(
            f"{len(rows) - len(off)} of {len(rows)} values lie within 5 %, the largest difference is {largest:.1f} %.",
        ),
        differs=(f"beyond 5 %: {names}.{size}",) if off else (),
        holds=f"Reference: {len(rows) - len(off)} of {len(rows)} values of an independent study are met within 5 %.",
        limit=f"Reference: not within 5 % of the study: {names}." if off else "",
    )


def draw(rows: list[Row]) -> Figure:
    """A pair of marks a value."""
    figure = new_figure(9.5, 4.4)
    ((axes,),) = panels(figure, 1, 1)
    place = np.arange(len(STUDY))[::-1]
    for index, (method, color) in enumerate(((NAIVE, OKABE_ITO[0]), (FILTER, OKABE_ITO[1]))):
        own = [row for row in rows if row["method"] == method]
        y = place + 0.17 - 0.34 * index
        study = [float(row["study_deg"]) for row in own]
        axes.plot(study, y, "D", mfc="none", mec=color, markersize=11, label=f"{method}, study")
        axes.plot([float(row["bgars_deg"]) for row in own], y, "o", color=color, markersize=5, label=f"{method}, bgars")
    axes.set_yticks(place, [value.label for value in STUDY])
    axes.set_xlim(left=0.0)
    axes.set_xlabel("mean angular error, n_z > 0.3 (deg)")
    tidy(axes)
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure


REFERENCE = Experiment(
    "reference", "Reference values", "our errors beside those of an independent study, in percent", run
)
