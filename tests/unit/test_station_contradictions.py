"""Calibrations that contradict themselves, each other, or what was typed are refused by name."""

from __future__ import annotations

import math
import re
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import bgars
import imageio.v3 as iio
import numpy as np
import pytest
from bgars.cli.station_output import keep_part
from bgars.records.flat_field import FlatField
from bgars.station.agreement import agreement
from bgars.station.ball_diameter import need_diameter_of_scale
from bgars.station.believable import need_believable
from rendered_spheres import render, ring
from test_calibrate import bgars_command
from test_station_lights import capture_of

LIGHTS = ring(4, 48.0)


def stated(lights: int = 4, **more: object) -> bgars.LightCalibration:
    u = np.full(lights, 0.05)
    rig = bgars.LightRig.from_directions(ring(lights, 48.0), u_deg=0.05)
    return bgars.LightCalibration(rig, u, u * 0.6, u * 0.8, "mirror", (), 0.02, **more)


@pytest.fixture(scope="module")
def ball() -> bgars.Capture:
    images = render(LIGHTS, ball=(3.0, 2.0, 50.0), size=(140, 140), samples=2, blur_px=0.6, lamp_level=20.0, seed=5)
    return capture_of(images, camera_distance_mm=np.inf)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, ball: bgars.Capture) -> Path:
    """The ball's images without a description."""
    folder = tmp_path_factory.mktemp("ball") / "ball"
    folder.mkdir()
    for index, image in enumerate(ball.images):
        iio.imwrite(folder / f"light{index}.png", image)
    return folder


def test_a_diameter_that_the_scale_contradicts_is_refused(ball: bgars.Capture) -> None:
    scaled = replace(ball, pixel_pitch_um=20.0, pixel_pitch_u_um=0.01)
    with pytest.raises(
        bgars.InputError, match=r"stated as 20 mm, but is (2|2\.0\d*|1\.99\d*) mm .* by the scale of 20"
    ):
        bgars.calibrate_lights(scaled, diameter_um=20_000.0)
    outline = SimpleNamespace(circle_px=np.array([3.0, 2.0, 50.0]), radius_px=50.0, u_px=np.full(3, 0.1))
    seen = SimpleNamespace(
        balls=[SimpleNamespace(capture=scaled, outline=outline, u_outline_px=None)], camera_px=math.inf
    )
    need_diameter_of_scale(seen, 2010.0)  # by a calliper
    with pytest.raises(bgars.InputError, match=r"stated as 2.04 mm, but is 2 mm \(u 0.0041 mm\)"):
        need_diameter_of_scale(seen, 2040.0)


def test_the_same_pictures_in_two_folders_are_refused(
    tmp_path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    copy, place, known = tmp_path / "copy", tmp_path / "station.toml", tmp_path / "known.csv"
    shutil.copytree(folder, copy)
    known.write_text("name,height_um,u_um\nA1,500,0.5\n")
    bgars.write_station(bgars.Station(lights=stated()), place)
    monkeypatch.setattr(bgars, "inspect", lambda *_: SimpleNamespace(balls=[], warnings=[]))
    for arguments in (
        ("calibrate", "lights", folder, copy, "-o", place),
        ("calibrate", "scale", folder, copy, "-o", place, "--pitch-mm", 1, "--heights-mm", "0,10"),
        ("verify", folder, copy, "--known", known, "--station", place),
        ("teach", folder, copy, "-o", tmp_path / "part.toml", "--station", place),
    ):
        run = bgars_command(*arguments)
        assert run.code == 2
        assert "copy/light0.png is the same picture as ball/light0.png" in run.stderr


@pytest.mark.parametrize(
    ("sphere", "elevation_deg", "u_deg", "words"),
    [
        ("matt", 45.0, 12.0, "(elevation 45 deg, u 12 deg): is it a mirror ball (sphere mirror)"),
        ("mirror", -3.0, 1.0, "(elevation -3 deg, u 1 deg): is it a matt ball (sphere matt)"),
        ("mirror", 45.0, math.nan, "(elevation 45 deg, u nan deg)"),
        ("mirror", 3.0, 9.9, ""),
    ],
)
def test_lights_that_are_nonsense_are_refused_with_the_likely_cause(
    ball: bgars.Capture, sphere: str, elevation_deg: float, u_deg: float, words: str
) -> None:
    directions = np.array([*LIGHTS[:3], *ring(1, elevation_deg)])
    solution = SimpleNamespace(directions=directions, u_deg=np.array([0.1, 0.1, 0.1, u_deg]), reduced_chi_square=1.0)
    if not words:
        need_believable(solution, [ball], sphere, [])
        return
    with pytest.raises(
        bgars.CalibrationError, match=re.escape(f"not known to 10 deg: light 3 (counted from 0) {words}")
    ):
        need_believable(solution, [ball], sphere, [])


def test_folders_in_different_orders_are_refused(ball: bgars.Capture) -> None:
    solution = SimpleNamespace(directions=LIGHTS, u_deg=np.full(4, 90.0), reduced_chi_square=1e5)
    with pytest.raises(bgars.CalibrationError, match="are the images of all folders in the same order"):
        need_believable(solution, [ball, ball], "mirror", [])


def test_a_direction_of_which_a_finding_says_why_it_is_open_is_kept(ball: bgars.Capture) -> None:
    solution = SimpleNamespace(directions=LIGHTS, u_deg=np.array([0.1, 60.0, 0.1, 0.1]), reduced_chi_square=1.0)
    need_believable(solution, [ball], "mirror", [bgars.Remark("doubt", "two", "two-highlights", light=1)])
    with pytest.raises(bgars.CalibrationError, match=r"light 1 \(counted from 0\) \(elevation 48 deg, u 60 deg\)"):
        need_believable(solution, [ball], "mirror", [bgars.Remark("doubt", "two", "two-highlights", light=2)])


STRENGTHS = np.array([1.0, 0.8, 1.2, 0.9, 1.1, 0.75])


def board(order: list[int], tilt: tuple[float, float] = (0.0, 0.0), size_px: tuple[int, int] = (40, 60)) -> FlatField:
    """A board's levels under the lights of `lit`, in an order, tilted by some degrees."""
    normal = np.array([*np.radians(tilt), 1.0])
    levels = 100.0 * STRENGTHS * (ring(6, 48.0) @ normal)
    return FlatField(levels[order, None], 0, size_px)


def lit() -> bgars.LightCalibration:
    known = stated(6, u_intensities=np.full(6, 0.03), size_px=(40, 60))
    return replace(known, rig=replace(known.rig, intensities=STRENGTHS / STRENGTHS.mean()))


@pytest.mark.parametrize(
    "order", [[5, 4, 3, 2, 1, 0], [1, 2, 3, 4, 5, 0], [0, 1, 5, 3, 4, 2]], ids=["reversed", "begun later", "exchanged"]
)
def test_a_board_in_another_order_than_the_lights_is_refused(order: list[int]) -> None:
    with pytest.raises(bgars.CalibrationError, match="the board's images are in another order than the lights"):
        agreement(bgars.Station(lights=lit(), flat=board(order)))


def test_a_tilted_board_is_no_contradiction_and_a_changed_lamp_is_doubted() -> None:
    flat = board([0, 1, 2, 3, 4, 5], tilt=(2.0, -1.5))
    assert agreement(bgars.Station(lights=lit(), flat=flat)) == []
    flat.coefficients[4] *= 0.7
    found = agreement(bgars.Station(lights=lit(), flat=flat))
    assert [(one.code, one.light) for one in found] == [("sections-strength", 4)]
    unmeasured = replace(lit(), u_intensities=None)
    assert agreement(bgars.Station(lights=unmeasured, flat=flat)) == []


def test_sections_that_do_not_fit_are_not_written_and_other_sizes_are_named(tmp_path: Path) -> None:
    place = tmp_path / "station.toml"
    drawn: list[str] = []
    bgars.write_station(bgars.Station("line 3", lights=lit()), place)
    seven = FlatField(np.full((7, 1), 90.0), 0, (40, 60))
    before = place.read_text()
    with pytest.raises(bgars.CalibrationError, match=r"line 3: 6 lights, but a flat field of 7 images.*--board BOARD"):
        keep_part(place, {"flat": seven}, (), draw=lambda: drawn.append("balls"))
    assert (place.read_text(), drawn, len(list(tmp_path.iterdir()))) == (before, [], 1)
    said = keep_part(place, {"flat": board([0, 1, 2, 3, 4, 5], size_px=(20, 30))}, ())
    assert [one.code for one in said] == ["sections-size"]
    assert "lights 60 x 40, flat 30 x 20" in said[0].message
    # Once it is mended, it is no longer said.
    keep_part(place, {"flat": board([0, 1, 2, 3, 4, 5])}, ())
    assert bgars.read_station(place).findings == ()


def test_a_verification_does_not_outlive_what_it_verified(tmp_path: Path) -> None:
    place = tmp_path / "station.toml"
    kept = bgars.Verification("height", 3, 9, 0.1, 0.2, math.nan, math.nan, 0.1, 0.5, 8.0)
    passed = bgars.Remark("note", "height: kept", "mpe")
    known = bgars.Station("s", lights=lit(), verified=(kept,), verified_utc="2026-01-01T00:00:00Z", findings=(passed,))
    bgars.write_station(known, place)
    said = keep_part(place, {"scale": bgars.Scale(3.4, 0.002)}, ())
    assert "of 2026-01-01T00:00:00Z was that of the station before" in said[0].message
    back = bgars.read_station(place)
    assert (back.verified, back.verified_utc, [one.code for one in back.findings]) == ((), "", ["outdated"])


def test_a_verification_by_one_capture_is_doubted(
    tmp_path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place, known = tmp_path / "station.toml", tmp_path / "known.csv"
    known.write_text("name,height_um,u_um\nA1,500,0.5\n")
    bgars.write_station(bgars.Station(lights=stated()), place)
    seen = SimpleNamespace(balls=[SimpleNamespace(name="A1", top_um=500.1, diameter_um=math.nan)])
    monkeypatch.setattr(bgars, "inspect", lambda *_: seen)
    run = bgars_command("verify", folder, "--known", known, "--station", place, "--mpe-um", 8)
    assert run.code == 0
    assert "height: bias +0.10 um; largest error 0.10 um, 1 ball in 1 capture\n" in run.stdout  # no u: "nan um"
    assert "warning: 1 capture of the part: that readings repeat is not shown" in run.stdout
