"""Shiny balls under lights all over a dome: highlights and shadows of low lights are no fault of their images."""

from __future__ import annotations

from dataclasses import replace

import bgars
import numpy as np
import pytest
from scipy.ndimage import shift

NINE = [[-17, 24], [-88, 50], [81, 59], [-76, 39], [-178, 34], [77, 30], [-27, 61], [160, 40], [170, 27]]
EIGHT = [[105, 44], [174, 44], [-153, 69], [-107, 60], [-61, 29], [-37, 66], [8, 67], [91, 37]]
TWELVE = [
    *([175, 36], [-84, 42], [-1, 73], [105, 67], [-179, 66], [-84, 39]),
    *([13, 68], [107, 41], [-174, 51], [-84, 58], [8, 61], [109, 37]),
]


def dome(angles: list[list[int]], grid: tuple[int, int], ball: tuple[float, float], shine: float) -> bgars.Capture:
    """An array of glossy balls, of a diameter and a height in um, on a textured board."""
    board = bgars.Board(material=bgars.Material.matte(0.3), texture=bgars.Texture(0.3, 450.0))
    diameter, height = ball
    scene = bgars.Scene.ball_array(*grid, pitch_um=1000.0, diameter_um=diameter, height_um=height, board=board)
    material = bgars.Material(i_d=0.22, i_s=shine, hardness=50.0)
    camera = bgars.Camera(pixel_pitch_um=10.0, bit_depth=8, supersample=2, blur_px=0.6)
    rig = bgars.LightRig.from_angles(np.array(angles, dtype=np.float64))
    return bgars.simulate(scene, rig, material, camera, seed=1)[0]


def told(capture: bgars.Capture) -> list[tuple[str, int | None]]:
    return [(each.kind, each.image) for each in bgars.check(capture).told]


@pytest.mark.parametrize(
    ("angles", "grid", "ball", "shine"),
    [
        (NINE, (5, 2), (511.0, 333.0), 0.89),
        (EIGHT, (4, 4), (626.0, 321.0), 0.8),
        (TWELVE, (4, 5), (448.0, 243.0), 0.61),
    ],
    ids=["light from the sides of balls", "a low light apart from all others", "highlights towards a low light"],
)
def test_a_low_light_is_no_fault(
    angles: list[list[int]], grid: tuple[int, int], ball: tuple[float, float], shine: float
) -> None:
    assert told(dome(angles, grid, ball, shine)) == []


def test_an_image_that_moved_or_shows_another_light_is_found() -> None:
    good = dome(TWELVE, (3, 3), (450.0, 245.0), 0.6)
    moved = good.images.copy()
    moved[3] = np.rint(shift(moved[3].astype(np.float64), (1.5, -2.0), order=1, mode="nearest")).astype(np.uint8)
    assert told(replace(good, images=moved)) == [("motion", 3)]
    angles = np.array(TWELVE, dtype=np.float64)
    angles[7] = 0.0, 50.0
    assert told(replace(good, rig=bgars.LightRig.from_angles(angles))) == [("order", 7)]
