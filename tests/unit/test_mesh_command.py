"""`bgars mesh`: every mesh is in the unit that it claims, and only normal maps and height maps become one."""

from __future__ import annotations

import re
from pathlib import Path

import bgars
import imageio.v3 as iio
import numpy as np
import pytest
import tifffile
import trimesh
from bgars.cli.app import app
from bgars.io.normal_map_pixels import NORMAL_MAP_SUFFIXES
from typer.testing import CliRunner


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Work in a folder with height maps of a slope that rises by 1 px a pixel, with and without a unit."""
    monkeypatch.chdir(tmp_path)
    slope_px = np.tile(np.arange(4, dtype=np.float32), (3, 1))
    bgars.write_height(bgars.HeightMap.from_array(10 * slope_px, pixel_pitch_um=10.0), "um.tif")
    bgars.write_height(bgars.HeightMap.from_array(10 * slope_px, pixel_pitch_um=10.0), "um.npy")
    bgars.write_height(bgars.HeightMap.from_array(slope_px), "px.tif")
    tifffile.imwrite("foreign.tif", 10 * slope_px)
    bgars.write_normal_map(np.tile(np.float32([0, 0, 1]), (3, 4, 1)), "normals.png")


def mesh(*arguments: object) -> str:
    """Run the command; return what it says, or the error that main() turns into one line."""
    run = CliRunner().invoke(app, ["mesh", *map(str, arguments), "-o", "m.ply"])
    if isinstance(run.exception, bgars.BgarsError):
        assert not Path("m.ply").exists()
        return str(run.exception)
    assert run.exit_code == 0, run.output
    return run.output


@pytest.mark.parametrize(
    ("arguments", "unit", "size"),
    [
        (["um.tif"], "um", 30.0),
        (["um.tif", "--pixel-pitch-um", 10], "um", 30.0),
        (["um.npy", "--pixel-pitch-um", 10], "um", 30.0),
        (["foreign.tif", "--pixel-pitch-um", 10], "um", 30.0),
        (["px.tif"], "px", 3.0),
        (["px.tif", "--pixel-pitch-um", 10], "um", 30.0),
    ],
)
def test_height_and_width_share_a_unit(arguments: list[object], unit: str, size: float) -> None:
    assert mesh(*arguments).rstrip().endswith(f"in {unit}")
    np.testing.assert_allclose(np.ptp(trimesh.load_mesh("m.ply").vertices, axis=0)[[0, 2]], size)


@pytest.mark.parametrize("name", ["um.npy", "foreign.tif"])
def test_a_height_map_without_a_unit_is_refused(name: str) -> None:
    assert mesh(name) == f"--pixel-pitch-um: must be given, {name} names no unit: its heights are then taken as um"


def test_a_pitch_that_contradicts_the_file_is_refused() -> None:
    assert mesh("um.tif", "--pixel-pitch-um", 5) == "--pixel-pitch-um: um.tif says 10.0, got 5.0; leave it out"


@pytest.mark.parametrize("pitch_um", ["0", "-1", "inf", "nan"])
def test_a_pitch_that_is_none_is_refused_by_name(pitch_um: str) -> None:
    words = f"pixel_pitch_um: must be finite and above 0, got {pitch_um}"
    for name in ("um.npy", "um.tif", "normals.png"):
        assert mesh(name, "--pixel-pitch-um", pitch_um) == "--" + words.replace("_", "-", 2)
    with pytest.raises(bgars.InputError, match=f"^{words}$"):
        bgars.HeightMap.from_array(np.ones((2, 2), np.float32), pixel_pitch_um=float(pitch_um))
    tifffile.imwrite("bad.tif", np.ones((2, 2), np.float32), description=f'{{"pixel_pitch_um": {pitch_um}}}')
    if pitch_um in {"0", "-1"}:
        assert "bad.tif: pixel_pitch_um of its description: must be finite" in mesh("bad.tif")


@pytest.mark.parametrize("content", ["albedo", "confidence"])
def test_another_tiff_of_bgars_is_no_height_map(capture_folder: Path, content: str) -> None:
    CliRunner().invoke(app, ["normals", str(capture_folder), "-o", "n"])
    words = f"n/{content}.tif: must hold a height map, but its description says 'bgars {content}'"
    assert mesh(f"n/{content}.tif", "--pixel-pitch-um", 10) == words


def test_a_picture_is_no_normal_map() -> None:
    picture = np.random.default_rng(1).integers(230, 256, (10, 10, 3), np.uint8)
    picture[:2] = [128, 128, 255]  # a fifth of it faces the camera
    iio.imwrite("picture.png", picture)
    words = "at least 50 % of its pixels must be unit vectors (length 1 within 0.1), but 80.0 % are not"
    assert mesh("picture.png") == f"picture.png: is not a normal map: {words}"
    picture[:8] = [128, 128, 255]
    iio.imwrite("picture.png", picture)
    assert "faces" in mesh("picture.png")


def test_what_is_no_map_is_told_what_is() -> None:
    taken = f"mesh takes a normal map ({', '.join(NORMAL_MAP_SUFFIXES)}) or a height map (.tif, .tiff, .npy)"
    Path("notes.txt").touch()
    Path("empty.npy").touch()
    Path("folder").mkdir()
    iio.imwrite("grey.png", np.zeros((3, 3), np.uint8))
    assert mesh("folder") == f"folder: is a folder; {taken}"
    assert mesh("none.png") == f"none.png: no such file; {taken}"
    assert mesh("notes.txt") == f"notes.txt: ends in '.txt'; {taken}"
    assert mesh("empty.npy") == f"empty.npy: is empty (0 bytes); {taken}"
    assert mesh("grey.png").endswith("; a normal map is an RGB image, R = x, G = y, B = z")


def command(*arguments: object) -> str:
    """Run the command with an output of its own; return what it says, or its error."""
    run = CliRunner().invoke(app, ["mesh", *map(str, arguments)])
    if isinstance(run.exception, bgars.BgarsError):
        return str(run.exception)
    assert run.exit_code == 0, run.output
    return run.output.strip()


def test_the_ending_chooses_what_is_written() -> None:
    assert command("um.tif", "-o", "p.xyz") == "p.xyz: 12 points, in um"
    assert np.loadtxt("p.xyz").shape == (12, 3)
    assert command("um.tif", "-o", "h.npy") == "h.npy: 12 heights of 4 x 3 pixels, in um"
    np.testing.assert_array_equal(np.load("h.npy"), tifffile.imread("um.tif"))
    gsffile = pytest.importorskip("gsffile")
    assert command("um.tif", "-o", "h.gsf") == "h.gsf: 12 heights of 4 x 3 pixels, in m"
    np.testing.assert_allclose(gsffile.read_gsf(Path("h.gsf"))[0], tifffile.imread("um.tif") * 1e-6, rtol=1e-6)
    for arguments in (("px.tif", "-o", "q.gsf"), ("normals.png", "-o", "q.gsf")):
        assert command(*arguments).startswith("--pixel-pitch-um: must be given, .gsf needs heights in um or m")
    assert "; mesh writes meshes (.ply, .obj, .stl, .glb), points (.xyz) and heights (.tif," in command(
        "um.tif", "-o", "m.dxf"
    )
    assert not list(Path().glob("q.*"))


def test_a_simplified_mesh_states_its_error() -> None:
    pytest.importorskip("fast_simplification")
    row, col = np.mgrid[:40, :50]
    heights = (0.02 * (row - 20) ** 2 + 0.3 * np.sin(col)).astype(np.float32)
    bgars.write_height(bgars.HeightMap.from_array(heights, pixel_pitch_um=2.0), "bowl.tif")
    text = command("bowl.tif", "-o", "m.ply", "--simplify", 1.0)
    found = re.fullmatch(
        r"m\.ply: (\d+) vertices, (\d+) faces of 3822, heights within (\S+) um at every pixel, in um", text
    )
    assert found is not None, text
    assert len(trimesh.load_mesh("m.ply").faces) == int(found[2]) < 2500
    assert 0 < float(found[3]) <= 1.0
    assert command("bowl.tif", "-o", "m.xyz", "--simplify", 1) == (
        "--simplify: only meshes have triangles (.ply, .obj, .stl, .glb); m.xyz does not"
    )
    assert command("bowl.tif", "-o", "m.ply", "--simplify", 0) == "--simplify: must be finite and above 0, got 0"
    assert command("normals.png", "-o", "n.ply", "--simplify", 1).startswith("--pixel-pitch-um: must be given, --simpl")
