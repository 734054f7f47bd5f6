"""Images shifted by less than half a pixel: seen by the board's texture, and in the uncertainties."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import bgars
import numpy as np
import pytest
from bgars.inspection.radiance import Radiance
from bgars.inspection.results import MIN_DEPTH, judge_balls
from bgars.inspection.shadow_edges import Edges
from bgars.inspection.texture import texture_shifts
from numpy.typing import NDArray
from scipy import ndimage

if TYPE_CHECKING:
    from bgars.inspection.shadow_map import ShadowMap

LIGHTS, SIDE = 6, 200
MOVES = np.array([[0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.3, -0.15], [-0.5, 0.4]])


def board(contrast: float, *, noise_levels: float = 1.0) -> bgars.Capture:
    """A board under lamps of different strength that fall off across it, some images shifted."""
    random = np.random.default_rng(4)
    texture = ndimage.gaussian_filter(random.normal(size=(SIDE, SIDE)), 1.2)
    texture = 100.0 * (1.0 + contrast * texture / texture.std())
    fall = np.linspace(0.9, 1.1, SIDE)
    images = []
    for light, (x, y) in enumerate(MOVES):
        seen = ndimage.shift(texture, (-y, x), order=5, mode="nearest") * (0.8 + 0.05 * light) * fall[::-1]
        images.append(np.clip(np.rint(seen + random.normal(0.0, noise_levels, seen.shape)), 0, 254))
    return bgars.Capture(np.array(images, np.uint8), bgars.LightRig.ring(LIGHTS), np.ones((SIDE, SIDE), np.bool_))


RING = bgars.LightRig.ring(LIGHTS).directions


def shadows(*, hidden_share: float = 0.0) -> ShadowMap:
    """Nothing but board, except for a strip."""
    hidden = np.zeros((SIDE, SIDE), np.bool_)
    hidden[:, : int(hidden_share * SIDE)] = True
    count = np.zeros((LIGHTS, SIDE, SIDE), np.uint8)
    drawn = SimpleNamespace(step=1, hidden=hidden, count=count, pixels=lambda row, col: row * SIDE + col)
    return cast("ShadowMap", drawn)


@pytest.mark.parametrize("noise_levels", [1.0, 4.0])
def test_shifts_are_seen_by_texture_within_their_uncertainty(noise_levels: float) -> None:
    found = texture_shifts(Radiance(board(0.1, noise_levels=noise_levels)), shadows(), RING, threads=2)
    off = np.abs(found.move_px - MOVES) / found.u_px[:, None]
    assert off.max() < 3.0
    assert found.u_px[:4].max() < 0.02
    assert found.u_px.max() < 0.1


def test_ridges_that_are_brighter_are_no_shift() -> None:
    """Every image of such a board lies as if it had moved away from its lamp."""
    random = np.random.default_rng(5)
    height = ndimage.gaussian_filter(random.normal(size=(SIDE, SIDE)), 3.0)
    height *= 0.1 / height.std()
    slope_up, slope_right = np.gradient(height)
    images = []
    for x, y, z in RING:
        shading = z - x * slope_right + y * slope_up
        images.append(np.clip(np.rint(120.0 * (1.0 + 1.5 * height) * shading), 0, 254))
    capture = bgars.Capture(np.array(images, np.uint8), bgars.LightRig.ring(LIGHTS), np.ones((SIDE, SIDE), np.bool_))
    assert np.isinf(texture_shifts(Radiance(capture), shadows(), RING, threads=2).u_px).all()


@pytest.mark.parametrize(("contrast", "hidden_share"), [(0.0, 0.0), (0.1, 0.95)])
def test_without_texture_or_board_nothing_is_claimed(contrast: float, hidden_share: float) -> None:
    found = texture_shifts(Radiance(board(contrast)), shadows(hidden_share=hidden_share), RING, threads=1)
    size = np.hypot(*found.move_px.T)
    assert (size < 4.0 * found.u_px).all()
    assert found.u_px.min() > 0.1


def test_a_part_that_moved_is_where_it_was_or_where_it_went() -> None:
    """Heights are those of a part that stood still; centres know that nobody can tell which images are right."""
    material = bgars.Material.matte(0.35)
    scene = bgars.Scene.ball_array(
        3,
        3,
        pitch_um=1500.0,
        height_um=460.0,
        board=bgars.Board(material, texture=bgars.Texture(contrast=0.25, scale_um=60.0)),
    )
    camera = bgars.Camera(full_well_e=15000.0, read_noise_levels=0.5, supersample=2)
    rig = bgars.LightRig.ring(8, elevation_deg=45.0)
    still, truth = bgars.simulate(scene, rig, bgars.Material(), camera, seed=7)
    images = still.images.astype(np.float64)
    move = (0.3, -0.2)
    for light in range(5, 8):
        images[light] = ndimage.shift(images[light], (-move[1], move[0]), order=3, mode="nearest")
    moved = replace(still, images=np.clip(np.rint(images), 0, 255).astype(still.images.dtype))
    part = bgars.PartRecipe("moved", bgars.BallLayout(rows=3, cols=3, pitch_um=1500.0))
    before = bgars.inspect(still, part).balls
    with pytest.warns(bgars.CaptureWarning, match="motion: each image from image 5 on is shifted"):
        after = bgars.inspect(moved, part).balls
    pitch_um = truth.setup.camera.pixel_pitch_um
    for one, other, ball in zip(before, after, truth.balls, strict=True):
        assert abs(other.top_um - one.top_um) < 2.0 * other.u_top_um
        for axis, size in zip("xy", move, strict=True):
            u_um = getattr(other, f"u_{axis}_um")
            assert abs(getattr(other, f"{axis}_um") - getattr(ball, f"{axis}_um")) < 2.0 * u_um
            assert u_um > 0.4 * abs(size) * pitch_um > 2.0 * getattr(one, f"u_{axis}_um")


def edges(depth: float) -> Edges:
    """A ball under four lights: shadows that take a share of the board's light, sharply seen."""
    one = np.ones((1, 4, 6))
    parts: dict[str, NDArray[np.float64]] = dict.fromkeys(Edges.__dataclass_fields__, one)
    parts |= {"u_px": 0.02 * one, "low": (1.0 - depth) * one, "contrast_levels": 100.0 * depth * one}
    parts |= {"noise_levels": np.ones((1, 4)), "looked_at": one > 0}
    return Edges(**parts)  # type: ignore[arg-type]


@pytest.mark.parametrize(("depth", "usable"), [(0.95, True), (MIN_DEPTH + 0.1, True), (MIN_DEPTH - 0.1, False)])
def test_what_takes_little_of_the_light_is_no_shadow(depth: float, usable: bool) -> None:
    assert bool(judge_balls(edges(depth)).usable[0]) == usable
