"""Height maps of programs that write a number where there is no height; maps that have none at all."""

from __future__ import annotations

import json
from pathlib import Path

import bgars
import numpy as np
import pytest
import tifffile
from bgars.cli.app import app
from bgars.io.height_marks import without_marks
from typer.testing import CliRunner

ROW, COL = np.mgrid[:30, :40]
INSIDE = np.hypot(ROW - 15, COL - 20) < 12
CAP = np.where(INSIDE, 200.0 - (ROW - 15.0) ** 2 - (COL - 20.0) ** 2, 0.0).astype(np.float32)


@pytest.mark.parametrize("mark", [-9999, -99999, -32768, 32767, 65535, 1e30, -1e30, 3.4028235e38, 2**31 - 1])
@pytest.mark.parametrize("factor", [0.01, 1.0, 100.0])
def test_marks_are_no_heights(mark: float, factor: float) -> None:
    heights, notes = without_marks(np.where(INSIDE, factor * CAP, np.float32(mark)).astype(np.float32))
    np.testing.assert_array_equal(np.isfinite(heights), INSIDE)
    assert len(notes) == 1
    assert f"taken as no height ({np.count_nonzero(~INSIDE)} of 1200 pixels)" in notes[0]


def test_several_marks_at_once() -> None:
    marked = CAP.copy()
    marked[0], marked[1], marked[2] = -9999.0, 1e30, -32768.0
    heights, notes = without_marks(marked)
    np.testing.assert_array_equal(np.isnan(heights), ROW < 3)
    assert len(notes) == 3


@pytest.mark.parametrize(
    "heights",
    [
        np.where(INSIDE, CAP, -400.0),  # a floor far below, of no usual number
        np.where(INSIDE, CAP, 0.0),
        np.linspace(-9999.0, 9999.0, 1200).reshape(30, 40),  # reached without a gap
        np.clip(CAP * 400.0 - 60_000.0, -32768.0, 32767.0),
        np.full((3, 4), np.nan),
        np.float32([[np.inf, -np.inf, 1.0]]),
    ],
    ids=["floor", "board", "ramp", "clipped", "none", "infinite"],
)
def test_heights_stay(heights: np.ndarray) -> None:
    given = heights.astype(np.float32)
    kept, notes = without_marks(given)
    assert not notes
    np.testing.assert_array_equal(kept, given)


@pytest.mark.parametrize("name", ["h.tif", "h.npy"])
def test_the_mark_is_said(tmp_path: Path, name: str) -> None:
    marked = np.where(INSIDE, CAP, np.float32(-9999))
    if name.endswith("tif"):
        tifffile.imwrite(tmp_path / name, marked)
    else:
        np.save(tmp_path / name, marked.astype(np.int16))
    with pytest.warns(UserWarning, match=rf"{name}: -9999 taken as no height"):
        heights, _ = bgars.read_height(tmp_path / name)
    np.testing.assert_array_equal(np.isfinite(heights), INSIDE)
    said = run("shape", tmp_path / name, "-o", tmp_path / "o", "--pixel-pitch-um", 10, "--json")
    assert json.loads(said)["notes"] == [f"-9999 taken as no height ({np.count_nonzero(~INSIDE)} of 1200 pixels)"]


@pytest.mark.parametrize("command", ["shape", "mesh"])
@pytest.mark.parametrize(
    ("values", "what"),
    [
        (np.full((4, 5), np.nan), "height"),
        (np.full((4, 5), -9999.0), "height"),
        (np.full((4, 5, 3), np.nan), "normal"),
    ],
)
def test_a_map_without_any_value_is_refused(tmp_path: Path, command: str, values: np.ndarray, what: str) -> None:
    np.save(tmp_path / "a.npy", values.astype(np.float32))
    with pytest.raises(bgars.FileFormatError, match=rf"a\.npy: holds no {what}: all of its 5 x 4 pixels"):
        run(command, tmp_path / "a.npy", "-o", tmp_path / "o.ply", "--pixel-pitch-um", 10)
    assert not (tmp_path / "o.ply").exists()


def run(*arguments: object) -> str:
    done = CliRunner().invoke(app, list(map(str, arguments)))
    if done.exception is not None:
        raise done.exception
    return done.stdout
