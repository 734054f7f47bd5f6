"""Nothing that goes out destroys what is there: inputs, files of others, results of a run that was killed."""

from __future__ import annotations

import csv
import io
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import bgars
import numpy as np
import pytest
from bgars.cli.app import app
from bgars.cli.inspect import NAMES
from bgars.cli.outputs import RECONSTRUCTION
from bgars.files.csv_cells import harmless
from bgars.io.atomic import FORGOTTEN_S, PARTIAL_PREFIX, atomic_file, atomic_folder
from bgars.io.own_files import is_own
from typer.testing import CliRunner

from experiments import write_experiments

DEAD = 2**22 - 3
"""No process has this number: Linux gives out smaller ones."""


def command(*arguments: object) -> tuple[int, str]:
    run = CliRunner().invoke(app, [*map(str, arguments)])
    return run.exit_code, str(run.exception) if isinstance(run.exception, bgars.BgarsError) else run.output


def content(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture
def own_capture(tmp_path: Path) -> Path:
    folder = tmp_path / "photographs"
    shutil.copytree(bgars.sample_capture(), folder)
    (folder / "part.png").write_bytes(b"a photograph")
    (folder / "balls.csv").write_text("name,x\nA1,1\n", encoding="utf-8")
    (folder / "result.json").write_text("{}", encoding="utf-8")
    return folder


@pytest.mark.parametrize("name", ["check", "inspect", "reconstruct", "normals", "grr", "spc", "demo"])
def test_no_command_writes_among_inputs(name: str, own_capture: Path) -> None:
    before = content(own_capture)
    given = [] if name == "demo" else [own_capture]
    _, said = command(name, *given, "-o", own_capture)
    assert "results never go among inputs" in said
    assert "\n" not in said.strip()
    assert content(own_capture) == before


@pytest.mark.parametrize("name", ["check", "inspect", "reconstruct", "normals"])
def test_nor_among_those_of_another_command_or_by_another_way(name: str, own_capture: Path, tmp_path: Path) -> None:
    link = tmp_path / "link"
    link.symlink_to(own_capture)
    before = content(own_capture)
    assert "never go among inputs" in command(name, bgars.sample_capture(), "-o", link)[1]
    assert "capture.toml" in command(name, bgars.sample_capture(), "-o", own_capture)[1]
    assert content(own_capture) == before


def test_a_simulation_over_another_capture_is_refused(own_capture: Path) -> None:
    before = content(own_capture)
    said = command("simulate", "hemisphere", "-o", own_capture)[1]
    assert "holds a capture already (capture.toml, filenames.txt, light_directions.txt)" in said
    assert content(own_capture) == before


@pytest.mark.parametrize("name", sorted(RECONSTRUCTION.written))
def test_a_reconstruction_never_replaces_files_of_others(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(b"mine")
    said = command("reconstruct", bgars.sample_capture(), "-o", tmp_path)[1]
    assert f"holds {name}, which bgars did not write" in said
    assert content(tmp_path) == {name: b"mine"}


def test_own_results_are_known_by_what_is_in_them(tmp_path: Path) -> None:
    sample = bgars.sample_capture()
    assert command("inspect", sample, "-o", tmp_path / "i", "--parquet", "--cfx")[0] in {0, 1}
    for mesh_format in ("ply", "obj", "stl", "glb"):
        assert command("reconstruct", sample, "-o", tmp_path / mesh_format, "--mesh-format", mesh_format)[0] == 0
    assert command("normals", sample, "-o", tmp_path / "n")[0] == 0
    written = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert len(written) > len(NAMES.written)
    assert [str(path) for path in written if not is_own(path)] == []
    inputs = [path for path in sample.iterdir() if path.is_file()]
    assert [path.name for path in inputs if is_own(path)] == []
    assert command("normals", sample, "-o", tmp_path / "n")[0] == 0, "again, over its own"


@pytest.mark.parametrize(
    "arguments",
    [
        ["inspect", "photographs", "-o", ""],
        ["inspect", "photographs", "--output="],
        ["reconstruct", "photographs", "--output", ""],
        ["demo", "-o", ""],
        ["inspect", "", "-o", "out"],
        ["simulate", "hemisphere", "-o", ""],
        ["mesh", "", "-o", "m.ply"],
    ],
)
def test_an_empty_path_is_not_the_current_folder(
    arguments: list[str], own_capture: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(own_capture.parent)
    before = content(own_capture.parent)
    said = command(*arguments)[1]
    assert "empty" in said
    assert content(own_capture.parent) == before


KILLED = """
import sys, time
from pathlib import Path
from bgars.io.atomic import atomic_file, atomic_folder
if sys.argv[1] == "folder":
    with atomic_folder(sys.argv[2]) as place:
        (place / "half.png").write_bytes(b"half")
        print("ready", flush=True)
        time.sleep(600)
else:
    with atomic_file(Path(sys.argv[2]) / "m.ply") as temporary:
        temporary.write_bytes(b"half")
        print("ready", flush=True)
        time.sleep(600)
"""


@pytest.mark.parametrize("kind", ["folder", "file"])
def test_what_a_killed_run_left_is_removed_by_the_next(kind: str, tmp_path: Path) -> None:
    foreign = tmp_path / f"{PARTIAL_PREFIX}notes.txt"
    foreign.write_text("mine", encoding="utf-8")
    with subprocess.Popen([sys.executable, "-c", KILLED, kind, str(tmp_path)], stdout=subprocess.PIPE) as run:
        assert run.stdout is not None
        assert run.stdout.readline() == b"ready\n"
        left = [path for path in tmp_path.iterdir() if path != foreign]
        assert len(left) == 1
        with atomic_file(tmp_path / "meanwhile.txt") as temporary:
            temporary.write_text("done", encoding="utf-8")
        assert left[0].exists(), "a run that still works keeps its files"
        os.kill(run.pid, signal.SIGKILL)
        run.wait()
    with atomic_folder(tmp_path) as place:
        (place / "whole.txt").write_text("done", encoding="utf-8")
    assert {path.name for path in tmp_path.iterdir()} == {foreign.name, "meanwhile.txt", "whole.txt"}


def test_leftovers_of_another_machine_go_after_a_day(tmp_path: Path) -> None:
    left = tmp_path / f"{PARTIAL_PREFIX}{DEAD}-77-123-0.ply"
    left.write_bytes(b"half")
    with atomic_file(tmp_path / "a.txt"):
        pass
    assert left.exists(), "its process may still run there"
    yesterday = time.time() - FORGOTTEN_S - 60
    os.utime(left, (yesterday, yesterday))
    with atomic_file(tmp_path / "a.txt"):
        pass
    assert not left.exists()


@pytest.mark.parametrize("name", ["=1+2", "+A1", "-A1", "@SUM(A1)", "\tA1", "\rA1"])
def test_no_cell_of_a_table_is_a_formula(name: str) -> None:
    assert harmless(name) == f"'{name}"
    assert harmless("A1") == "A1"


def test_names_of_balls_are_harmless_in_a_spreadsheet(tmp_path: Path) -> None:
    table = tmp_path / "positions.csv"
    table.write_text("name,x_um,y_um\n=cmd|' /C calc'!A0,0,0\n", encoding="utf-8")
    recipe = tmp_path / "part.toml"
    recipe.write_text(
        'positions = "positions.csv"\nname = "x"\n[limits]\nseating_coplanarity_um = 50.0\n', encoding="utf-8"
    )
    capture = bgars.read_capture(bgars.sample_capture())
    result = bgars.inspect(capture, bgars.read_part_recipe(recipe))
    cells = [cell for row in csv.reader(io.StringIO(result.to_csv())) for cell in row]
    assert any("cmd|" in cell for cell in cells)
    texts = [cell for cell in cells if not _is_number(cell)]
    assert not [cell for cell in texts if cell.startswith(("=", "+", "-", "@", "\t", "\r"))]


def _is_number(cell: str) -> bool:
    try:
        return bool(np.isscalar(float(cell)))
    except ValueError:
        return False


def heights(tmp_path: Path) -> Path:
    path = tmp_path / "heights.tif"
    bgars.write_height(bgars.HeightMap.from_array(np.zeros((4, 5), np.float32), pixel_pitch_um=10.0), path)
    return path


@pytest.mark.parametrize("suffix", ["ply", "obj", "stl", "glb"])
def test_a_mesh_replaces_its_own_kind_and_nothing_else(suffix: str, tmp_path: Path) -> None:
    source, output = heights(tmp_path), tmp_path / f"part.{suffix}"
    assert command("mesh", source, "-o", output)[0] == 0
    assert is_own(output)
    assert command("mesh", source, "-o", output)[0] == 0, "again, over its own"
    output.write_bytes(b"a scan of last year")
    assert "bgars did not write it" in command("mesh", source, "-o", output)[1]
    assert output.read_bytes() == b"a scan of last year"


def test_a_material_replaces_no_recipe(tmp_path: Path) -> None:
    mine = tmp_path / "part.toml"
    mine.write_text('name = "mine"\nrows = 4\n', encoding="utf-8")
    said = command("calibrate", "material", bgars.sample_capture(), "-o", mine)[1]
    assert "bgars did not write it" in said
    assert mine.read_text(encoding="utf-8").startswith('name = "mine"')


def test_own_tables_of_text_are_known(tmp_path: Path) -> None:
    lobe = bgars.SurfaceLobe(strength_level=255.0, roughness=0.2, tail=0.0)
    bgars.write_material(bgars.SurfaceMaterial(30.0, 0.0, 0.0, (lobe,), "smith", gains=(1.0,) * 8), tmp_path / "m.toml")
    bgars.write_station(bgars.Station("bench"), tmp_path / "s.toml")
    assert is_own(tmp_path / "m.toml")
    assert is_own(tmp_path / "s.toml")
    assert not any(is_own(path) for path in bgars.sample_capture().glob("*.toml"))


def test_a_page_replaces_no_page_of_others(tmp_path: Path) -> None:
    page = tmp_path / "report.html"
    page.write_text("<html>minutes of a meeting</html>", encoding="utf-8")
    assert "bgars did not write it" in command("check", bgars.sample_capture(), "-o", page)[1]
    assert "bgars did not write it" in command("report", tmp_path, "-o", page)[1]
    assert page.read_text(encoding="utf-8") == "<html>minutes of a meeting</html>"


def test_an_experiment_replaces_its_own_files_and_no_others(tmp_path: Path) -> None:
    write_experiments("fig3", tmp_path, radius_px=12)
    write_experiments("fig3", tmp_path, radius_px=12)  # Again, over its own.
    for name in ("fig3.md", "fig3.csv", "fig3.png"):
        for path in tmp_path.iterdir():
            path.unlink()
        (tmp_path / name).write_bytes(b"mine")
        with pytest.raises(bgars.InputError, match="exists, and"):
            write_experiments("fig3", tmp_path, radius_px=12)
        assert content(tmp_path) == {name: b"mine"}
