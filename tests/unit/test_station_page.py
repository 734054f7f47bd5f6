"""The Python of docs/station.md, run as it stands, and its page for a telephone."""

from __future__ import annotations

import re
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import bgars
import imageio.v3 as iio
import numpy as np
import pytest
from bgars.records.light_calibration import BallView
from bgars.report.figures.station_balls import balls_svg
from bgars.report.html.station_page import write_station_page
from bgars.station import srgb_response
from rendered_spheres import render, ring
from test_calibrate import bgars_command

LIGHTS = ring(4, 48.0)
PAGE = (Path(__file__).parents[2] / "docs" / "station.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with ball1, board, run1 to run3, station.toml and known.csv, as the page has them."""
    folder = tmp_path_factory.mktemp("line")
    images = render(LIGHTS, ball=(3.0, 2.0, 40.0), size=(110, 110), samples=2, blur_px=0.6, lamp_level=20.0, seed=5)
    board = np.full_like(images, 120)
    board[:, ::7, ::5] = 121
    board += np.arange(4, dtype=np.uint8)[:, None, None]
    for name, content in (("ball1", images), ("board", board), *((f"run{turn}", images) for turn in (1, 2, 3))):
        (folder / name).mkdir()
        for index, image in enumerate(content):
            iio.imwrite(folder / name / f"light{index}.png", image)
    rig = bgars.LightRig.from_directions(LIGHTS, u_deg=0.3)
    u, seen = np.full(4, 0.3), BallView("", np.array([3.0, 2.0, 40.0]), *([np.zeros(3)] * 3))
    lights = bgars.LightCalibration(rig, u, u * 0.6, u * 0.8, "mirror", (seen,), 0.02)
    bgars.write_station(bgars.Station("line", lights=lights, scale=bgars.Scale(20.0, 0.01)), folder / "station.toml")
    (folder / "known.csv").write_text("name,height_um,u_um\nA1,500,0.5\n")
    return folder


def test_the_python_of_the_page_runs(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    seen = SimpleNamespace(balls=[SimpleNamespace(name="A1", top_um=500.1, diameter_um=np.nan)])
    monkeypatch.setattr(bgars, "inspect", lambda *_: seen)
    names: dict[str, object] = {"bgars": bgars}
    blocks = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    assert len(blocks) == 3
    for block in blocks:
        exec(block, names)
    assert names["moved"] == []
    np.testing.assert_allclose(names["found"].rig.directions, LIGHTS, atol=0.02)  # type: ignore[attr-defined]
    assert names["verification"].balls == 1  # type: ignore[attr-defined]


def test_a_board_among_the_balls_is_asked_about(folder: Path, tmp_path: Path) -> None:
    shutil.copy(folder / "station.toml", tmp_path / "station.toml")
    run = bgars_command("check", folder / "board", "--station", tmp_path / "station.toml")
    assert run.code == 2
    assert "is it a board (bgars calibrate drift --reference flat), or a part" in run.stderr


def test_the_page_shows_axes_whole_discs_and_whose_findings_they_are(folder: Path, tmp_path: Path) -> None:
    known = bgars.read_station(folder / "station.toml")
    assert known.lights is not None
    unsure = replace(known.lights, u_deg=np.full(4, 1.0))
    findings = tuple(
        bgars.Remark(severity, words, code)
        for severity, words, code in (
            ("note", "on the grid", "grid"), ("doubt", "two lamps", "two-highlights"), ("doubt", "bent", "grid-unit"),
        )
    )  # fmt: skip
    station = replace(known, lights=unsure, response=srgb_response(), findings=findings)
    write_station_page(station, tmp_path / "station.html")
    page = (tmp_path / "station.html").read_text(encoding="utf-8")
    assert all("viewBox" in one for one in re.findall("<svg[^>]*>", page))
    assert "grey level (% of full scale)" in page
    assert "light (% of full scale)" in page
    # Discs of 20 u would overlap, and leave the picture.
    assert "shaded: 5 u" in page
    assert max(float(size) for size in re.findall(r'r="([\d.]+)" fill="#4477aa55"', page)) < 24.0
    last = page[page.index("<h2>Findings") :]
    order = ["<h3>Lights", "two lamps", "<h3>Scale", "bent", "on the grid"]
    assert [last.index(words) for words in order] == sorted(last.index(words) for words in order)
    assert "swipe" not in page


def test_pictures_of_balls_shrink_as_a_whole(folder: Path) -> None:
    capture = bgars.read_unlit(folder / "ball1")
    lights = bgars.read_station(folder / "station.toml").lights
    assert lights is not None
    drawing = balls_svg([capture], replace(lights, balls=(replace(lights.balls[0], capture="ball1"),) * 2))
    assert 'viewBox="0 0 720 380"' in drawing
