"""The station file and what it does to captures: written, read, refused, applied."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import bgars
import imageio.v3 as iio
import numpy as np
import pytest
from bgars.io.station_file import is_station_file, station_keys
from bgars.records.flat_field import FlatField
from bgars.station import drift, response_from_bracket, response_from_sums
from rendered_spheres import render, ring
from test_calibrate import bgars_command

DOCS = Path(__file__).parents[2] / "docs"
LIGHTS = ring(6, 45.0)


def station(**more: object) -> bgars.Station:
    rig = bgars.LightRig.from_directions(LIGHTS, u_deg=0.05)
    u = np.full(6, 0.05)
    lights = bgars.LightCalibration(rig, u, u * 0.6, u * 0.8, "mirror", (), 0.02, u_intensities=np.full(6, 0.01))
    return bgars.Station("line 3", lights=lights, calibrated_utc="2026-01-01T00:00:00Z", **more)


def test_a_station_comes_back_as_it_was(tmp_path: Path) -> None:
    levels = np.linspace(0, 1, 17)
    known = station(
        flat=FlatField(np.random.default_rng(0).uniform(50, 100, (6, 6)), 2, (40, 60), 0.001),
        response=bgars.ResponseCurve(levels, levels**2, 0.001, "sums"),
        scale=bgars.Scale(3.4, 0.002, distortion=0.004, points=80),
        findings=(bgars.Remark("doubt", "a 'quoted' \"thing\"", "code"),),
    )
    path = tmp_path / "any name.toml"
    bgars.write_station(known, path)
    assert is_station_file(path)
    back = bgars.read_station(path)
    assert back.lights is not None
    assert back.flat is not None
    assert back.response is not None
    np.testing.assert_allclose(back.lights.rig.directions, LIGHTS)
    np.testing.assert_allclose(back.lights.rig.u_deg, 0.05)
    np.testing.assert_array_equal(back.flat.coefficients, known.flat.coefficients)
    np.testing.assert_allclose(back.response.radiances, levels**2)
    assert (back.scale.pixel_pitch_um, back.scale.distortion) == (3.4, 0.004)
    assert back.findings[0].message == "a 'quoted' \"thing\""
    assert (back.name, back.calibrated_utc) == (known.name, known.calibrated_utc)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('format = "bgars-station"', 'format = "other"', "is not a station file"),
        ("[lights]", "[lights]\ndirection = 1", "unknown key 'lights.direction'; the nearest known key is"),
        ("version = 1", "version = 2", "version"),
        ("u_own_deg = [", "u_own_deg = [0.1, ", "u_own_deg: must have one entry for each of the 6 lights, got 7"),
        ("degree = 2", "degree = 3", "flat.degree: must be .* 6 coefficients each .* got 3"),
        ("distortion = 0.0", "distortion = 5", "scale.distortion: .* less than 0.33, got 5"),
        ('sphere = "mirror"', 'sphere = "mirorr"', "lights.sphere: .* got 'mirorr'"),
    ],
)
def test_a_wrong_station_is_refused_in_one_line(tmp_path: Path, old: str, new: str, words: str) -> None:
    path = tmp_path / "station.toml"
    flat = FlatField(np.ones((6, 6)), 2, (4, 4))
    bgars.write_station(station(flat=flat, scale=bgars.Scale(3.4, 0.002)), path)
    assert old in path.read_text(encoding="utf-8")
    path.write_text(path.read_text(encoding="utf-8").replace(old, new), encoding="utf-8")
    with pytest.raises(bgars.BgarsError, match=words) as caught:
        bgars.read_station(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_flat_field_that_was_exchanged_is_refused(tmp_path: Path) -> None:
    bgars.write_station(station(flat=FlatField(np.ones((6, 1)), 0, (4, 4))), tmp_path / "s.toml")
    (tmp_path / "s.flat.npz").write_bytes(b"other")
    with pytest.raises(bgars.FileFormatError, match="not the one that was calibrated"):
        bgars.read_station(tmp_path / "s.toml")


@pytest.fixture
def part(tmp_path: Path) -> Path:
    capture, truth = bgars.simulate(
        bgars.Scene.hemisphere(300.0), bgars.LightRig.from_directions(LIGHTS), bgars.Material(i_s=0.0), bgars.Camera()
    )
    bgars.write_simulation(capture, truth, tmp_path / "part")
    return tmp_path / "part"


def test_a_capture_takes_lights_and_scale_from_its_station(tmp_path: Path, part: Path) -> None:
    bgars.write_station(station(scale=bgars.Scale(5.5, 0.01)), tmp_path / "station.toml")
    with pytest.warns(bgars.CaptureWarning, match="pixel_pitch_um = 10, but 5.5"):
        capture = bgars.read_capture(part, station=tmp_path / "station.toml")
    assert (capture.pixel_pitch_um, capture.pixel_pitch_u_um) == (5.5, 0.01)
    np.testing.assert_allclose(capture.rig.u_deg, 0.05)
    (part / "capture.toml").write_text(
        'station = "../station.toml"\nimages = ' + json.dumps([f"light_{index:02d}.png" for index in range(6)])
    )
    named = bgars.read_capture(part)
    np.testing.assert_allclose(named.rig.directions, LIGHTS)
    assert named.pixel_pitch_um == 5.5


def test_another_number_or_order_of_images_is_refused(part: Path) -> None:
    capture = bgars.read_capture(part)
    few = replace(capture, images=capture.images[:5], rig=capture.rig.take(np.arange(5)))
    with pytest.raises(bgars.InputError, match="5 images, but line 3 has 6 lights"):
        bgars.with_station(few, station())
    turned = np.roll(np.arange(6), 1)
    with pytest.raises(bgars.InputError, match="in another order than the station's lights"):
        bgars.with_station(replace(capture, rig=capture.rig.take(turned)), station())


def test_a_flat_board_has_no_dome_once_it_is_flat_fielded() -> None:
    height, width = 300, 400
    y, x = np.mgrid[:height, :width]
    x, y = (x + 0.5) / width * 2 - 1, 1 - (y + 0.5) / height * 2
    rng = np.random.default_rng(1)
    even = [
        (1 - 0.1 * (x**2 + y**2)) * (1 + 0.12 * (a * x + b * y)) * s
        for (a, b, _), s in zip(LIGHTS, rng.uniform(0.8, 1.2, 6), strict=True)
    ]
    rig = bgars.LightRig.from_directions(LIGHTS)

    def shot(albedo: float, seed: int) -> bgars.Capture:
        noise = np.random.default_rng(seed)
        images = np.stack(
            [np.clip(np.rint(albedo * 150 * one + noise.normal(0, 1, one.shape)), 0, 255) for one in even]
        )
        mask = np.ones((height, width), np.bool_)
        return bgars.Capture(images=images.astype(np.uint8), rig=rig, mask=mask, saturation=255.0)

    flat, findings = bgars.calibrate_flat(shot(1.0, 0))
    assert flat.residual < 0.002
    assert all(finding.severity == "note" for finding in findings)
    domes = {}
    part = shot(0.8, 5)
    for name, capture in (("raw", part), ("even", bgars.with_station(part, station(flat=flat)))):
        field = bgars.estimate_normals(capture, method="lambertian")
        surface = bgars.integrate_normals(field).height_px
        domes[name] = float(np.ptp(surface[::20, ::20])) * 1200 / width
    assert domes["raw"] > 20
    assert domes["even"] < 3
    with pytest.raises(bgars.InputError, match="but the flat field of line 3 has 6 maps of 400 x 300 pixels"):
        bgars.with_station(replace(part, images=part.images[:, :-1]), station(flat=flat))


@pytest.mark.parametrize("gamma", [1.0, 1.8])
def test_the_response_is_found_from_a_bracket_and_from_sums(gamma: float) -> None:
    rng = np.random.default_rng(0)
    light = np.linspace(0.01, 1.0, 8000).reshape(80, 100)

    def seen(radiance: np.ndarray) -> np.ndarray:
        level = 255 * np.clip(radiance, 0, 1) ** (1 / gamma) + rng.normal(0, 1, light.shape)
        return np.clip(np.rint(level), 0, 255)

    first, second = 0.7 * light * rng.uniform(0.1, 0.9, light.shape), 0.5 * light * rng.uniform(0.1, 0.5, light.shape)
    for curve, findings in (
        response_from_bracket([seen(light * t) for t in (0.25, 0.5, 1.0)], [0.25, 0.5, 1.0], 255.0),
        response_from_sums(seen(first), seen(second), seen(first + second), 255.0),
    ):
        assert np.abs(curve.radiances - curve.levels**gamma).max() < 0.004
        assert findings[0].code == ("linear" if gamma == 1.0 else "not-linear")


@pytest.mark.parametrize("target", ["dots", "chessboard"])
def test_a_grid_gives_the_pixel_pitch_and_the_distortion(target: str) -> None:
    height, width, pitch_px, turn, k = 300, 380, 23.0, np.radians(3.0), 0.005
    fine = 3
    y, x = np.mgrid[: height * fine, : width * fine]
    x, y = (x + 0.5) / fine - width / 2, height / 2 - (y + 0.5) / fine
    half2 = (height**2 + width**2) / 4
    for _ in range(4):  # the inverse of the distortion: where a pixel looks
        bend = 1 + k * (x**2 + y**2) / half2
        u, v = x / bend, y / bend
        bend = 1 + k * (u**2 + v**2) / half2
        u, v = x / bend, y / bend
    a, b = (u * np.cos(turn) + v * np.sin(turn)) / pitch_px, (v * np.cos(turn) - u * np.sin(turn)) / pitch_px
    dots = np.hypot(a - np.rint(a), b - np.rint(b)) < 0.25
    dark = dots if target == "dots" else (np.floor(a) + np.floor(b)) % 2 == 0
    picture = np.where(dark, 40.0, 200.0).reshape(height, fine, width, fine).mean(axis=(1, 3))
    images = np.rint(picture + np.random.default_rng(0).normal(0, 1, (3, height, width))).astype(np.uint8)
    capture = bgars.Capture(
        images=images, rig=bgars.LightRig.ring(3), mask=np.ones((height, width), np.bool_), saturation=255.0
    )
    scale, _ = bgars.calibrate_scale(capture, 500.0, target=target)
    assert scale.pixel_pitch_um == pytest.approx(500.0 / pitch_px, rel=4e-4)
    assert abs(scale.pixel_pitch_um - 500.0 / pitch_px) < 4 * scale.pixel_pitch_u_um
    assert scale.distortion == pytest.approx(k, rel=0.2)
    assert scale.rotation_deg == pytest.approx(3.0, abs=0.05)


def test_commands_calibrate_use_and_compare(tmp_path: Path) -> None:
    def shoot(folder: Path, lights: np.ndarray, seed: int) -> Path:
        folder.mkdir()
        images = render(lights, ball=(3.0, 2.0, 50.0), size=(140, 150), kind="matt", board=0.05, samples=3, seed=seed)
        for index, image in enumerate(images):
            iio.imwrite(folder / f"image{index}.png", image)
        return folder

    first = shoot(tmp_path / "ball", LIGHTS, 0)
    run = bgars_command("calibrate", "lights", first, "-o", tmp_path / "station.toml", "--sphere", "matt", "--json")
    assert run.code == 0, run.stderr
    assert len(json.loads(run.stdout)["u_deg"]) == 6
    assert "Not calibrated" in (tmp_path / "station.html").read_text(encoding="utf-8")
    known = bgars.read_station(tmp_path / "station.toml")
    assert known.lights is not None
    np.testing.assert_allclose(known.lights.rig.directions, LIGHTS, atol=0.02)
    again = shoot(tmp_path / "again", LIGHTS, 1)
    run = bgars_command("calibrate", "drift", again, "--station", tmp_path / "station.toml")
    assert (run.code, run.stderr) == (0, "")
    assert "nothing moved" in run.stdout
    moved = LIGHTS.copy()
    moved[2] = ring(1, 40.0, azimuth0_deg=135.0)[0]
    run = bgars_command(
        "calibrate", "drift", shoot(tmp_path / "moved", moved, 2), "--station", tmp_path / "station.toml"
    )
    assert run.code == 1
    assert "fail: light 2" in run.stdout
    assert "1 of 14 comparisons exceed the limit" in run.stdout
    run = bgars_command("init", first, "--station", tmp_path / "station.toml")
    assert run.code == 0, run.stderr
    assert bgars.read_capture(first).rig.u_deg is not None
    run = bgars_command("init", first, "--ring", "6,45")
    assert run.code == 2
    assert "--force" in run.stderr
    run = bgars_command("calibrate", "response", "--srgb", "-o", tmp_path / "station.toml")
    assert run.code == 0, run.stderr
    assert bgars.read_station(tmp_path / "station.toml").response is not None


def test_drift_names_lights_and_limits() -> None:
    images = render(LIGHTS, ball=(3.0, 2.0, 50.0), size=(140, 150), kind="matt", board=0.05, samples=3)
    capture = bgars.Capture(
        images=images, rig=bgars.LightRig.ring(6), mask=np.ones(images.shape[1:], np.bool_), saturation=255.0
    )
    found = drift(station(), capture, reference="matt")
    assert {finding.light for finding in found if finding.code == "light-moved"} == set(range(6))
    with pytest.raises(bgars.InputError, match="no flat field"):
        drift(station(), capture, reference="flat")


def test_every_key_is_documented() -> None:
    page = (DOCS / "station.md").read_text(encoding="utf-8")
    for key, meaning in station_keys():
        assert f"`{key}`" in page, key
        assert meaning in page, key


def test_a_lens_that_distorts_is_straightened_and_clipped_pixels_stay_clipped() -> None:
    rows, cols = np.mgrid[:120, :160].astype(np.float64)
    down, right, half2 = rows - 59.5, cols - 79.5, (120**2 + 160**2) / 4.0
    inverse = np.ones_like(rows)
    for _ in range(20):
        inverse = 1.0 / (1.0 + 0.01 * (down**2 + right**2) * inverse**2 / half2)

    def scene(y: np.ndarray, x: np.ndarray) -> np.ndarray:
        return 100.0 + 60.0 * np.sin(x / 9.0) * np.cos(y / 11.0) + 200.0 * (np.hypot(x - 40, y + 30) < 8)

    bent = np.minimum(np.rint(scene(down * inverse, right * inverse)), 255).astype(np.uint8)
    images = np.repeat(bent[None], 6, axis=0)
    rig = bgars.LightRig.from_directions(LIGHTS)
    capture = bgars.Capture(images, rig, np.ones((120, 160), np.bool_), saturation=255.0)
    seen = bgars.with_station(capture, bgars.Station("line 3", scale=bgars.Scale(3.4, 0.002, distortion=0.01)))
    plain = np.hypot(right - 40, down + 30) > 12
    inside = seen.mask & plain
    assert np.abs(seen.images[0][inside] - scene(down, right)[inside]).max() < 1.0
    assert (seen.images[0][np.hypot(right - 40, down + 30) < 6] >= seen.saturation).all()
    assert (seen.images[0][plain] < seen.saturation).all()
