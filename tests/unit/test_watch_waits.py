"""What a watch waits for, and says: files of the line that are away, loose images; the same keys in every line."""

from __future__ import annotations

import json
import re
import time
from dataclasses import replace
from pathlib import Path

import bgars
import numpy as np
import pytest
from bgars.io.provenance import capture_files, checksums
from bgars.line import inbox as inbox_module
from bgars.line import job
from bgars.line.inbox import Inbox
from bgars.line.notify import Notifier
from bgars.line.watch import Watch
from killed_watch import RIG, drop
from line_captures import RECIPE
from stored_parts import part


def instant(capture: bgars.Capture, recipe: bgars.PartRecipe, **_: object) -> bgars.PartResult:
    files = checksums((*capture_files(capture), recipe.file))
    return replace(part(0), capture=capture.name, method="reflectance", files=files)


@pytest.fixture
def inbox(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(job, "inspected", instant)
    folder = tmp_path / "in"
    folder.mkdir()
    response = bgars.ResponseCurve(np.array([0.0, 1.0]), np.array([0.0, 1.0]), 0.0)
    bgars.write_station(bgars.Station("line 8", response=response), tmp_path / "st8.toml")
    (tmp_path / "rig.toml").write_text(f'station = "{(tmp_path / "st8.toml").as_posix()}"\n{RIG}', encoding="utf-8")
    (tmp_path / "part.toml").write_text(RECIPE, encoding="utf-8")
    return folder


def watch(inbox: Path, told: list[str], *, files: str = "", **options: object) -> Watch:
    return Watch(
        Inbox(inbox, count=4, trigger="" if files else "ready", settle_s=0.0, files=files),
        bgars.open_store(inbox.parent / "store", create=True),
        recipe=inbox.parent / "part.toml",
        rig=inbox.parent / "rig.toml",
        done=inbox / "_done",
        failed=inbox / "_failed",
        say=told.append,
        **options,
    )


def complete(inbox: Path, name: str, seed: int) -> None:
    drop(inbox, name, seed)
    (inbox / name / "ready").touch()


@pytest.mark.parametrize("name", ["part.toml", "rig.toml", "st8.toml"])
def test_a_file_of_the_line_that_is_away_for_a_while_fails_no_part(inbox: Path, name: str) -> None:
    """With a trigger a part that cannot be inspected is moved away at once: not where the line is at fault."""
    told: list[str] = []
    made = watch(inbox, told)
    away = (inbox.parent / name).rename(inbox.parent / "away")
    complete(inbox, "P1", 1)
    for _ in range(3):
        assert not made.step()
    assert len(told) == 1, "said once"
    assert re.search(rf"{name}: .*; P1 stays in the inbox, tried again$", told[0])
    assert (inbox / "P1").is_dir()
    away.rename(inbox.parent / name)
    assert made.step()
    assert "verdict=pass" in told[-1]


def test_a_station_that_only_the_part_names_is_a_fault_of_the_part(inbox: Path) -> None:
    told: list[str] = []
    made = watch(inbox, told)
    complete(inbox, "P1", 1)
    (inbox / "P1" / "capture.toml").write_text(f'station = "none.toml"\n{RIG}', encoding="utf-8")
    assert made.step()
    assert "none.toml" in told[0]
    assert list(inbox.glob("_failed/*/P1"))


def test_every_line_has_the_same_keys_and_a_time(inbox: Path) -> None:
    told: list[str] = []
    made = watch(inbox, told, notifier=Notifier(line_file=str(inbox.parent / "line")))
    lines = []
    for name, seed, is_cut in (("P1", 1, False), ("P1", 1, False), ("P 2", 2, True)):
        complete(inbox, name, seed)
        if is_cut:
            image = inbox / name / "img3.png"
            image.write_bytes(image.read_bytes()[:40])
        assert made.step()
        lines.append((inbox.parent / "line").read_text(encoding="utf-8").rstrip("\n"))
        assert told[-1].startswith(f"{lines[-1]} seconds=")
    good, again, failed = (re.findall(r'(\w+)=("(?:[^"\\]|\\.)*"|\S*)', line) for line in lines)
    assert [key for key, _ in good] == [key for key, _ in again] == [key for key, _ in failed]
    for pairs in (good, again, failed):
        assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ", dict(pairs)["time"])
    assert dict(again)["round"] == "1"
    told_of = dict(failed)
    assert [told_of[key] for key in ("serial", "verdict", "balls", "round")] == ['"P 2"', "error", "null", "null"]
    assert "img3.png" in json.loads(told_of["reason"])


def test_images_beside_the_folders_of_parts_are_spoken_of_once(inbox: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(inbox_module, "LOOSE_S", 0.1)
    told: list[str] = []
    made = watch(inbox, told)
    drop(inbox, "P1", 1)
    for path in list((inbox / "P1").iterdir()):
        path.rename(inbox / f"SN7_{path.name}")
    (inbox / "P1").rmdir()
    made.step()
    assert not told, "they may be under way into a folder"
    for _ in range(3):
        time.sleep(0.11)
        made.step()
    (line,) = told
    assert line.startswith(f"{inbox}: 4 images not in the folder of a part, such as SN7_img0.png: waiting for a folder")
    assert "--files '{serial}_{image}.png'" in line
    (inbox / "SN7_img3.png").unlink()
    short = watch(inbox, told := [], files="{serial}_{image}.png", patience_s=0.1)
    for _ in range(3):
        short.step()
        time.sleep(0.11)
    assert told == [
        f"{inbox}: 3 images not in the folder of a part, such as SN7_img0.png: waiting for --count 4 images of one "
        "serial number whose names follow --files"
    ]


def test_images_whose_names_fit_in_two_ways_are_mixed_into_no_part(
    inbox: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(inbox_module, "LOOSE_S", 0.0)
    for part_name, lights in (("L7_A", range(4)), ("L7_B", range(4, 8))):
        drop(inbox, part_name, 1)
        for light, path in zip(lights, sorted((inbox / part_name).glob("*.png")), strict=True):
            path.rename(inbox / f"{part_name}_{light}.png")
        (inbox / part_name).rmdir()
    look = Inbox(inbox, count=4, trigger="", settle_s=0.0, files="{serial}_{image}.png")
    assert (look.look(), look.flat.gather()) == ([], [])
    assert "L7_A_0.png: fits --files in more than one way (serial number L7 or L7_A); use {number}" in look.loose(60.0)
    clear = Inbox(inbox, count=4, trigger="", settle_s=0.0, files="{serial}_{number}.png")
    assert [found.folder.name for found in clear.look()] == ["L7_A", "L7_B"]


def test_images_of_a_serial_number_that_would_be_a_hidden_folder_stay_and_are_spoken_of(
    inbox: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(inbox_module, "LOOSE_S", 0.0)
    drop(inbox, "P1", 1)
    for path in list((inbox / "P1").glob("*.png")):
        path.rename(inbox / f"_7-{path.name}")
    (inbox / "P1").rmdir()
    look = Inbox(inbox, count=4, trigger="", settle_s=0.0, files="{serial}-{image}.png")
    assert look.look() == []
    assert len(list(inbox.glob("_7-*.png"))) == 4
    assert "4 images not taken, such as _7-img0.png: serial number _7: begins with _" in look.loose(60.0)
