"""Figures over a set of judged scenes, and what is wanted of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from judge_scene import DEFAULT, SIMPLE
from records import READINGS, BallRecord, Reading, SceneRecord


class Coverage(NamedTuple):
    """Shares (percent) of readings whose error is within one and two stated standard uncertainties; NaN: none."""

    within_1: float
    within_2: float


@dataclass(frozen=True)
class Figures:
    """All figures of a set; counts of balls are over the scenes that have a result.

    Attributes
    ----------
    plain : int
        Captures without deviations that have a result.
    refused, crashed, default_worse, bad_parts_passed : tuple of str
        Names of scenes.
    found, undecided : float
        Percent of the balls that are there.
    top_error_px : (float, float)
        Median and 95th percentile of the absolute error.
    u_top_px, u_diameter_px : float
        Medians over the balls of captures without deviations; NaN without such captures.
    normals_deg : (float, float)
        Mean angle of the default method on each scene: median and worst.
    """

    scenes: int
    plain: int
    refused: tuple[str, ...]
    crashed: tuple[str, ...]
    balls: int
    found: float
    invented: int
    undecided: float
    wrong_passes: int
    wrong_fails: int
    bad_parts_passed: tuple[str, ...]
    coverage: dict[str, Coverage]
    top_error_px: tuple[float, float]
    u_top_px: float
    u_diameter_px: float
    normals_deg: tuple[float, float]
    default_worse: tuple[str, ...]


class Criterion(NamedTuple):
    """One line of what is wanted, and what was measured."""

    name: str
    wanted: str
    measured: str
    met: bool


BARS = {
    "wrong_fails": 0.5,
    "undecided": 25.0,
    "refused": 5.0,
    "found": 99.5,
    "u_top_px": 0.06,
    "u_diameter_px": 0.04,
    "top_median_px": 0.06,
    "top_95_px": 1.0,
    "normals_deg": 0.2,
}
"""Percent, pixels, degrees, which the project set itself: good balls hardly ever fail, few go to a second look, and
true uncertainties are not bought by stating large ones."""
COVERAGE_1, COVERAGE_2 = (60.0, 80.0), 92.0
"""Percent: 68 and 95 are right; errors of one part are common, so that shares over a set scatter."""


def summarise(records: Sequence[SceneRecord]) -> Figures:
    """Summarise a set of scenes."""
    judged = [record for record in records if record.judged]
    balls = [ball for record in judged for ball in record.balls]
    plain = [record for record in judged if not record.deviations]
    top_px = np.array([abs(error) / pixel for error, _, pixel in _readings(judged, "top")])
    means = [record.normals[DEFAULT].mean_deg for record in records if DEFAULT in record.normals]
    angles = [mean for mean in means if mean is not None]
    coplanarity = [record.coplanarity for record in judged if record.coplanarity]
    return Figures(
        scenes=len(records),
        plain=len(plain),
        refused=tuple(record.scene for record in records if record.refused is not None),
        crashed=tuple(record.scene for record in records if record.crashed is not None),
        balls=len(balls),
        found=percent(balls, lambda ball: ball.present),
        invented=sum(len(record.invented) for record in judged),
        undecided=percent(balls, lambda ball: ball.verdict == "undecided"),
        wrong_passes=sum(ball.wrongly_passed for ball in balls),
        wrong_fails=sum(not ball.bad and ball.verdict == "fail" for ball in balls),
        bad_parts_passed=tuple(record.scene for record in judged if record.bad_part_passed),
        coverage={
            **{name: coverage(ball.readings[name] for ball in balls if name in ball.readings) for name in READINGS},
            "coplanarity": coverage(coplanarity),
        },
        top_error_px=(median(top_px), float(np.percentile(top_px, 95)) if len(top_px) else np.nan),
        u_top_px=median([u / pixel for _, u, pixel in _readings(plain, "top")]),
        u_diameter_px=median([u / pixel for _, u, pixel in _readings(plain, "diameter")]),
        normals_deg=(median(angles), max(angles, default=np.nan)),
        default_worse=tuple(record.scene for record in records if default_worse(record)),
    )


def _readings(records: Iterable[SceneRecord], name: str) -> list[tuple[float, float, float]]:
    """Error, uncertainty (NaN: none) and size of a pixel, all in um, of all readings of one kind."""
    return [
        (reading.error_um, np.nan if reading.u_um is None else reading.u_um, record.pixel_um)
        for record in records
        for ball in record.balls
        if (reading := ball.readings.get(name))
    ]


def coverage(readings: Iterable[Reading]) -> Coverage:
    """Count readings within one and two standard uncertainties."""
    errors = np.array([(abs(reading.error_um), reading.u_um) for reading in readings if reading.u_um is not None])
    if not len(errors):
        return Coverage(np.nan, np.nan)
    return Coverage(*(float(100 * np.mean(errors[:, 0] <= factor * errors[:, 1])) for factor in (1, 2)))


def percent(balls: Sequence[BallRecord], is_so: Callable[[BallRecord], bool]) -> float:
    """Share of balls, in percent; NaN without any."""
    return 100 * sum(map(is_so, balls)) / len(balls) if balls else np.nan


def median(values: Sequence[float] | np.ndarray[tuple[int], np.dtype[np.float64]]) -> float:
    """The median of the finite values; NaN without any."""
    finite = np.asarray(values, float)
    finite = finite[np.isfinite(finite)]
    return float(np.median(finite)) if len(finite) else np.nan


def default_worse(record: SceneRecord) -> bool:
    """Whether the default method is worse than the best simple one by more than the bar."""
    if DEFAULT not in record.normals:
        return False
    means = {name: one.mean_deg if one.mean_deg is not None else 99.0 for name, one in record.normals.items()}
    return means[DEFAULT] > BARS["normals_deg"] + min(means[name] for name in (*SIMPLE, DEFAULT) if name in means)


def criteria(figures: Figures) -> list[Criterion]:
    """What is wanted of any set of scenes; where nothing was measured, it is not met."""
    refused = 100 * len(figures.refused) / max(1, figures.scenes)
    failed = 100 * figures.wrong_fails / max(1, figures.balls)

    def none_of(name: str, scenes: tuple[str, ...]) -> Criterion:
        return Criterion(name, "0", f"{len(scenes)}: {', '.join(scenes)}" if scenes else "0", not scenes)

    def at_most(name: str, value: float, key: str, unit: str, digits: int) -> Criterion:
        return Criterion(name, f"<= {BARS[key]:g}{unit}", f"{value:.{digits}f}{unit}", value <= BARS[key])

    rows = [
        Criterion("bad balls passed", "0", str(figures.wrong_passes), figures.wrong_passes == 0),
        none_of("bad parts passed", figures.bad_parts_passed),
        Criterion("balls invented", "0", str(figures.invented), figures.invented == 0),
        none_of("captures that raise anything but a refusal", figures.crashed),
        at_most("good balls failed", failed, "wrong_fails", " %", 2),
        at_most("balls undecided", figures.undecided, "undecided", " %", 1),
        at_most("captures refused", refused, "refused", " %", 1),
        Criterion("balls found", f">= {BARS['found']:g} %", f"{figures.found:.2f} %", figures.found >= BARS["found"]),
    ]
    for name, (one, two) in figures.coverage.items():
        met = COVERAGE_1[0] <= one <= COVERAGE_1[1] and two >= COVERAGE_2
        wanted = f"{COVERAGE_1[0]:.0f} to {COVERAGE_1[1]:.0f} % / >= {COVERAGE_2:.0f} %"
        rows.append(Criterion(f"{name} within u / 2u", wanted, f"{one:.0f} % / {two:.0f} %", met))
    rows += [
        at_most("error of tops: median", figures.top_error_px[0], "top_median_px", " px", 3),
        at_most("error of tops: 95th percentile", figures.top_error_px[1], "top_95_px", " px", 2),
    ]
    if figures.plain:
        rows += [
            at_most("u of tops, without deviations: median", figures.u_top_px, "u_top_px", " px", 3),
            at_most("u of diameters, without deviations: median", figures.u_diameter_px, "u_diameter_px", " px", 3),
        ]
    return [*rows, none_of("default normals worse than a simple method by 0.2 degrees", figures.default_worse)]
