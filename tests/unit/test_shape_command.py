"""`bgars shape` and its files: what stands out in them is on the surface."""

from __future__ import annotations

import json
from pathlib import Path

import bgars
import imageio.v3 as iio
import numpy as np
import pytest
import tifffile
from bgars.cli.app import app
from bgars.report.figures.shape import SHAPE_FILES
from typer.testing import CliRunner

PITCH_UM = 5.0


@pytest.fixture
def plate(tmp_path: Path) -> Path:
    """A tilted plate, 60 by 80 pixels of 5 um, with a dent and a bump, each 2 um deep or high and 3 pixels wide."""
    row, col = np.mgrid[:60, :80].astype(float)
    height_um = 0.4 * PITCH_UM * col
    for centre, sign in ((20.0, -1.0), (60.0, 1.0)):
        height_um += sign * 2.0 * np.exp(-((row - 30) ** 2 + (col - centre) ** 2) / (2 * 3.0**2))
    path = tmp_path / "height.tif"
    bgars.write_height(bgars.HeightMap.from_array(height_um.astype(np.float32), pixel_pitch_um=PITCH_UM), path)
    return path


def shape(*arguments: object) -> str:
    """Run the command; return what it prints, or raise as main() would be told."""
    run = CliRunner().invoke(app, ["shape", *map(str, arguments)])
    if run.exception is not None:
        raise run.exception
    return run.output


def test_dents_and_bumps_stand_out_of_a_tilted_plate(plate: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    said = json.loads(shape(plate, "-o", out, "--scale-px", 2, "--json"))
    assert said["files"] == list(SHAPE_FILES)
    assert sorted(path.name for path in out.iterdir()) == sorted(SHAPE_FILES)
    assert said["median_slope_deg"] == pytest.approx(np.degrees(np.arctan(0.4)), abs=0.5)
    images = {name: tifffile.imread(out / name) for name in SHAPE_FILES if name.endswith(".tif")}
    for name, sign in (("mean_curvature.tif", -1.0), ("flattened.tif", 1.0)):
        values = sign * np.nan_to_num(images[name])
        assert np.unravel_index(values.argmax(), values.shape) == pytest.approx((30, 60), abs=1), name
        assert np.unravel_index(values.argmin(), values.shape) == pytest.approx((30, 20), abs=1), name
    inside = images["slope.tif"][8:-8, 36:44]
    np.testing.assert_allclose(inside, np.degrees(np.arctan(0.4)), atol=0.5)
    heights = bgars.HeightMap.from_array(tifffile.imread(plate), pixel_pitch_um=PITCH_UM)
    expected = bgars.shape_images(heights, scale_px=2.0)
    np.testing.assert_array_equal(images["gaussian_curvature.tif"], expected.gaussian_curvature)
    with tifffile.TiffFile(out / "mean_curvature.tif") as file:
        description = json.loads(file.pages.first.description)
    assert description == {
        "content": "bgars mean curvature",
        "unit": "1/um",
        "scale_px": 2.0,
        "pixel_pitch_um": PITCH_UM,
    }
    picture = iio.imread(out / "shape.png")
    assert picture.shape[2] == 3
    assert np.ptp(picture) > 200


def test_a_normal_map_in_pixels_and_a_second_run(plate: Path, tmp_path: Path) -> None:
    normals = np.tile(np.float32([0.0, 0.6, 0.8]), (20, 30, 1))
    bgars.write_normal_map(normals, tmp_path / "normals.png")
    out = tmp_path / "out"
    shape(plate, "-o", out)
    said = shape(tmp_path / "normals.png", "-o", out, "--opengl")
    assert "Median slope 36.9 degrees" in said
    assert "deviation" in said
    assert "px" in said
    assert str(out / "shape.png") in said


def test_wrong_use_is_told_before_the_work(plate: Path, tmp_path: Path) -> None:
    with pytest.raises(bgars.InputError, match="--scale-px: must be finite and above 0, got 0"):
        shape(plate, "-o", tmp_path / "out", "--scale-px", 0)
    with pytest.raises(bgars.FileFormatError, match="is a folder; shape takes a normal map"):
        shape(tmp_path, "-o", tmp_path / "out")
    with pytest.raises(bgars.InputError, match="is a height map; leave them out"):
        shape(plate, "-o", tmp_path / "out", "--directx")
    assert not (tmp_path / "out").exists()
    source = plate.rename(tmp_path / "slope.tif")
    before = source.read_bytes()
    with pytest.raises(bgars.InputError, match="results never go among inputs"):
        shape(source, "-o", tmp_path)
    (tmp_path / "theirs").mkdir()
    (tmp_path / "theirs" / "flattened.tif").write_bytes(b"somebody's")
    with pytest.raises(bgars.FileFormatError, match=r"holds flattened\.tif, which bgars did not write"):
        shape(source, "-o", tmp_path / "theirs")
    assert source.read_bytes() == before
    assert [path.name for path in (tmp_path / "theirs").iterdir()] == ["flattened.tif"]


def test_where_nothing_is_known_nothing_is_said(tmp_path: Path) -> None:
    heights = np.full((9, 9), np.nan, np.float32)
    heights[4, 4] = 0.0
    files = bgars.write_shape_images(bgars.shape_images(bgars.HeightMap.from_array(heights)), tmp_path)
    assert set(files) == set(SHAPE_FILES)
    assert np.isnan(tifffile.imread(tmp_path / "slope.tif")).all()
