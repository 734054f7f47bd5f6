"""One base wherever a person reads of a light: numbers count from 0, as the files light_00.png ... do."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import bgars
import numpy as np
import pytest
from bgars.inspection.judge import judge_part
from bgars.report.overview import _show_input
from bgars.report.part_shadows import shadow_figure
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
    assert titles(shadow_figure(result, capture))[0].startswith("light 0 (light_00.png), azimuth 0°")


def test_the_overview_names_the_image_that_it_shows() -> None:
    capture = bgars.read_capture(bgars.sample_capture())
    figure = Figure()
    _show_input(figure, figure.subplots(), bgars.reconstruct(capture, method="lambertian"))
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
