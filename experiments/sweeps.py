"""Number of lights, their elevation, and noise: what the paper held fixed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from bgars import _bgars
from bgars.normals.methods import METHODS

from experiments.curves import draw_errors, marks_in_words
from experiments.measure import COLUMNS, FILTER, NAIVE, Measurement, measure_all
from experiments.outcome import Experiment, Outcome, Picture
from experiments.setting import Setting
from experiments.style import new_figure
from experiments.words import method_table, of_method, ranges, split_by_gain

if TYPE_CHECKING:
    from experiments.outcome import Run

__all__ = ["ELEVATION", "LIGHTS", "NOISE"]


@dataclass(frozen=True)
class Sweep:
    """A quantity of :class:`Setting` and the values it takes.

    Attributes
    ----------
    name, title, label, unit : str
        Of the experiment, its section, its axis, and the unit in sentences.
    field : str
        Of the setting.
    values : tuple of float
        In rising order.
    note : str
        What the reader must know.
    """

    name: str
    title: str
    label: str
    unit: str
    field: str
    values: tuple[float, ...]
    note: str = ""


def run(how: Run, *, sweep: Sweep) -> Outcome:
    """Every method at every value."""
    measurements: list[Measurement] = []
    for index, value in enumerate(sweep.values):
        setting = Setting().with_value(sweep.field, value)
        measurements += measure_all(setting, how.radius_px)
        how.report((index + 1) / len(sweep.values))

    def value_of(one: Measurement) -> float:
        return float(getattr(one.setting, sweep.field))

    figure = new_figure(11.5, 4.2)
    draw_errors(figure, measurements, value_of, sweep.label)
    better, worse = split_by_gain(measurements, value_of)
    _, flatter = split_by_gain(measurements, value_of, "height_rmse_px")
    heights = f"{ranges(flatter, sweep.values)}{sweep.unit}" if flatter else ""
    extra = () if sweep.field in COLUMNS else (sweep.field,)
    ends = "; ".join(
        f"{method} {own[0].mean_deg_nz03:.1f} deg at {sweep.values[0]:g}{sweep.unit}, "
        f"{own[-1].mean_deg_nz03:.1f} at {sweep.values[-1]:g}{sweep.unit}, "
        f"least {best.mean_deg_nz03:.1f} at {value_of(best):g}{sweep.unit}"
        for method in METHODS
        for own in [of_method(measurements, method)]
        for best in [min(own, key=lambda one: one.mean_deg_nz03)]
    )
    filtered = of_method(measurements, FILTER)
    best = min(filtered, key=lambda one: one.mean_deg_nz03)
    return Outcome(
        pictures=(
            Picture(
                sweep.name,
                figure,
                f"Errors of every method over the {sweep.title.lower()}.{marks_in_words(measurements)}",
            ),
        ),
        columns=(*COLUMNS, *extra),
        rows=[one.row | {name: getattr(one.setting, name) for name in extra} for one in measurements],
        table=method_table(sweep.label, measurements, value_of),
        about=f"{sweep.note}{' ' if sweep.note else ''}Mean errors: {ends}.",
        agrees=(f"{FILTER} is better than {NAIVE} at {ranges(better, sweep.values)}{sweep.unit}.",) if better else (),
        differs=((f"it is no better, or worse, at {ranges(worse, sweep.values)}{sweep.unit}.",) if worse else ())
        + (
            (
                f"its error is least, {best.mean_deg_nz03:.1f} deg, at {value_of(best):g}{sweep.unit} and rises to "
                f"{filtered[-1].mean_deg_nz03:.1f} at {value_of(filtered[-1]):g}.",
            )
            if best not in (filtered[0], filtered[-1])
            else ()
        )
        + ((f"its height RMSE is no smaller than that of {NAIVE} at {heights}.",) if flatter else ()),
        limit=(
            f"{sweep.title}: the filter is no better than naive least squares at {ranges(worse, sweep.values)}"
            f"{sweep.unit}" + (f", its height RMSE no smaller at {heights}." if flatter else ".")
            if worse
            else ""
        ),
        holds=(
            f"{sweep.title}: the filter is better at {ranges(better, sweep.values)}{sweep.unit}."
            if better and not worse
            else ""
        ),
    )


SWEEPS = (
    Sweep(
        name="lights",
        title="Number of lights",
        label="lights on the ring",
        unit=" lights",
        field="lights",
        values=tuple(float(count) for count in range(3, 17)),
        note=(
            "With 3 lights nothing can be dropped: all methods are one. "
            f"reflectance needs {_bgars.REFLECTANCE_MIN_LIGHTS} lights; with fewer its guard stands in "
            "(docs/reflectance.md)."
        ),
    ),
    Sweep(
        name="elevation",
        title="Elevation of the ring",
        label="elevation of the ring (deg)",
        unit=" deg",
        field="elevation_deg",
        values=tuple(float(angle) for angle in range(20, 75, 5)),
    ),
    Sweep(
        name="noise",
        title="Noise",
        label="read noise (grey levels of 255)",
        unit=" grey levels",
        field="noise_levels",
        values=(0.0, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0),
        note="Standard deviation of normal read noise. The black level is 0: noise in shadows is cut off below it.",
    ),
)
SUMMARIES = {
    "lights": "errors of every method with 3 to 16 lights on the ring",
    "elevation": "errors of every method for lights at 20 to 70 deg elevation",
    "noise": "errors of every method with 0 to 5 grey levels of noise",
}
LIGHTS, ELEVATION, NOISE = (
    Experiment(sweep.name, sweep.title, SUMMARIES[sweep.name], partial(run, sweep=sweep)) for sweep in SWEEPS
)
