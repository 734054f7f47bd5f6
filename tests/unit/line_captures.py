"""Captures for tests of the line: copies of the sample, which takes a second to inspect."""

from __future__ import annotations

import shutil
from pathlib import Path

import bgars

FILES = [path for path in Path(bgars.sample_capture()).iterdir() if path.suffix != ".npz"]


def copy_capture(folder: Path) -> Path:
    folder.mkdir(parents=True)
    for path in FILES:
        shutil.copy(path, folder / path.name)
    return folder


def captures(folder: Path, *names: str) -> list[Path]:
    return [copy_capture(folder / name) for name in names]


RECIPE = """
name = "one ball"
rows = 1
cols = 1
pitch_um = 1000.0

[limits]
diameter_um = [500.0, 700.0]
"""
