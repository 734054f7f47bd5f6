"""One base wherever a person reads of a light: numbers count from 0, as the files light_00.png ... do."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import bgars
import numpy as np
import pytest
from bgars.inspection.judge import judge_part
from bgars.report.figures.overview import _show_input
from bgars.report.figures.overview_content import overview_content
from bgars.report.figures.shadows import shadow_figure
from bgars.report.html.photograph import lamps_of
from bgars.report.html.source import PageSource
from bgars.report.html.tables import light_rows, raised_together
from matplotlib.figure import Figure
from report_parts import RIG, passing, simulated
from synthetic_parts import measured_part

FILES = tuple(Path(f"light_{light:02d}.png") for light in range(len(RIG)))


def named() -> tuple[bgars.PartResult, bgars.Capture]:
    return passing(), replace(simulated("good")[0], files=FILES)


def titles(figure: Figure) -> list[str]:
    return [axes.get_title() for axes in figure.axes]


def test_shadow_panels_are_titled_by_the_file_they_show() -> None:
    result, capture = named()
    for title in titles(shadow_figure(result, capture)):
        light = int(title.partition("light ")[2].partition(" ")[0])
        assert f"light {light} (light_{light:02d}.png)" in title
    assert titles(shadow_figure(result, capture))[0].startswith("light 0 (light_00.png)\nazimuth 0°")


def test_the_overview_names_the_image_that_it_shows() -> None:
    capture = bgars.read_capture(bgars.sample_capture())
    figure = Figure()
    _show_input(figure, figure.subplots(), overview_content(bgars.reconstruct(capture, method="lambertian")))
    assert titles(figure)[0].startswith("Input: light 0 (light_00.png) of 8")


@pytest.mark.parametrize(("files", "told"), [(FILES, "light 2 (light_02.png)"), ((), "light 2 (counted from 0)")])
def test_reasons_name_the_file_of_a_light(files: tuple[Path, ...], told: str) -> None:
    found, measurement = measured_part(simulated("good")[1])
    change_deg = np.array([0.0, 0.1, 9.0, 0.2])
    result = judge_part(
        found, replace(measurement, light_change_deg=change_deg), None, light_files=[path.name for path in files]
    )
    assert any(reason.startswith(f"{told} stands 9.0 degrees") for reason in result.reasons)


def test_the_experiments_count_lights_from_0() -> None:
    text = Path(__file__).parents[2].joinpath("docs/images/experiments/fig3.csv").read_text(encoding="utf-8")
    assert [line.split(",")[0] for line in text.splitlines()[1:]] == [str(light) for light in range(8)]


def test_flagged_lights_are_among_the_panels_of_the_shadows() -> None:
    result, capture = named()
    lights = bgars.LightRig.ring(8)
    capture = replace(capture, rig=lights, images=np.repeat(capture.images, 2, axis=0), files=())
    change_deg = np.full(8, 0.02)
    change_deg[5] = 6.4
    result = replace(
        result,
        light_directions=lights.directions,
        light_change_deg=change_deg,
        warnings=("image 3 (counted from 0) is shifted by (+0.5, +0.0) pixels",),
    )
    whole, *close = shadow_figure(result, capture).axes
    assert whole.get_title().startswith("light 3 "), "a light that is named is drawn large"
    shown = [axes.get_title().partition("light ")[2][0] for axes in close]
    assert shown == ["0", "2", "3", "5"], "the named light, the one that moved most, then others"
    assert close[2].title.get_color() != close[0].title.get_color()


def test_lights_are_not_moved_where_nothing_was_fitted() -> None:
    result, capture = named()
    result = replace(result, shadow_residual_rms=float("nan"))
    figure = shadow_figure(result, capture)
    assert "no shadow was fitted" in figure.get_suptitle()
    assert all("not fitted" in title and "moved" not in title for title in titles(figure))
    source = PageSource(result.to_dict(), lamps=lamps_of(capture))
    assert {(row["moved"], row["raised"]) for row in light_rows(source)} == {("-", "-")}
    assert raised_together(source).startswith("not fitted")


def test_lights_that_stay_are_not_raised_by_less_than_nothing() -> None:
    result, capture = named()
    source = PageSource(result.to_dict(), lamps=lamps_of(capture))
    lower = [replace(lamp, elevation_deg=lamp.elevation_deg + 0.001) for lamp in source.lamps]
    assert raised_together(replace(source, lamps=tuple(lower))).startswith("+0.00°")
