"""Reading captures of every described kind."""

from __future__ import annotations

import math
from pathlib import Path

import bgars
import imageio.v3 as iio
import numpy as np
import pytest

RING = "[lights]\nring = { count = 4, elevation_deg = 45.0 }\n"


def recipe(folder: Path, text: str) -> None:
    (folder / "capture.toml").write_text(text, encoding="utf-8")


def test_recipe_with_a_ring(capture_folder: Path) -> None:
    capture = bgars.read_capture(capture_folder)
    assert capture.images.shape == (4, 5, 6)
    assert capture.images.dtype == np.uint8
    assert capture.pixel_pitch_um == 10.0
    assert capture.saturation == 255.0
    assert [path.name for path in capture.files] == ["img0.png", "img1.png", "img2.png", "img3.png"]
    np.testing.assert_allclose(capture.rig.azimuths_deg, [0, 90, 180, 270], atol=1e-9)


def test_images_sort_naturally(capture_folder: Path) -> None:
    (capture_folder / "img3.png").rename(capture_folder / "img10.png")
    names = [path.name for path in bgars.read_capture(capture_folder).files]
    assert names == ["img0.png", "img1.png", "img2.png", "img10.png"]


@pytest.mark.parametrize(
    "lights",
    [
        "angles_deg = [[0, 45], [90, 45], [180, 45], [270, 45]]",
        "directions = [[0.70710678, 0, 0.70710678], [0, 0.70710678, 0.70710678], "
        "[-0.70710678, 0, 0.70710678], [0, -0.70710678, 0.70710678]]",
        'directions = "d.txt"',
        'lp = "l.lp"',
    ],
)
def test_every_way_to_give_distant_lights(capture_folder: Path, lights: str) -> None:
    directions = bgars.LightRig.ring(4).directions
    np.savetxt(capture_folder / "d.txt", directions, fmt="%.9f")
    # The .lp names the images in another order; they are paired by name.
    lines = [f"img{index}.png " + " ".join(f"{v * 3:.9f}" for v in directions[index]) for index in (2, 0, 3, 1)]
    (capture_folder / "l.lp").write_text("4\n" + "\n".join(lines) + "\n", encoding="utf-8")
    images = 'images = ["img0.png", "img1.png", "img2.png", "img3.png"]\n'
    recipe(capture_folder, f"{images}[lights]\n{lights}\n")
    np.testing.assert_allclose(bgars.read_capture(capture_folder).rig.directions, directions, atol=1e-7)


def test_lp_alone_gives_lights_and_image_order(capture_folder: Path) -> None:
    (capture_folder / "capture.toml").unlink()
    directions = bgars.LightRig.ring(4).directions
    lines = [f"img{index}.png " + " ".join(map(str, directions[index])) for index in (2, 0, 3, 1)]
    (capture_folder / "rti.lp").write_text("4\n" + "\n".join(lines) + "\n", encoding="utf-8")
    capture = bgars.read_capture(capture_folder)
    assert [path.name for path in capture.files] == ["img2.png", "img0.png", "img3.png", "img1.png"]
    np.testing.assert_allclose(capture.rig.directions[1], directions[0], atol=1e-12)


def test_diligent_layout_with_mask_and_intensities(capture_folder: Path) -> None:
    (capture_folder / "capture.toml").unlink()
    np.savetxt(capture_folder / "light_directions.txt", bgars.LightRig.ring(4).directions)
    np.savetxt(capture_folder / "light_intensities.txt", [[1, 1, 1], [2, 2, 2], [1, 1, 1], [0.5, 0.5, 0.5]])
    names = ["img3.png", "img2.png", "img1.png", "img0.png"]
    (capture_folder / "filenames.txt").write_text("\n".join(names) + "\n", encoding="utf-8")
    mask = np.zeros((5, 6), np.uint8)
    mask[1:3] = 255
    iio.imwrite(capture_folder / "mask.png", mask)
    capture = bgars.read_capture(capture_folder)
    assert [path.name for path in capture.files] == names
    np.testing.assert_array_equal(capture.rig.intensities, [1, 2, 1, 0.5])
    np.testing.assert_array_equal(capture.mask, mask > 0)


def test_a_subset_of_images_brings_its_own_lights(capture_folder: Path) -> None:
    capture = bgars.read_capture(capture_folder, images=["img3.png", "img0.png", "img1.png"])
    np.testing.assert_allclose(capture.rig.azimuths_deg, [270, 0, 90], atol=1e-9)


@pytest.mark.parametrize("text", ["0.05", "[0.05, 0.05, 0.05, 0.05]"])
def test_the_uncertainty_of_the_lights_goes_with_them(capture_folder: Path, text: str) -> None:
    recipe(capture_folder, f"{RING}u_deg = {text}\n")
    np.testing.assert_array_equal(bgars.read_capture(capture_folder).rig.u_deg, [0.05] * 4)
    recipe(capture_folder, RING + "u_deg = [0.1, 0.2, 0.3, 0.4]\n")
    rig = bgars.read_capture(capture_folder, images=["img3.png", "img0.png", "img1.png"]).rig
    np.testing.assert_array_equal(rig.u_deg, [0.4, 0.1, 0.2])
    recipe(capture_folder, RING)
    assert bgars.read_capture(capture_folder).rig.u_deg is None


def test_the_uncertainties_follow_an_lp_file_that_names_the_images_in_another_order(capture_folder: Path) -> None:
    directions = bgars.LightRig.ring(4).directions
    lines = [f"img{index}.png " + " ".join(map(str, directions[index])) for index in (2, 0, 3, 1)]
    (capture_folder / "l.lp").write_text("4\n" + "\n".join(lines) + "\n", encoding="utf-8")
    images = 'images = ["img0.png", "img1.png", "img2.png", "img3.png"]\n'
    recipe(capture_folder, images + '[lights]\nlp = "l.lp"\nu_deg = [0.3, 0.1, 0.4, 0.2]\n')
    np.testing.assert_array_equal(bgars.read_capture(capture_folder).rig.u_deg, [0.1, 0.2, 0.3, 0.4])


def test_every_rig_takes_one_uncertainty_or_one_a_light(tmp_path: Path) -> None:
    ring = bgars.LightRig.ring(3)
    lines = [f"{index}.png " + " ".join(map(str, vector)) for index, vector in enumerate(ring.directions)]
    (tmp_path / "l.lp").write_text("3\n" + "\n".join(lines) + "\n", encoding="utf-8")
    for u_deg in (0.5, [0.5, 0.5, 0.5], np.float32(0.5)):
        for rig in (
            bgars.LightRig.ring(3, u_deg=u_deg),
            bgars.LightRig.from_angles([[0, 45], [120, 45], [240, 45]], u_deg=u_deg),
            bgars.LightRig.from_directions(ring.directions, u_deg=u_deg),
            bgars.LightRig.from_positions(ring.directions * 40_000.0, u_deg=u_deg),
            bgars.LightRig.from_lp(tmp_path / "l.lp", u_deg=u_deg),
            ring.with_u_deg(u_deg),
        ):
            assert rig.u_deg is not None
            assert rig.u_deg.dtype == np.float64
            np.testing.assert_array_equal(rig.u_deg, [0.5, 0.5, 0.5])
            np.testing.assert_array_equal(rig.with_intensities([1, 2, 3]).u_deg, rig.u_deg)
            assert "u_deg=(3,) float64" in repr(rig)
            assert rig.with_u_deg(None).u_deg is None


@pytest.mark.parametrize(
    ("text", "u_um", "distance_mm"),
    [
        ("", None, None),
        ('camera = "telecentric"\n', None, math.inf),
        ("pixel_pitch_u_um = 0.01\ncamera = { distance_mm = 150 }\n", 0.01, 150.0),
        ("pixel_pitch_u_um = 1.0\n", 1.0, None),
    ],
)
def test_what_is_known_of_scale_and_camera(
    capture_folder: Path, text: str, u_um: float | None, distance_mm: float | None
) -> None:
    recipe(capture_folder, f"pixel_pitch_um = 10.0\n{text}{RING}")
    capture = bgars.read_capture(capture_folder)
    assert capture.pixel_pitch_um == 10.0
    assert capture.pixel_pitch_u_um == u_um
    assert capture.camera_distance_mm == distance_mm
    bgars.estimate_normals(capture, method="lambertian")


@pytest.mark.parametrize("pitch_um", [0.7, 3.0, 9.6, 12.3])
def test_a_tenth_of_the_pitch_is_allowed_in_the_digits_of_the_file(capture_folder: Path, pitch_um: float) -> None:
    recipe(capture_folder, f"pixel_pitch_um = {pitch_um}\npixel_pitch_u_um = {pitch_um / 10:.3g}\n{RING}")
    assert bgars.read_capture(capture_folder).pixel_pitch_u_um == pytest.approx(pitch_um / 10)


def test_led_positions_in_mm_make_a_near_rig(capture_folder: Path) -> None:
    positions = "[[40, 0, 40], [0, 40, 40], [-40, 0, 40], [0, -40, 40]]"
    recipe(
        capture_folder,
        f"pixel_pitch_um = 10.0\n[lights]\npositions_mm = {positions}\nintensity_distance_mm = 60.0\n",
    )
    rig = bgars.read_capture(capture_folder).rig
    assert rig.is_near
    assert rig.positions_um is not None
    assert rig.intensity_distance_um is not None
    np.testing.assert_array_equal(rig.positions_um[0], [40_000, 0, 40_000])
    np.testing.assert_array_equal(rig.intensity_distance_um, np.full(4, 60_000.0))


@pytest.mark.parametrize("suffix", [".png", ".tif", ".bmp", ".jpg", ".pgm"])
def test_every_grey_format(capture_folder: Path, suffix: str) -> None:
    images = bgars.read_capture(capture_folder).images
    recipe(capture_folder, 'response = "linear"\n' + RING)
    for index, image in enumerate(images):
        (capture_folder / f"img{index}.png").unlink()
        iio.imwrite(capture_folder / f"img{index}{suffix}", image)
    np.testing.assert_allclose(bgars.read_capture(capture_folder).images, images, atol=1)


def test_float_tiff_is_read_by_imageio(capture_folder: Path) -> None:
    images = bgars.read_capture(capture_folder).images
    for index, image in enumerate(images):
        (capture_folder / f"img{index}.png").unlink()
        iio.imwrite(capture_folder / f"img{index}.tif", image.astype(np.float32) / 255)
    capture = bgars.read_capture(capture_folder)
    assert capture.images.dtype == np.float32
    assert capture.full_scale == pytest.approx(images.max() / 255)
    np.testing.assert_allclose(capture.images, images / np.float32(255))


def test_colour_images_are_linear_luminance_with_channel_intensities(capture_folder: Path) -> None:
    rgb = np.zeros((4, 5, 6, 3), np.uint8)
    for index in range(4):
        rgb[index] = [100, 50, 200]
        iio.imwrite(capture_folder / f"img{index}.png", rgb[index])
    luminance = 0.2126 * 100 + 0.7152 * 50 + 0.0722 * 200
    capture = bgars.read_capture(capture_folder)
    assert capture.images.dtype == np.uint8
    assert capture.images[0, 0, 0] == round(luminance)
    assert bgars.read_capture(capture_folder, channel="blue").images[0, 0, 0] == 200

    recipe(capture_folder, RING + "intensities = [[1, 1, 1], [2, 4, 8], [1, 1, 1], [1, 1, 1]]\n")
    capture = bgars.read_capture(capture_folder)
    assert capture.images.dtype == np.float32
    expected = 0.2126 * 100 / 2 + 0.7152 * 50 / 4 + 0.0722 * 200 / 8
    assert capture.images[1, 0, 0] == pytest.approx(expected, rel=1e-5)
    np.testing.assert_array_equal(capture.rig.intensities, np.ones(4))


def test_channel_intensities_divide_what_the_dark_frame_leaves(capture_folder: Path) -> None:
    for index in range(4):
        iio.imwrite(capture_folder / f"img{index}.png", np.full((5, 6, 3), [110, 60, 210], np.uint8))
    iio.imwrite(capture_folder / "dark.png", np.full((5, 6, 3), 10, np.uint8))
    lights = "intensities = [[1, 1, 1], [2, 4, 8], [1, 1, 1], [1, 1, 1]]\n"
    expected = 0.2126 * 100 / 2 + 0.7152 * 50 / 4 + 0.0722 * 200 / 8
    for offset in ('dark = "dark.png"\n', "black_level = 10\n"):
        recipe(capture_folder, offset + RING + lights)
        capture = bgars.read_capture(capture_folder)
        assert capture.dark is None
        assert capture.black_level == 0
        assert capture.images[1, 0, 0] == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("kind", ["gamma", "table"])
def test_the_response_is_inverted_before_the_dark_frame(capture_folder: Path, dtype: type, kind: str) -> None:
    full = float(np.iinfo(dtype).max)
    normal = np.array([0.1, 0.2, 1.0]) / np.linalg.norm([0.1, 0.2, 1.0])

    def encode(linear: float) -> int:
        return int(np.rint(full * (linear / full) ** (1 / 2.2)))

    dark = 0.02 * full
    for index, direction in enumerate(bgars.LightRig.ring(4).directions):
        value = encode(dark + 0.7 * full * direction @ normal)
        iio.imwrite(capture_folder / f"img{index}.png", np.full((5, 6), value, dtype))
    iio.imwrite(capture_folder / "dark.png", np.full((5, 6), encode(dark), dtype))
    levels = np.linspace(0, full, 4096)
    rows = "\n".join(f"{level:.6f},{(level / full) ** 2.2:.12g}" for level in levels)
    (capture_folder / "response.csv").write_text(f"grey_level,radiance\n{rows}\n", encoding="utf-8")
    response = "{ gamma = 2.2 }" if kind == "gamma" else '{ table = "response.csv" }'
    recipe(capture_folder, f'dark = "dark.png"\nresponse = {response}\n{RING}')
    capture = bgars.read_capture(capture_folder)
    assert capture.images.dtype == dtype, "no float copy"
    field = bgars.estimate_normals(capture, method="lambertian")
    tolerance_deg = 0.6 if dtype is np.uint8 else 0.01
    assert bgars.angular_error_deg(field.normals, np.float32(normal)).max() < tolerance_deg
    assert field.albedo[0, 0] == pytest.approx(0.7, rel=0.02)


def test_float_pixels_go_through_the_response_too(capture_folder: Path) -> None:
    for index in range(4):
        (capture_folder / f"img{index}.png").unlink()
        iio.imwrite(capture_folder / f"img{index}.tif", np.full((5, 6), 0.5, np.float32))
    recipe(capture_folder, "saturation = 1.0\nblack_level = 0.25\nresponse = { gamma = 2.0 }\n" + RING)
    capture = bgars.read_capture(capture_folder)
    assert capture.images[0, 0, 0] == pytest.approx(0.25, abs=1e-4)
    assert capture.black_level == pytest.approx(0.0625, abs=1e-4)
    assert capture.saturation == pytest.approx(1.0, abs=1e-4)
    recipe(capture_folder, "response = { gamma = 2.0 }\n" + RING)
    assert bgars.read_capture(capture_folder).saturation == np.inf, "nothing was said to clip"


def test_the_recipe_of_a_subfolder_may_point_upward(capture_folder: Path) -> None:
    inner = capture_folder / "16bit"
    inner.mkdir()
    np.savetxt(capture_folder / "d.txt", bgars.LightRig.ring(4).directions)
    for index in range(4):
        iio.imwrite(inner / f"light_{index}.png", np.full((5, 6), 1000, np.uint16))
    recipe(inner, '[lights]\ndirections = "../d.txt"\n')
    assert bgars.read_capture(inner).images.dtype == np.uint16
