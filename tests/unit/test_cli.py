"""The command line: results, words, exit codes."""

from __future__ import annotations

import io
import json
import os
import signal
import subprocess
import sys
import time
import warnings
from collections.abc import Iterator
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any
from unittest.mock import patch

import bgars
import numpy as np
import pytest
import tifffile
import trimesh
import typer
from bgars.cli.app import app, main
from bgars.cli.console import activation
from bgars.cli.lazy import LAZY_COMMANDS
from bgars.normals.methods import ALL_METHODS, METHODS
from rich.text import Text


def bgars_command(*arguments: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run a command as its process does, but in this one."""
    arguments = tuple(map(str, arguments))
    stdout, stderr = (io.TextIOWrapper(io.BytesIO(), encoding="utf-8") for _ in range(2))
    before, code = Path.cwd(), 0
    with redirect_stdout(stdout), redirect_stderr(stderr), warnings.catch_warnings():
        try:
            os.chdir(cwd or before)
            with patch.object(sys, "argv", ["bgars", *arguments]):
                main()
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else int(end.code is not None)
        finally:
            os.chdir(before)
    told = []
    for stream in (stdout, stderr):
        stream.seek(0)
        told.append(stream.read())
    return subprocess.CompletedProcess(arguments, code, *told)


def bgars_process(*arguments: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run a command in a process of its own."""
    return subprocess.run(
        [sys.executable, "-m", "bgars", *map(str, arguments)], capture_output=True, text=True, check=False, cwd=cwd
    )


def test_demo_writes_everything_and_says_what_to_open(tmp_path: Path) -> None:
    run = bgars_process("demo", cwd=tmp_path)
    assert run.returncode == 0, run.stderr
    assert run.stderr == "", "quiet in pipes"
    for name in ("overview.png", "mesh.ply", "normals.png", "height.tif", "height.npy", "summary.json"):
        assert (tmp_path / "bgars-demo" / name).stat().st_size > 0
        assert f"bgars-demo/{name}" in run.stdout
    assert [path.name for path in tmp_path.iterdir()] == ["bgars-demo"], "no temporary folder is left"
    assert run.stdout.splitlines()[-1].startswith("Next: ")


@pytest.mark.parametrize("on_path", [False, True])
def test_what_to_type_after_the_demo_is_found_by_the_shell(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, on_path: bool
) -> None:
    scripts = tmp_path / ".venv" / "bin"
    scripts.mkdir(parents=True)
    for name in ("activate", "bgars"):
        (scripts / name).touch(mode=0o755)
    monkeypatch.setattr(sys, "prefix", str(tmp_path / ".venv"))
    monkeypatch.setenv("PATH", str(scripts) if on_path else "")
    monkeypatch.chdir(tmp_path)
    assert activation() == ("" if on_path else ". .venv/bin/activate && ")


@pytest.mark.parametrize("mesh_format", ["ply", "obj", "stl", "glb"])
def test_reconstruct(tmp_path: Path, mesh_format: str) -> None:
    out = tmp_path / "out"
    run = bgars_command("reconstruct", bgars.sample_capture(), "-o", out, "--mesh-format", mesh_format, "--json")
    assert run.returncode == 0, run.stderr
    summary = json.loads(run.stdout)
    assert summary == json.loads((out / "summary.json").read_text(encoding="utf-8"))
    assert summary["height"]["unit"] == "um"
    assert set(summary["files"]) == {path.name for path in out.iterdir()}
    assert len(trimesh.load_mesh(out / f"mesh.{mesh_format}").faces) == summary["mesh"]["faces"]
    np.testing.assert_array_equal(np.load(out / "height.npy"), tifffile.imread(out / "height.tif"))


def test_reconstruct_keeps_foreign_files_of_the_output_folder(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine", encoding="utf-8")
    assert bgars_command("reconstruct", bgars.sample_capture(), "-o", tmp_path).returncode == 0
    assert (tmp_path / "notes.txt").read_text(encoding="utf-8") == "mine"


def test_normals_then_mesh(tmp_path: Path) -> None:
    run = bgars_command("normals", bgars.sample_capture(), "-o", tmp_path / "n", "--json")
    assert run.returncode == 0, run.stderr
    facts = json.loads(run.stdout)
    assert facts["method"] == "reflectance"
    assert facts["choice"].startswith("reflectance on balls, robust-filter elsewhere: material fitted on 1 ball found")
    assert 0.3 < facts["measured_share"] <= 1.0
    assert facts["reflectance"]["accepted"]
    assert set(facts["files"]) == {path.name for path in (tmp_path / "n").iterdir()}
    mesh = tmp_path / "part.ply"
    run = bgars_command("mesh", tmp_path / "n" / "normals.png", "-o", mesh, "--pixel-pitch-um", 3.4, "--json")
    assert run.returncode == 0, run.stderr
    facts = json.loads(run.stdout)
    assert facts["unit"] == "um"
    assert len(trimesh.load_mesh(mesh).vertices) == facts["vertices"]
    smooth = np.ptp(trimesh.load_mesh(mesh).vertices[:, 2])
    options = ("--method", "bilateral", "--k", 1, "--solver", "compatible")
    run = bgars_command("mesh", tmp_path / "n" / "normals.png", "-o", mesh, "--pixel-pitch-um", 3.4, *options, "--json")
    assert run.returncode == 0, run.stderr
    facts = json.loads(run.stdout)
    assert facts["converged"]
    assert facts["reweightings"] >= 2
    assert 0.5 < np.ptp(trimesh.load_mesh(mesh).vertices[:, 2]) / smooth < 2.0


def test_height_map_to_mesh_keeps_its_scale(tmp_path: Path) -> None:
    height = bgars.integrate_normals(np.tile(np.float32([-0.6, 0, 0.8]), (5, 9, 1)), pixel_pitch_um=10.0)
    bgars.write_height(height, tmp_path / "h.tif")
    run = bgars_command("mesh", tmp_path / "h.tif", "-o", tmp_path / "h.obj")
    assert run.returncode == 0, run.stderr
    size = np.ptp(trimesh.load_mesh(tmp_path / "h.obj").vertices, axis=0)
    np.testing.assert_allclose(size, [80.0, 40.0, 60.0], rtol=1e-4)


def test_info(tmp_path: Path) -> None:
    run = bgars_command("info", bgars.sample_capture())
    assert run.returncode == 0, run.stderr
    for words in ("8 of 256 x 240 pixels, uint8", "3.4 um per pixel", "light_07.png", "45.0"):
        assert words in run.stdout
    facts = json.loads(bgars_command("info", bgars.sample_capture(), "--json").stdout)
    assert facts["lights"][2]["azimuth_deg"] == pytest.approx(90.0)
    assert 0 < facts["lights"][0]["clipped_fraction"] < 0.2
    assert bgars_command("info", tmp_path).returncode == 2


def test_info_tells_of_lights_below_the_surface(capture_folder: Path) -> None:
    recipe = "[lights]\ndirections = [[0.6, 0, -0.8], [0, 0.6, -0.8], [-0.6, 0, -0.8], [0, -0.6, -0.8]]\n"
    (capture_folder / "capture.toml").write_text(recipe, encoding="utf-8")
    run = bgars_command("info", capture_folder)
    assert (run.returncode, run.stderr.startswith("error: below-surface: every light stands below")) == (0, True)


def test_evaluate_on_the_sample() -> None:
    run = bgars_command("evaluate", bgars.sample_capture(), "--json")
    assert run.returncode == 0, run.stderr
    results = {result["method"]: result for result in json.loads(run.stdout)["results"]}
    assert results["lambertian"]["normals"]["mean_deg"] == pytest.approx(9.34, abs=0.05)
    assert results["specular-filter"]["normals"]["mean_deg"] == pytest.approx(6.76, abs=0.05)
    assert results["robust-filter"]["normals"]["mean_deg"] <= 1.35
    assert results["reflectance"]["normals"]["mean_deg"] <= 0.15
    assert results["reflectance"]["measured"]["pixels"] <= results["reflectance"]["normals"]["pixels"]
    assert 0 < results["reflectance"]["coverage"] < 1
    assert results["robust-filter"]["ball_height_rmse_um"] < results["lambertian"]["ball_height_rmse_um"]


@pytest.mark.parametrize(
    "command",
    [
        *("", "demo", "reconstruct", "normals", "mesh", "info", "evaluate", "inspect", "calibrate material"),
        *("simulate", "grr", "report", "spc"),
        *("batch", "watch", "query", "capture", "send", "store add", "store compact", "store export"),
    ],
)
def test_every_command_has_help(command: str) -> None:
    run = bgars_command(*command.split(), "--help")
    assert run.returncode == 0
    assert "Usage" in run.stdout
    assert len(run.stdout) > 300


def test_the_help_of_every_estimator_explains_each_method() -> None:
    commands = {name: loaded(command) for name, command in typer.main.get_command(app).commands.items()}
    for name in ("reconstruct", "normals", "inspect", "grr"):
        (told,) = [option.help for option in commands[name].params if option.name == "method"]
        for method in ALL_METHODS:
            assert f"{method}: " in told, (name, method)
        assert "Without balls and a material, with fewer than 4 lights" in told
        assert ": blind.\n\nrobust-filter: " in told, "each on a line of its own"
    (told,) = [option.help for option in commands["evaluate"].params if option.name == "method"]
    for method in METHODS:
        assert method in told
    assert "reflectance uses blind without balls" in told


def loaded(command: Any) -> Any:  # noqa: ANN401 - a command of whichever click typer brings
    """The command itself, where the list of commands only knows its name."""
    return command.load() if hasattr(command, "load") else command


def help_texts(command: object) -> Iterator[str]:
    command = loaded(command)
    for each in (command, *getattr(command, "params", ())):
        yield getattr(each, "help", None) or ""
    for other in getattr(command, "commands", {}).values():
        yield from help_texts(other)


def test_no_help_is_taken_for_markup() -> None:
    texts = list(help_texts(typer.main.get_command(app)))
    assert any("bgars\\[parquet]" in text for text in texts)
    for text in texts:
        assert Text.from_markup(text).plain == text.replace("\\[", "["), "brackets are escaped"


def test_the_list_of_commands_says_what_the_commands_say() -> None:
    commands = typer.main.get_command(app).commands
    assert set(LAZY_COMMANDS) < set(commands)
    for name, (_, line) in LAZY_COMMANDS.items():
        assert loaded(commands[name]).help.startswith(line.removesuffix(".")), name


def test_help_is_broken_into_lines_by_the_terminal_alone() -> None:
    for text in help_texts(typer.main.get_command(app)):
        assert "\n" not in text.replace("\n\n", "")


@pytest.mark.parametrize(
    ("words", "found"),
    [
        ("bgars gr", "grr"),
        ("bgars calibrate m", "material"),
        ("bgars inspect --pa", "--parquet"),
        ("bgars rep", "report"),
    ],
)
def test_completion_knows_commands_that_are_not_loaded(words: str, found: str) -> None:
    ask = {"_BGARS_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": str(len(words.split()) - 1)}
    command = "import sys; sys.argv = ['bgars']; from bgars.cli import main; main()"
    run = subprocess.run(
        [sys.executable, "-c", command], capture_output=True, text=True, env=os.environ | ask, check=False
    )
    assert run.stdout.split() == [found]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["reconstruct"], "FOLDER"),
        (["reconstruct", "nowhere", "-o", "out"], "nowhere: no such folder"),
        (["reconstruct", "nowhere", "-o", "out", "--method", "magic"], "magic"),
        (["mesh", "nowhere.tif", "-o", "out.ply"], "nowhere.tif"),
        (["mesh", "h.tif", "-o", "out.ply", "--method", "bilateral"], "h.tif is a height map, which is not integrated"),
        (
            ["mesh", "n.png", "-o", "out.ply", "--k", 2],
            "--k: only --method bilateral has it, got --method least-squares",
        ),
        (["mesh", "n.png", "-o", "out.ply", "--solver", "best"], "best"),
        (["evaluate", "nowhere"], "nowhere"),
        (["inspect", "nowhere", "-o", "out"], "nowhere: no such folder"),
        (["inspect", "nowhere", "-o", "out", "--recipe", "none.toml"], "none.toml: no such file"),
        (["report", "nowhere"], "nowhere: cannot be read"),
        (["grr", "nowhere", "-o", "out"], "nowhere: no such folder"),
        (["spc", "nowhere", "-o", "out"], "nowhere: no such file or folder"),
        (["nonsense"], "nonsense"),
    ],
)
def test_wrong_use_is_exit_code_2(tmp_path: Path, arguments: list[str], words: str) -> None:
    run = bgars_command(*arguments, cwd=tmp_path)
    assert run.returncode == 2, run.stdout
    assert words in run.stderr
    assert "Traceback" not in run.stderr
    assert list(tmp_path.iterdir()) == [], "nothing is left behind"


@pytest.mark.parametrize("arguments", [[], ["--threads", 4]])
def test_no_command_is_answered_with_the_help(tmp_path: Path, arguments: list[Any]) -> None:
    run = bgars_command(*arguments, cwd=tmp_path)
    assert run.returncode == 2
    assert "bgars demo" in run.stdout


def test_a_process_ends_in_the_same_code_and_words(tmp_path: Path) -> None:
    run = bgars_process("reconstruct", "nowhere", "-o", "out", cwd=tmp_path)
    assert (run.returncode, run.stdout, run.stderr) == (2, "", "error: nowhere: no such folder\n")


def test_inspect_draws_on_a_process_of_its_own(tmp_path: Path) -> None:
    run = bgars_process("inspect", bgars.sample_capture(), "-o", tmp_path / "out", "--json")
    assert run.returncode == 1, run.stderr
    assert run.stderr == ""
    assert set(json.loads(run.stdout)["output"]) == {path.name for path in (tmp_path / "out").iterdir()}


def test_an_output_that_cannot_be_written_fails_before_the_work(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine", encoding="utf-8")
    run = bgars_command("reconstruct", bgars.sample_capture(), "-o", tmp_path / "file")
    assert run.returncode == 2
    assert "is a file, not a folder" in run.stderr
    assert (tmp_path / "file").read_text(encoding="utf-8") == "mine"


def test_without_truth_evaluate_says_what_it_expected(capture_folder: Path) -> None:
    run = bgars_command("evaluate", capture_folder)
    assert run.returncode == 2
    assert "gt.npz" in run.stderr


ESTIMATE_FOR_LONG = """
import signal, numpy as np, bgars
signal.signal(signal.SIGINT, signal.default_int_handler)  # a parent in the background may have it ignored
stack = np.random.default_rng(0).integers(0, 255, (24, 3000, 3000), dtype=np.uint8)
print("ready", flush=True)
bgars.estimate_normals(stack, bgars.LightRig.ring(24).directions)
"""


def test_ctrl_c_stops_long_work() -> None:
    process = subprocess.Popen(
        [sys.executable, "-c", ESTIMATE_FOR_LONG], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    time.sleep(0.5)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=120)
    assert process.returncode != 0
    assert "KeyboardInterrupt" in errors


INTERRUPTED_START = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)
class Interrupt:
    def find_spec(self, name, *_):
        if name == "bgars.cli.console":
            signal.raise_signal(signal.SIGINT)
sys.meta_path.insert(0, Interrupt())
from bgars.cli import main
main()
"""


def test_ctrl_c_while_modules_are_loaded_is_silent() -> None:
    run = subprocess.run([sys.executable, "-c", INTERRUPTED_START], capture_output=True, text=True, check=False)
    assert (run.returncode, run.stdout, run.stderr) == (130, "", "")
