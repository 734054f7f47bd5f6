"""Shared fixtures: where the data is, and captures small enough to break."""

from __future__ import annotations

import os
from pathlib import Path

import bgars
import imageio.v3 as iio
import numpy as np
import pytest


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """What takes minutes goes first: begun last, it would run alone beside workers without work."""
    items.sort(key=lambda item: item.get_closest_marker("slow") is None)


@pytest.fixture(scope="session")
def data_folder() -> Path:
    folder = os.environ.get("BGARS_DATA")
    if not folder:
        pytest.skip("BGARS_DATA is not set: scenes and photographs are not at hand")
    return Path(folder)


@pytest.fixture
def capture_folder(tmp_path: Path) -> Path:
    """A folder with four 8-bit images of 6 x 5 pixels and a recipe with a ring of four lights."""
    folder = tmp_path / "part"
    folder.mkdir()
    normal = np.array([0.1, 0.2, 1.0]) / np.linalg.norm([0.1, 0.2, 1.0])
    for index, direction in enumerate(bgars.LightRig.ring(4).directions):
        level = int(np.rint(200 * direction @ normal))
        iio.imwrite(folder / f"img{index}.png", np.full((5, 6), level, np.uint8))
    write_recipe(folder, "pixel_pitch_um = 10.0\n[lights]\nring = { count = 4, elevation_deg = 45.0 }\n")
    return folder


def write_recipe(folder: Path, text: str) -> None:
    (folder / "capture.toml").write_text(text, encoding="utf-8")
