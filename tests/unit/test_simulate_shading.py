"""The reflectance equation, against plain arithmetic one pixel at a time."""

from __future__ import annotations

import math
from typing import Any

import bgars
import numpy as np
import pytest

CAMERA = bgars.Camera(pixel_pitch_um=20.0, bit_depth=16)
RIG = bgars.LightRig.ring(8)


def signal_of(
    scene: bgars.Scene,
    material: bgars.Material,
    rig: bgars.LightRig = RIG,
    **camera: Any,  # noqa: ANN401 - arguments of a Camera
) -> np.ndarray:
    capture, _ = bgars.simulate(scene, rig, material, bgars.Camera(pixel_pitch_um=20.0, bit_depth=16, **camera))
    return capture.images / 65535.0


def by_hand(material: bgars.Material, normal: np.ndarray, light: np.ndarray) -> float:
    """The signal of one facet, spelled out."""
    n_l, n_v = float(normal @ light), float(normal[2])
    if n_l <= 0:
        return 0.0
    half = light + np.array([0.0, 0.0, 1.0])
    half = half / np.linalg.norm(half)
    n_h, v_h = float(normal @ half), float(half[2])
    angle = math.acos(min(n_h, 1.0))
    total = material.i_d * n_l
    for lobe in material.lobes:
        m = lobe.roughness
        if lobe.distribution == "beckmann":
            d = math.exp(-((math.tan(angle) / m) ** 2)) / math.cos(angle) ** 4
        elif lobe.distribution == "gaussian":
            d = math.exp(-((angle / m) ** 2))
        else:
            d = m**4 / (math.cos(angle) ** 4 * (m**2 + math.tan(angle) ** 2) ** 2)
        g = min(1.0, 2 * n_h * n_v / v_h, 2 * n_h * n_l / v_h) if material.masking == "cook-torrance" else 1.0
        f = 1.0
        if material.fresnel == "schlick":
            f = (material.f0 + (1 - material.f0) * (1 - v_h) ** 5) / material.f0
        total += lobe.i_s * d * g * f / n_v
    return total


@pytest.mark.parametrize(
    "material",
    [
        bgars.Material(i_d=0.3, i_s=0.3, hardness=40),
        bgars.Material(i_d=0.3, i_s=0.3, hardness=10, distribution="gaussian"),
        bgars.Material(i_d=0.3, i_s=0.3, roughness=0.3, distribution="ggx", fresnel="schlick", f0=0.5),
        bgars.Material(i_d=0.1, i_s=0.2, roughness=0.4, masking="none"),
        bgars.Material(i_d=0.1, i_s=0.2, roughness=0.1, second_lobe=bgars.Lobe(0.1, 0.5, "ggx")),
    ],
    ids=["beckmann", "gaussian", "ggx", "no masking", "two lobes"],
)
def test_the_equation(material: bgars.Material) -> None:
    capture, truth = bgars.simulate(bgars.Scene.hemisphere(600.0), RIG, material, CAMERA)
    rows, cols = np.nonzero(truth.ball_ids == 1)
    for row, col in list(zip(rows, cols, strict=True))[::37]:
        for light in (0, 3):
            expected = by_hand(material, truth.normals[row, col].astype(np.float64), RIG.directions[light])
            code = min(round(expected * 65535.0), 65535)
            # float32 normals of the truth cost a level of 65535 near the rim
            assert abs(int(capture.images[light, row, col]) - code) <= 2 + 3e-5 * code


def test_the_peak_of_a_lobe_is_i_s() -> None:
    """A facet halfway between light and camera: D / D_0 = 1, G = 1, and N.V = cos 22.5 degrees."""
    tilt_deg = 22.5
    rig = bgars.LightRig.from_angles([[0, 45], [120, 80], [240, 80]])
    for distribution in ("beckmann", "gaussian", "ggx"):
        shiny = bgars.Material(i_d=0.0, i_s=0.4, hardness=40, distribution=distribution)  # type: ignore[arg-type]
        board = bgars.Board(material=shiny, tilt_x_deg=-tilt_deg)
        signal = signal_of(bgars.Scene.plane(board=board), shiny, rig)
        assert signal[0] == pytest.approx(0.4 / math.cos(math.radians(tilt_deg)), abs=1e-4)


def test_a_matte_plane_reads_i_d_n_l_exactly() -> None:
    board = bgars.Board(material=bgars.Material.matte(0.4))
    rig = bgars.LightRig.ring(8, elevation_deg=30.0, intensities=[1, 0.9, 1.1, 1, 1, 1.2, 0.8, 1])
    capture, _ = bgars.simulate(bgars.Scene.plane(board=board), rig, bgars.Material(), bgars.Camera())
    for light, intensity in enumerate(rig.intensities):
        assert (capture.images[light] == round(255 * 0.4 * 0.5 * intensity)).all()


def test_bit_depths_scale_with_full_scale() -> None:
    scene, material = bgars.Scene.hemisphere(600.0), bgars.Material(i_d=0.4, i_s=1.0)
    eight = bgars.simulate(scene, RIG, material, bgars.Camera(bit_depth=8))[0]
    sixteen = bgars.simulate(scene, RIG, material, bgars.Camera(bit_depth=16))[0]
    assert eight.images.dtype == np.uint8
    assert sixteen.images.dtype == np.uint16
    assert np.abs(eight.images - sixteen.images / 257.0).max() <= 0.5 + 0.5 / 257
    for bits in (10, 12):
        capture = bgars.simulate(scene, RIG, material, bgars.Camera(bit_depth=bits))[0]  # type: ignore[arg-type]
        assert len(np.unique(capture.images)) <= 2**bits
        assert capture.images.max() == 65535
        step = 65535 / (2**bits - 1)
        assert np.abs(capture.images - sixteen.images.astype(float)).max() <= step / 2 + 1


def test_near_lights_fall_off_with_the_square() -> None:
    board = bgars.Board(material=bgars.Material.matte(0.5))
    places = [[3000.0, 0.0, 4000.0], [0.0, 3000.0, 4000.0], [-3000.0, 0.0, 4000.0]]
    rig = bgars.LightRig.from_positions(places, intensity_distance_um=5000.0)
    shape = (101, 101)
    signal = signal_of(bgars.Scene.plane(board=board), bgars.Material(), rig, shape=shape)
    row, col = np.indices(shape)
    x, y = (col + 0.5 - 50.5) * 20.0, (50.5 - row - 0.5) * 20.0
    for light, (px, py, pz) in enumerate(places):
        distance = np.sqrt((px - x) ** 2 + (py - y) ** 2 + pz**2)
        np.testing.assert_allclose(signal[light], 0.5 * pz / distance * (5000.0 / distance) ** 2, atol=1e-5)


def test_a_far_point_light_is_a_distant_light() -> None:
    scene, material = bgars.Scene.ball(600.0, x_um=3.3, y_um=1.7), bgars.Material(i_d=0.4, i_s=0.3)
    near = bgars.LightRig.from_positions(RIG.directions * 1e9)
    np.testing.assert_allclose(signal_of(scene, material, near), signal_of(scene, material), atol=3e-5)


def test_light_is_never_made_from_nothing() -> None:
    scene = bgars.Scene.ball_array(2, 2)
    capture, truth = bgars.simulate(scene, RIG, bgars.Material(i_d=1.0, i_s=5.0), bgars.Camera(black_level=7.0))
    assert (capture.images[~truth.lit] == 7).all(), "a pixel without light reads the black level"
    assert capture.images.max() == 255, "clipped at full scale"
    dull = bgars.simulate(scene, RIG, bgars.Material(i_d=0.5, i_s=0.0), bgars.Camera(bit_depth=16))[0].images
    shiny = bgars.simulate(scene, RIG, bgars.Material(i_d=0.5, i_s=0.5), bgars.Camera(bit_depth=16))[0].images
    assert (shiny >= dull).all(), "a lobe only adds"


def test_masking_only_takes_away_and_spares_facets_that_see_both() -> None:
    scene = bgars.Scene.hemisphere(600.0)
    images = {
        name: signal_of(scene, bgars.Material(i_d=0.0, i_s=0.3, roughness=0.5, masking=name))  # type: ignore[arg-type]
        for name in ("none", "cook-torrance", "smith")
    }
    _, truth = bgars.simulate(scene, RIG, bgars.Material(), CAMERA)
    for name in ("cook-torrance", "smith"):
        assert (images[name] <= images["none"]).all()
        assert (images["none"] - images[name]).max() > 0.002
    facing = (truth.normals @ RIG.directions[0].astype(np.float32) > 0.7) & (truth.normals[..., 2] > 0.7)
    np.testing.assert_array_equal(images["cook-torrance"][0][facing], images["none"][0][facing])


def test_each_ball_has_its_own_material() -> None:
    varied = bgars.Material(i_d=0.5, i_s=0.0, variation=bgars.Variation(i_d=0.1))
    scene = bgars.Scene.ball_array(4, 4)
    capture, truth = bgars.simulate(scene, RIG, varied, CAMERA, seed=9)
    albedos = np.array([ball.i_d for ball in truth.balls])
    assert 0.02 < albedos.std() / 0.5 < 0.2
    assert np.abs(albedos / 0.5 - 1).max() <= 0.25
    for number, albedo in enumerate(albedos, start=1):
        lit = (truth.ball_ids == number) & truth.lit[0]
        ratio = capture.images[0][lit] / 65535.0 / (truth.normals[lit] @ RIG.directions[0])
        assert np.median(ratio) == pytest.approx(albedo, rel=1e-3)
    fewer = bgars.simulate(bgars.Scene(scene.balls[:7]), RIG, varied, CAMERA, seed=9)[1]
    assert [ball.i_d for ball in fewer.balls] == list(albedos[:7]), "other balls do not change a ball"


def test_texture_stays_within_its_contrast_and_belongs_to_the_place() -> None:
    board = bgars.Board(material=bgars.Material.matte(0.5), texture=bgars.Texture(contrast=0.3, scale_um=300.0))
    scene = bgars.Scene.plane(board=board, size_um=(4000.0, 4000.0))
    coarse = signal_of(scene, bgars.Material())[0] / (0.5 * RIG.directions[0, 2])
    assert 0.7 <= coarse.min() < 0.85
    assert 1.15 < coarse.max() <= 1.3
    fine = bgars.simulate(scene, RIG, bgars.Material(), bgars.Camera(pixel_pitch_um=20.0 / 3, bit_depth=16))[0]
    np.testing.assert_allclose(fine.images[0, 1::3, 1::3] / 65535.0 / (0.5 * RIG.directions[0, 2]), coarse, atol=1e-4)


def test_an_albedo_map_multiplies_the_board() -> None:
    albedo_map = np.linspace(0.5, 1.5, 30 * 40).reshape(30, 40)
    board = bgars.Board(material=bgars.Material.matte(0.4), albedo_map=albedo_map)
    signal = signal_of(bgars.Scene.plane(board=board), bgars.Material(), shape=(30, 40), supersample=2)
    np.testing.assert_allclose(signal[0], 0.4 * albedo_map * RIG.directions[0, 2], atol=1e-5)
