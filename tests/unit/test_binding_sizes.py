"""Arguments of the compiled kernels that nobody means: one exception, and a process that lives on."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from bgars import InputError, _bgars

HUGE = 10**12
CIRCLE = np.array([[10.0, 10.0, 4.0]])
DEPTH = np.array([[1.0, 1.0]])
REFUSED = (InputError, MemoryError)
KERNELS: Any = _bgars
"""Of no type: what is given here fits none."""


def casters(lights: int = 1) -> SimpleNamespace:
    return SimpleNamespace(
        balls=np.array([[0.0, 0.0, 4.0, 5.0, 1.0]]),
        lights=np.array([[0.6, 0.0, 0.8]] * lights),
        near=False,
        board=[0.0] * 5,
    )


@pytest.mark.parametrize("blur_px", [0.3, 0.0])
@pytest.mark.parametrize("reach_px", [float(HUGE), 1e300, float("inf"), float("nan"), -1.0])
def test_profiles_of_no_reach(blur_px: float, reach_px: float) -> None:
    with pytest.raises(REFUSED):
        KERNELS.rim_profiles(blur_px, reach_px, threads=1)


@pytest.mark.parametrize("blur_px", [float("nan"), float("inf"), -0.1, 1e300])
def test_profiles_of_no_blur(blur_px: float) -> None:
    with pytest.raises(InputError, match="blur_px"):
        KERNELS.rim_profiles(blur_px, 9.0, threads=1)


@pytest.mark.parametrize(
    ("circle", "depth", "every", "sectors"),
    [
        (CIRCLE, DEPTH, 1, HUGE),
        (CIRCLE, DEPTH, 1, 0),
        (CIRCLE, DEPTH, 0, 4),
        (CIRCLE * [1.0, 1.0, np.nan], DEPTH, 1, 4),
        (CIRCLE * [1e300, 1.0, 1.0], DEPTH, 1, 4),
        (CIRCLE * [1.0, 1.0, 1e12], DEPTH, 1, 4),
        (CIRCLE, DEPTH * 1e12, 1, 4),
        (CIRCLE, DEPTH * np.inf, 1, 4),
    ],
)
def test_bands_of_no_circle(circle: np.ndarray, depth: np.ndarray, every: int, sectors: int) -> None:
    with pytest.raises(REFUSED):
        KERNELS.rim_bands(circle, depth, every=every, sectors=sectors, threads=1)


@pytest.mark.parametrize("directions", [0, HUGE, 2**63])
def test_rings_of_no_directions(directions: int) -> None:
    images, centres, radii = np.zeros((3, 8, 8), np.float32), np.array([[4.0, 4.0]]), np.array([[1.0, 2.0]])
    with pytest.raises(REFUSED):
        KERNELS.ring_edges(images, centres, radii, directions=directions, rank=1, threads=1)


@pytest.mark.parametrize(
    ("shape", "step"), [((HUGE, HUGE), 1), ((2**40, 2**40), 2), ((2**62, 1), 1), ((64, 64), 0), ((64, 64), HUGE)]
)
def test_maps_of_no_image(shape: tuple[int, int], step: int) -> None:
    with pytest.raises(REFUSED):
        KERNELS.draw_shadows(
            casters(), shape=shape, step=step, silhouette_margin_px=1.0, shadow_margin_px=1.0, threads=1
        )


def test_many_balls_over_one_place_are_counted_no_further_than_a_byte() -> None:
    crowd = casters()
    crowd.balls = np.repeat(crowd.balls, 300, axis=0)
    _, count = KERNELS.draw_shadows(
        crowd, shape=(64, 64), step=1, silhouette_margin_px=1.0, shadow_margin_px=1.0, threads=1
    )
    assert count.max() == 255


def edges(**changes: object) -> None:
    """Measure the edge of one shadow, with something changed."""
    lines = SimpleNamespace(
        spread_px=1.0,
        lamp_spread_rad=[0.0],
        reach_px=[3.0],
        limit=[4.0],
        profiles=np.zeros((3, 1, 4, 2)),
        stride_px=1,
        coarse=False,
    )
    capture = SimpleNamespace(
        images=np.full((3, 16, 16), 9, np.uint8),
        lights=np.array([[0.6, 0.0, 0.8], [0.0, 0.6, 0.8], [-0.6, 0.0, 0.8]]),
        lights_are_positions=False,
        reference_px=[],
        intensities=[1.0] * 3,
        response=None,
        dark=None,
        black_level=0.0,
        saturation=255.0,
        full_scale=255.0,
    )
    given = {
        "angles_rad": [0.0],
        "sectors": 1,
        "gains": np.ones((1, 3), np.float32),
        "step": 1,
        "hidden": np.zeros((16, 16), bool),
        "count": np.zeros((3, 16, 16), np.uint8),
        "mask": None,
        "threads": 1,
    }
    for name, value in changes.items():
        if hasattr(lines, name):
            setattr(lines, name, value)
        else:
            given[name] = value
    KERNELS.measure_edges(capture, casters(3), lines, **given)


@pytest.mark.parametrize(
    "changes",
    [
        {"sectors": HUGE},
        {"sectors": 0},
        {"step": 0},
        {"step": HUGE},
        {"stride_px": HUGE},
        {"reach_px": [1e300]},
        {"reach_px": [float("nan")]},
        {"hidden": np.zeros((3, 3), bool)},
        {"count": np.zeros((3, 2, 16), np.uint8)},
        {"gains": np.ones((1, 2), np.float32)},
        {"mask": np.ones((4, 4), bool)},
    ],
)
def test_edges_of_no_shadow(changes: dict[str, object]) -> None:
    edges()
    with pytest.raises(REFUSED):
        edges(**changes)


def test_files_of_no_gains(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="gains"):
        KERNELS.decode_stack(
            [tmp_path / "a.png"] * 2,
            channel="mean",
            response=None,
            gains=np.ones((1, 3), np.float32),
            max_megapixels=1.0,
            threads=1,
            allocate=np.zeros,
        )
