"""A folder of results holds one run or none: what an earlier run left never lies beside, or in place of, a new one."""

from __future__ import annotations

import json
from pathlib import Path

import bgars
import pytest
from bgars.cli import grr, inspect, spc
from bgars.cli.app import app
from bgars.cli.outputs import RECONSTRUCTION
from bgars.io.atomic import FolderNames, atomic_folder
from typer.testing import CliRunner

JUDGED = FolderNames(frozenset({"verdict.json", "picture.png", "more.json"}), frozenset({"verdict.json"}))


def command(*arguments: object) -> str:
    """Run bgars; return what it says, or the error that main() turns into one line."""
    run = CliRunner().invoke(app, [*map(str, arguments)])
    return str(run.exception) if isinstance(run.exception, bgars.BgarsError) else run.output


OWN = {
    ".json": b'{"format": "bgars-result", "inspected_utc": "2026-01-01T00:00:00Z", '
    b'"files": ["height.npy","mesh.glb","height.x3p"]}',
    ".csv": b"name,row,col,present,verdict,reasons,kind\n",
    ".html": b'<!doctype html><meta charset="utf-8"><meta name="generator" content="bgars">',
    ".png": b"\x89PNG\r\n\x1a\n....tEXtSoftware\0bgars",
    ".jpg": b"\xff\xd8\xff\xfe\0\x07bgars",
    ".parquet": b"PAR1 bgars",
    ".npz": b"PK ball_height_um.npy",
    ".tif": b'II*\0 {"content": "bgars height map"}',
    ".ply": b"ply\ncomment bgars mesh, unit um",
    ".obj": b"# bgars mesh, unit um",
    ".stl": b"bgars mesh",
    ".npy": b"",
    ".glb": b"",
    ".gsf": b"Gwyddion Simple Field 1.0\nTitle = bgars height map\n",
    ".sdf": b"bISO-1.0bgars",
    ".x3p": b"",
    ".txt": b"earlier",
}
MESSAGE = b'{"MessageName": "CFX.Production", "TimeStamp": "2026-01-01T00:00:00Z"}'


def filled(folder: Path, *names: str) -> Path:
    """A folder of files as an earlier run left them, known by what is in them."""
    folder.mkdir(exist_ok=True)
    for name in names:
        (folder / name).write_bytes(MESSAGE if name == "cfx.json" else OWN[Path(name).suffix])
    return folder


def foreign(folder: Path, *names: str) -> Path:
    """A folder of somebody else's files of these names."""
    folder.mkdir(exist_ok=True)
    for name in names:
        (folder / name).write_text('{"mine": true}', encoding="utf-8")
    return folder


def names_in(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_what_this_run_does_not_write_is_removed(tmp_path: Path) -> None:
    folder = filled(tmp_path / "out", *JUDGED.written, "notes.txt")
    with atomic_folder(folder, JUDGED) as place:
        (place / "verdict.json").write_text("new", encoding="utf-8")
    assert names_in(folder) == {"verdict.json", "notes.txt"}
    assert (folder / "verdict.json").read_text(encoding="utf-8") == "new"
    assert (folder / "notes.txt").read_bytes() == OWN[".txt"]


def test_a_failing_run_that_judges_leaves_nothing_of_an_earlier_one(tmp_path: Path) -> None:
    folder = filled(tmp_path / "out", *JUDGED.written, "notes.txt")
    with pytest.raises(bgars.CalibrationError), atomic_folder(folder, JUDGED):
        raise bgars.CalibrationError("lights do not fit")
    assert names_in(folder) == {"notes.txt"}


def test_somebody_elses_files_of_these_names_are_never_touched(tmp_path: Path) -> None:
    folder = foreign(tmp_path / "out", "picture.png", "verdict.json")
    refused = pytest.raises(bgars.FileFormatError, match=r"holds picture.png, verdict.json, which bgars did not write")
    with refused, atomic_folder(folder, JUDGED):
        pytest.fail("the work must not begin")
    assert {path.read_text(encoding="utf-8") for path in folder.iterdir()} == {'{"mine": true}'}


@pytest.mark.parametrize("name", sorted(inspect.NAMES.written))
def test_a_failing_inspection_deletes_nothing_of_others(name: str, capture_folder: Path, tmp_path: Path) -> None:
    out = foreign(tmp_path / "out", name)
    (capture_folder / "img0.png").unlink()
    assert "bgars did not write" in command("inspect", capture_folder, "-o", out)
    assert (out / name).read_text(encoding="utf-8") == '{"mine": true}'


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


def test_a_reconstruction_that_fails_costs_nothing(capture_folder: Path, tmp_path: Path) -> None:
    out = filled(tmp_path / "out", *RECONSTRUCTION.written)
    (capture_folder / "img0.png").unlink()
    assert "3 images" in command("reconstruct", capture_folder, "-o", out)
    assert names_in(out) == RECONSTRUCTION.written


@pytest.mark.parametrize(
    ("arguments", "files", "message"),
    [
        (("grr", "empty"), grr.NAMES.written, "it is none of these"),
        (("spc", "empty"), spc.NAMES.written, "holds no result.json"),
    ],
)
def test_a_failing_study_leaves_no_verdict_of_an_earlier_one(
    arguments: tuple[str, ...], files: frozenset[str], message: str, tmp_path: Path
) -> None:
    out = filled(tmp_path / "out", *files, "notes.txt")
    name, folder = arguments
    (tmp_path / folder).mkdir()
    assert message in command(name, tmp_path / folder, "-o", out)
    assert names_in(out) == {"notes.txt"}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("inspect", "nowhere"), "nowhere: no such folder"),
        (("inspect", "here/picture.png"), "picture.png: is not a folder"),
        (("inspect", "here", "--recipe", "none.toml"), "none.toml: no such file"),
        (("inspect", "here", "--recipe", "here"), "here: is a folder, not a file"),
        (("grr", "nowhere"), "nowhere: no such folder"),
        (("grr", "here", "--recipe", "none.toml"), "none.toml: no such file"),
        (("grr", "here", "--references", "none.csv"), "none.csv: no such file"),
        (("spc", "here", "nowhere"), "nowhere: no such file or folder"),
    ],
)
def test_a_mistyped_path_costs_nothing(
    arguments: tuple[str, ...], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    filled(tmp_path / "here", "picture.png")
    files = {"inspect": inspect.NAMES, "grr": grr.NAMES, "spc": spc.NAMES}[arguments[0]].written
    out = filled(tmp_path / "out", *files)
    assert message in command(*arguments, "-o", out)
    assert names_in(out) == files
