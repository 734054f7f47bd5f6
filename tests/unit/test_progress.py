"""Every ``progress``: refused at once where it cannot be called, and 1 at the end."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import bgars
import numpy as np
import pytest
from bgars.line.camera import FolderCamera, take_capture

IMAGES = np.full((4, 6, 6), 100, np.uint8)
RING = bgars.LightRig.ring(4)
FLAT = np.dstack([np.zeros((4, 4)), np.zeros((4, 4)), np.ones((4, 4))])
SAMPLE = bgars.sample_capture()


def height() -> bgars.HeightMap:
    return bgars.integrate_normals(FLAT, pixel_pitch_um=1.0)


CALLS: dict[str, Callable[[object], object]] = {
    "estimate_normals": lambda given: bgars.estimate_normals(IMAGES, RING.directions, progress=given),
    "integrate_normals": lambda given: bgars.integrate_normals(FLAT, progress=given),
    "find_balls": lambda given: bgars.find_balls(bgars.read_capture(SAMPLE), progress=given),
    "reconstruct": lambda given: bgars.reconstruct(bgars.read_capture(SAMPLE), progress=given),
    "inspect": lambda given: bgars.inspect(bgars.read_capture(SAMPLE), progress=given),
    "evaluate": lambda given: bgars.evaluate(bgars.read_capture(SAMPLE), progress=given),
    "simplified_mesh": lambda given: bgars.simplified_mesh(height(), max_error_um=1.0, progress=given),
    "calibrate_lights": lambda given: bgars.calibrate_lights(bgars.read_capture(SAMPLE), sphere="matt", progress=given),
    "calibrate_material": lambda given: bgars.calibrate_material(bgars.read_capture(SAMPLE), progress=given),
    "simulate": lambda given: bgars.simulate(
        bgars.Scene.hemisphere(900.0), RING, bgars.Material(), bgars.Camera(pixel_pitch_um=10.0), progress=given
    ),
    "inspect_many": lambda given: bgars.inspect_many([SAMPLE], progress=given),
    "read_study": lambda given: bgars.read_study("none", progress=given),
    "take_capture": lambda given: take_capture(FolderCamera(SAMPLE), "none", lights=8, progress=given),
}


@pytest.mark.parametrize("name", CALLS)
@pytest.mark.parametrize("given", [True, "x"])
def test_what_cannot_be_called_is_refused_before_the_work(name: str, given: object) -> None:
    with pytest.raises(bgars.InputError, match=rf"^progress: must be callable, got {given!r}$"):
        CALLS[name](given)
    assert not Path("none").exists()


@pytest.mark.parametrize("method", ["lambertian", "robust-filter", "blind", "reflectance"])
def test_normals_end_at_1_however_short_the_work(method: str) -> None:
    seen: list[float] = []
    bgars.estimate_normals(bgars.read_capture(SAMPLE), method=method, progress=seen.append)
    assert seen == sorted(seen)
    assert seen[-1] == 1.0
