"""The Python of docs/station.md, run as it stands, and its page for a telephone."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from types import SimpleNamespace

import bgars
import imageio.v3 as iio
import numpy as np
import pytest
from bgars.records.light_calibration import BallView
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
