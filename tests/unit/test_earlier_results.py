"""A folder of results holds one run or none: what an earlier run left never lies beside, or in place of, a new one."""

from __future__ import annotations

import json
from pathlib import Path

import bgars
import pytest
from bgars.cli.app import app
from bgars.io.atomic import FolderNames, atomic_folder
from typer.testing import CliRunner

NAMES = FolderNames(frozenset({"verdict.json", "picture.png", "more.json"}), frozenset({"verdict.json"}))


def command(*arguments: object) -> str:
    """Run bgars; return what it says, or the error that main() turns into one line."""
    run = CliRunner().invoke(app, [*map(str, arguments)])
    return str(run.exception) if isinstance(run.exception, bgars.BgarsError) else run.output


def filled(folder: Path, *names: str) -> Path:
    folder.mkdir(exist_ok=True)
    for name in names:
        (folder / name).write_text("earlier", encoding="utf-8")
    return folder


def names_in(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_what_this_run_does_not_write_is_removed(tmp_path: Path) -> None:
    folder = filled(tmp_path / "out", *NAMES.written, "notes.txt")
    with atomic_folder(folder, NAMES) as place:
        (place / "verdict.json").write_text("new", encoding="utf-8")
    assert names_in(folder) == {"verdict.json", "notes.txt"}
    assert (folder / "verdict.json").read_text(encoding="utf-8") == "new"
    assert (folder / "notes.txt").read_text(encoding="utf-8") == "earlier"


def test_a_run_that_fails_leaves_nothing_of_an_earlier_one(tmp_path: Path) -> None:
    folder = filled(tmp_path / "out", *NAMES.written, "notes.txt")
    with pytest.raises(bgars.CalibrationError), atomic_folder(folder, NAMES):
        raise bgars.CalibrationError("lights do not fit")
    assert names_in(folder) == {"notes.txt"}


def test_without_the_mark_of_a_run_files_of_its_names_are_foreign(tmp_path: Path) -> None:
    folder = filled(tmp_path / "out", "picture.png")
    (folder / "more.json").mkdir()
    with pytest.raises(bgars.CalibrationError), atomic_folder(folder, NAMES):
        raise bgars.CalibrationError("lights do not fit")
    assert names_in(folder) == {"picture.png", "more.json"}


def test_a_failing_inspection_leaves_no_verdict_of_another_part(capture_folder: Path, tmp_path: Path) -> None:
    old = ("result.json", "balls.csv", "balls.parquet", "cfx.json", "report.html", "part.png", "surface.npz")
    out = filled(tmp_path / "out", *old, "notes.txt")
    (capture_folder / "img0.png").unlink()
    assert "3 images" in command("inspect", capture_folder, "-o", out)
    assert names_in(out) == {"notes.txt"}


def test_wrong_use_of_inspect_is_no_run(capture_folder: Path, tmp_path: Path) -> None:
    out = filled(tmp_path / "out", "result.json")
    assert "give one of them" in command("inspect", capture_folder, "-o", out, "--log", "--json")
    assert names_in(out) == {"result.json"}


def test_an_inspection_without_options_removes_what_they_wrote(tmp_path: Path) -> None:
    out = filled(tmp_path / "out", "result.json", "cfx.json", "balls.parquet", "notes.txt")
    written = json.loads(command("inspect", bgars.sample_capture(), "-o", out, "--json"))["output"]
    assert names_in(out) == {*written, "notes.txt"}
    assert "cfx.json" not in written


def test_a_reconstruction_removes_the_mesh_of_an_earlier_one(tmp_path: Path) -> None:
    out = tmp_path / "out"
    for mesh_format in ("ply", "stl"):
        said = command("reconstruct", bgars.sample_capture(), "-o", out, "--mesh-format", mesh_format, "--json")
        assert names_in(out) == set(json.loads(said)["files"])
    assert (
        "no such file" in command("reconstruct", bgars.sample_capture(), "-o", out, "--material", "none.toml").lower()
    )
    assert names_in(out) == set()


def test_a_failing_study_leaves_no_verdict_of_an_earlier_one(tmp_path: Path) -> None:
    out = filled(tmp_path / "out", "grr.html", "grr.json", "readings.csv", "notes.txt")
    assert "no such folder" in command("grr", tmp_path / "nowhere", "-o", out)
    assert names_in(out) == {"notes.txt"}
