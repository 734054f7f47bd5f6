"""Help texts are whole on a terminal of 80 columns, and a wrong word on the command line is answered by its name."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bgars
import pytest
import typer
from bgars.cli import init
from bgars.cli.app import app
from test_cli import bgars_command


def commands(path: tuple[str, ...], command: Any) -> list[tuple[str, ...]]:  # noqa: ANN401
    loaded = command.load() if hasattr(command, "load") else command
    below = getattr(loaded, "commands", {})
    return [path, *(found for name, each in below.items() for found in commands((*path, name), each))]


@pytest.mark.parametrize("path", commands((), typer.main.get_command(app)), ids=" ".join)
def test_no_word_of_a_help_text_is_cut_off(path: tuple[str, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    run = bgars_command(*path, "--help")
    assert "Usage" in run.stdout
    assert "<bool>" not in run.stdout, "flags take no value"
    assert [line for line in run.stdout.splitlines() if "\N{HORIZONTAL ELLIPSIS}" in line] == []


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("demo --parts 5 -o out", "--parts: goes with 'bgars demo line' only"),
        ("demo --no-open -o out", "--no-open: goes with 'bgars demo line' only"),
        ("demo line --parts 2 -o out", "greater than or equal to 4; got '2'"),
        ("demo lines", "'lines' is not one of 'ball', 'line'"),
        ("--threads x info folder", "got 'x'"),
        ("init folder --ring a,b", "--ring: must be COUNT,ELEVATION or COUNT,ELEVATION,AZIMUTH0, got 'a,b'"),
        ("init folder --ring 8,45 --pixel-pitch-um -1", "pixel_pitch_um: Input should be greater than 0, got -1.0"),
        ("teach folder -o folder", "folder: is a folder; name a file, such as folder/part.toml"),
        ("batch folder -o file.txt", "file.txt: must be a store, an empty folder, or a new name; it is a file"),
        ("batch folder -o out --send-images", "--send-images: goes with --scheduler"),
        ("watch file.txt -o out --count 8", "file.txt: is not a folder"),
        ("simulate one-bal -o out", "did you mean one-ball?"),
        ("capture folder:CAPTURE --lights 9 -o out", "holds 8 images, got 8"),
    ],
)
def test_a_wrong_word_is_named_and_nothing_is_written(
    words: str, told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    (tmp_path / "folder").mkdir()
    (tmp_path / "file.txt").write_text("text", encoding="utf-8")
    run = bgars_command(*words.replace("CAPTURE", str(bgars.sample_capture())).split(), cwd=tmp_path)
    assert run.returncode == 2, run.stdout
    assert told in run.stderr
    assert "Value error" not in run.stderr
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["file.txt", "folder"]


def test_a_bridged_part_teaches_no_recipe(tmp_path: Path) -> None:
    scene = bgars.Scene.ball_array(3, 3, bridges=[bgars.Bridge("C2", "C3", radius_um=100.0)])
    rig, material = bgars.LightRig.ring(8), bgars.Material(i_d=0.3, i_s=1.0, hardness=40)
    bgars.write_simulation(*bgars.simulate(scene, rig, material, bgars.Camera()), tmp_path / "golden")
    run = bgars_command("teach", tmp_path / "golden", "-o", tmp_path / "part.toml")
    assert run.returncode == 2
    assert "golden: bridged balls: C2, C3; a golden part has none" in run.stderr
    assert not (tmp_path / "part.toml").exists()


@pytest.mark.parametrize(("ended_by", "code"), [(EOFError, 2), (KeyboardInterrupt, 130)])
def test_questions_without_an_answer_write_nothing(
    ended_by: type[BaseException], code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def asked(*_: object, **__: object) -> str:
        try:
            raise ended_by
        except (EOFError, KeyboardInterrupt):
            raise typer.Abort from None

    monkeypatch.setattr(init.sys.stdin, "isatty", lambda: True)
    monkeypatch.setattr(init.typer, "prompt", asked)
    run = bgars_command("init", tmp_path)
    assert run.returncode == code
    assert list(tmp_path.iterdir()) == []
    assert "Aborted" not in run.stdout + run.stderr
