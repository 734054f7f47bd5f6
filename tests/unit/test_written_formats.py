"""Commands choose the format by the ending of the file that is named."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import bgars
import numpy as np
import pytest
import tifffile
from bgars.cli.app import app
from bgars.io import formats
from bgars.io.own_files import is_own
from typer.testing import CliRunner


def command(*arguments: object) -> tuple[str, dict[str, object]]:
    """Run a command on the sample; return its error, and its JSON where there is none."""
    name, *others = map(str, arguments)
    run = CliRunner().invoke(app, [name, str(bgars.sample_capture()), *others, "--json"])
    if isinstance(run.exception, bgars.BgarsError):
        return str(run.exception), {}
    assert run.exit_code == 0, run.output
    return "", json.loads(run.stdout)


def test_normals_as_one_file(tmp_path: Path) -> None:
    options = ("--method", "lambertian")
    for name in ("n.npy", "n.png"):
        _, facts = command("normals", "-o", tmp_path / name, *options)
        assert facts["files"] == [name]
    normals = np.load(tmp_path / "n.npy")
    assert normals.shape == (240, 256, 3)
    png = bgars.read_normal_map(tmp_path / "n.png")
    assert np.nanmax(bgars.angular_error_deg(png, normals)) < 0.01
    assert {path.name for path in tmp_path.iterdir()} == {"n.npy", "n.png"}


def test_what_cannot_be_a_file_of_normals_is_said(tmp_path: Path) -> None:
    text, _ = command("normals", "-o", tmp_path / "n.bmp")
    assert text.startswith(f"{tmp_path / 'n.bmp'}: a file of normals must end in .png, .tif, .tiff, .exr, .npy, .npz;")
    assert text.endswith("for results in a folder of this name, make it first")
    text, _ = command("normals", "-o", tmp_path / "n.npy", "--directx")
    assert text.startswith("--directx: only a .png says")
    text, _ = command("normals", "-o", tmp_path / "none" / "n.npy")
    assert text == f"{tmp_path / 'none' / 'n.npy'}: cannot be written (no such folder)"
    text, _ = command("normals", "-o", bgars.sample_capture() / "n.npy")
    assert "results never go among inputs" in text
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["lot.2026", "out.v2", "made.bmp"])
def test_a_folder_may_have_a_dot(tmp_path: Path, name: str) -> None:
    if name.startswith("made"):
        (tmp_path / name).mkdir()
    command("normals", "-o", tmp_path / name, "--method", "lambertian")
    assert (tmp_path / name / "normals.png").is_file()


@pytest.mark.parametrize(("name", "package"), [("gsf", "gsffile"), ("sdf", "sdfio"), ("x3p", "x3pio")])
def test_reconstruct_writes_heights_for_metrology(tmp_path: Path, name: str, package: str) -> None:
    reader = pytest.importorskip(package)
    _, facts = command(
        *("reconstruct", "-o", tmp_path, "--method", "lambertian", "--height-format", name, "--mesh-format", "stl")
    )
    path = tmp_path / f"height.{name}"
    assert path.name in facts["files"]
    heights_um = tifffile.imread(tmp_path / "height.tif")
    if name == "gsf":
        stored = reader.read_gsf(path)[0]
    else:
        stored = (reader.read(path).data if name == "sdf" else reader.read(path).layers[0].z)[::-1]
    np.testing.assert_allclose(stored * 1e6, heights_um, atol=1e-4)
    assert is_own(path)
    command("reconstruct", "-o", tmp_path, "--method", "lambertian")
    assert not path.exists(), "of an earlier run"


def test_metres_need_a_pitch_before_any_work(tmp_path: Path) -> None:
    pytest.importorskip("gsffile")
    capture = shutil.copytree(bgars.sample_capture(), tmp_path / "capture")
    recipe = capture / "capture.toml"
    kept = [line for line in recipe.read_text(encoding="utf-8").splitlines() if not line.startswith("pixel_pitch")]
    recipe.write_text("\n".join(kept), encoding="utf-8")
    out = tmp_path / "out"
    run = CliRunner().invoke(app, ["reconstruct", str(capture), "-o", str(out), "--height-format", "gsf"])
    assert str(run.exception).endswith(
        "height.gsf: .gsf holds metres, which need a pixel pitch (pixel_pitch_um); these heights are in pixels"
    )
    assert not out.exists()


def test_exr_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(formats, "missing", lambda *names: names)
    text, _ = command("normals", "-o", tmp_path / "n.exr")
    assert text.startswith(f"{tmp_path / 'n.exr'}: .exr needs OpenEXR: pip install 'bgars[exr]'")
    assert not list(tmp_path.iterdir())
