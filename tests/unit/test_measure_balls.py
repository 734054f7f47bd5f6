"""Balls, lights and board from cast shadows, on simulated captures."""

from __future__ import annotations

from dataclasses import replace

import bgars
import numpy as np
import pytest
from bgars.inspection import check_shadows, measure_balls
from bgars.records.found_balls import FoundBalls
from bgars.records.measured_balls import BallMeasurement
from measured_captures import array, errors, photograph, rms, sixteen_balls, wrong_rig
from numpy.typing import NDArray
from shared_work import shared


@pytest.fixture(scope="module")
def part() -> tuple[bgars.Capture, bgars.SimulatedTruth, FoundBalls]:
    return sixteen_balls()


@pytest.fixture(scope="module")
def measured_part(part: tuple[bgars.Capture, bgars.SimulatedTruth, FoundBalls]) -> tuple[BallMeasurement, list[float]]:
    """Balls of the part, measured by one thread, and the progress that was told."""
    said: list[float] = []
    return measure_balls(part[0], part[2], threads=1, progress=said.append), said


def test_balls_are_measured_to_a_fraction_of_a_micrometre(
    part: tuple[bgars.Capture, bgars.SimulatedTruth, FoundBalls], measured_part: tuple[BallMeasurement, list[float]]
) -> None:
    _, truth, found = part
    measured, _ = measured_part
    assert [ball.name for ball in measured.balls] == [ball.name for ball in found.balls]
    assert all(ball.reasons == () and ball.lights_used == 8 for ball in measured.balls)
    assert max(rms(errors(measured, truth, name)) for name in ("x_um", "y_um")) < 0.2
    assert rms(errors(measured, truth, "diameter_um")) < 0.6
    assert rms(errors(measured, truth, "top_um")) < 0.4
    assert 0.0 < measured.shadow_residual_rms < 0.1


def test_lights_that_are_right_stay_where_they_are(measured_part: tuple[BallMeasurement, list[float]]) -> None:
    assert measured_part[0].light_change_deg.max() < 0.02


def test_result_does_not_depend_on_threads(
    part: tuple[bgars.Capture, bgars.SimulatedTruth, FoundBalls], measured_part: tuple[BallMeasurement, list[float]]
) -> None:
    capture, _, found = part
    assert repr(measured_part[0].balls) == repr(measure_balls(capture, found, threads=3).balls)


def test_progress_grows_to_1(measured_part: tuple[BallMeasurement, list[float]]) -> None:
    _, said = measured_part
    assert said == sorted(said)
    assert said[-1] == 1.0


MOST_STATED_PX = {"x_um": 0.02, "y_um": 0.02, "diameter_um": 0.04, "centre_z_um": 0.06, "top_um": 0.06}
"""Median standard uncertainties of parts as modelled, as wanted of rendered ones without deviations."""


@pytest.fixture(scope="module")
def six_parts(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, float], dict[str, float]]:
    return shared(tmp_path_factory, "six_parts", measured_six)


def measured_six() -> tuple[dict[str, float], dict[str, float]]:
    """Shares of readings within their standard uncertainty, and medians of these, px."""
    settings = [
        {"elevation_deg": 45.0, "pitch_um": 11.0, "off_deg": 0.0},
        {"elevation_deg": 45.0, "pitch_um": 13.0, "off_deg": 1.0},
        {"elevation_deg": 38.0, "pitch_um": 12.0, "off_deg": 0.0},
        {"elevation_deg": 55.0, "pitch_um": 12.0, "off_deg": 0.5},
        {"elevation_deg": 45.0, "pitch_um": 12.0, "off_deg": 0.0, "blur_px": 0.6},
        {"elevation_deg": 50.0, "pitch_um": 15.0, "off_deg": 0.3},
    ]
    covered: dict[str, list[bool]] = {name: [] for name in ("x_um", "y_um", "diameter_um", "centre_z_um", "top_um")}
    stated_px: dict[str, list[float]] = {name: [] for name in covered}
    for seed, setting in enumerate(settings):
        rig = bgars.LightRig.ring(8, elevation_deg=setting["elevation_deg"])
        scene = array(6, 6, 10 + seed)
        blur_px = setting.get("blur_px", 0.0)
        capture, truth, found = photograph(scene, rig, seed, pitch_um=setting["pitch_um"], blur_px=blur_px)
        skewed = replace(capture, rig=wrong_rig(rig, setting["off_deg"], seed))
        measured = measure_balls(skewed, found, field=bgars.estimate_normals(skewed, anchors=found))
        for name, hits in covered.items():
            u = np.array([getattr(ball, f"u_{name}") for ball in measured.balls])
            hits.extend(np.abs(errors(measured, truth, name)) < u)
            stated_px[name].extend(u / setting["pitch_um"])
    assert len(covered["x_um"]) >= 200
    shares = {name: float(np.mean(hits)) for name, hits in covered.items()}
    return shares, {name: float(np.median(u_px)) for name, u_px in stated_px.items()}


def test_uncertainties_cover_the_truth_as_often_as_they_should(
    six_parts: tuple[dict[str, float], dict[str, float]],
) -> None:
    shares, stated_px = six_parts
    # A simulated camera stands stiller, and its rims are truer, than any real one: truth is covered more often there,
    # but not by uncertainties that say nothing.
    for name, most_px in MOST_STATED_PX.items():
        assert stated_px[name] <= most_px, name
    assert all(share >= 0.58 for share in shares.values()), shares
    assert float(np.mean(list(shares.values()))) >= 0.61, shares


@pytest.mark.xfail(
    strict=True,
    reason="0.96 and 0.94: simulated balls are rounder than 0.001, rings better squared than 0.05 degrees",
)
def test_uncertainties_are_not_too_large(six_parts: tuple[dict[str, float], dict[str, float]]) -> None:
    shares, _ = six_parts
    assert shares["centre_z_um"] <= 0.86, shares
    assert float(np.mean(list(shares.values()))) <= 0.9, shares


@pytest.fixture(scope="module")
def diameters_within_u(tmp_path_factory: pytest.TempPathFactory) -> list[NDArray[np.bool_]]:
    return shared(tmp_path_factory, "diameters_within_u", diameters_of_all_kinds)


def diameters_of_all_kinds() -> list[NDArray[np.bool_]]:
    """Whether diameters of found balls lie within u, for each kind of capture."""
    kinds = [
        {"supersample": 1},
        {"supersample": 2, "pitch_um": 16.0},
        {"supersample": 2, "pitch_um": 13.0, "read_noise_levels": 0.0, "full_well_e": None},
        {"supersample": 3, "blur_px": 0.6},
        {"supersample": 3, "pitch_um": 20.0, "read_noise_levels": 0.6, "full_well_e": 6000.0},
        {"supersample": 4, "pitch_um": 12.0, "blur_px": 0.4, "bit_depth": 12},
        {"supersample": 4, "pitch_um": 9.0, "gamma": 2.2},
    ]
    hits = []
    for seed, kind in enumerate(kinds):
        rig = bgars.LightRig.ring(6 + 2 * (seed % 2), elevation_deg=40.0 + 2.5 * seed)
        capture, truth, _ = photograph(array(5, 6, 60 + seed), rig, 60 + seed, **kind)  # type: ignore[arg-type]
        found = bgars.find_balls(capture)
        measured = measure_balls(capture, found)
        assert len(measured.balls) == len(truth.balls)
        u = np.array([ball.u_diameter_um for ball in measured.balls])
        hits.append(np.abs(errors(measured, truth, "diameter_um")) < u)
    return hits


def test_diameters_of_found_balls_are_covered_on_captures_of_all_kinds(
    diameters_within_u: list[NDArray[np.bool_]],
) -> None:
    shares = [float(hits.mean()) for hits in diameters_within_u]
    assert sum(map(len, diameters_within_u)) >= 200
    assert np.concatenate(diameters_within_u).mean() >= 0.61, shares
    assert all(share >= 0.45 for share in shares), shares


def test_diameters_of_found_balls_are_not_covered_too_often(diameters_within_u: list[NDArray[np.bool_]]) -> None:
    assert np.concatenate(diameters_within_u).mean() <= 0.86


def test_lights_are_found_from_a_rig_one_degree_off() -> None:
    rig = bgars.LightRig.ring(8)
    capture, truth, found = photograph(array(4, 5, 3), rig)
    measured = measure_balls(replace(capture, rig=wrong_rig(rig, 1.0, 3)), found)
    off_deg = np.degrees(np.arccos(np.clip((measured.light_directions * rig.directions).sum(axis=1), -1.0, 1.0)))
    assert off_deg.max() < 0.1
    assert np.allclose(measured.light_change_deg, 1.0, atol=0.1)
    assert rms(errors(measured, truth, "top_um")) < 0.8


def test_a_rig_that_is_exact_may_be_kept(part: tuple[bgars.Capture, bgars.SimulatedTruth, FoundBalls]) -> None:
    capture, truth, found = part
    measured = measure_balls(capture, found, refine_lights=False)
    assert measured.light_change_deg.max() < 1e-3
    assert rms(errors(measured, truth, "top_um")) < 0.4


def test_bowed_and_tilted_boards() -> None:
    capture, truth, found = photograph(array(4, 4, 5, bow_um=25.0), bgars.LightRig.ring(8))
    measured = measure_balls(capture, found)
    assert rms(errors(measured, truth, "top_um")) < 0.5
    places = np.array([(ball.x_um, ball.y_um) for ball in truth.balls])
    x, y = places.T
    found_z = np.column_stack([np.ones(len(x)), x, y, x * x, x * y, y * y]) @ measured.board_coefficients_um
    true_z = np.array([ball.board_z_um for ball in truth.balls])
    assert np.std(found_z - true_z) < 1.0 < np.std(true_z)


def test_near_lights() -> None:
    positions_um = bgars.LightRig.ring(8).directions * 40_000.0
    capture, truth, found = photograph(array(4, 4, 6), bgars.LightRig.from_positions(positions_um))
    assert rms(errors(measure_balls(capture, found), truth, "top_um")) < 0.5


def test_a_flattened_ball_among_round_ones() -> None:
    scene = array(4, 4, 7)
    balls = list(scene.balls)
    balls[5] = replace(balls[5], aspect_ratio=0.7, centre_z_um=0.65 * balls[5].radius_um)
    balls[10] = replace(balls[10], aspect_ratio=0.98)
    scene = bgars.Scene(tuple(balls), (), scene.board, scene.size_um)
    capture, truth, found = photograph(scene, bgars.LightRig.ring(8))
    measured = measure_balls(capture, found)
    assert measured.balls[5].aspect_ratio == pytest.approx(0.7, abs=0.006)
    assert measured.balls[10].aspect_ratio == pytest.approx(0.98, abs=0.004)
    assert rms(errors(measured, truth, "top_um")) < 0.7


def test_a_flat_top_is_found_by_normals() -> None:
    scene = array(3, 4, 8, defects={"B2": bgars.Defect.clipped(40.0)})
    capture, truth, found = photograph(scene, bgars.LightRig.ring(8))
    blind = measure_balls(capture, found)
    assert all(np.isnan(ball.flat_top_depth_um) for ball in blind.balls)
    measured = measure_balls(capture, found, field=bgars.estimate_normals(capture))
    clipped = next(ball for ball in measured.balls if ball.name == "B2")
    assert clipped.flat_top_depth_um == pytest.approx(40.0, abs=max(3.0, 3.0 * clipped.u_flat_top_depth_um))
    assert any("flat top" in reason for reason in clipped.reasons)
    others = [ball for ball in measured.balls if ball.name != "B2"]
    assert all(ball.reasons == () for ball in others)
    assert np.abs(errors(measured, truth, "top_um")).max() < 5.0


def test_response_dark_frame_and_intensities_are_honoured() -> None:
    intensities = [1.0, 0.8, 1.2, 0.9, 1.1, 1.0, 0.7, 1.3]
    rig = bgars.LightRig.ring(8, intensities=intensities)
    capture, truth, found = photograph(array(3, 3, 9), rig, gamma=2.2, black_level=6.0)
    assert capture.response is not None
    assert rms(errors(measure_balls(capture, found), truth, "top_um")) < 0.5


def test_bridged_balls_have_no_height(part: tuple[bgars.Capture, bgars.SimulatedTruth, FoundBalls]) -> None:
    capture, truth, found = part
    joined = replace(found, bridges=((found.balls[0].name, found.balls[1].name),))
    measured = measure_balls(capture, joined)
    for ball in measured.balls[:2]:
        assert np.isnan(ball.top_um)
        assert "bridged" in ball.reasons[0]
        assert np.isfinite(ball.diameter_um)
    assert rms(errors(measured, truth, "top_um")[2:]) < 0.5


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (np.zeros_like, "too little contrast"),
        (lambda images: np.full_like(images, 255), "saturated"),
        (lambda images: images // 20, "too little contrast"),
    ],
    ids=["black", "saturated", "faint"],
)
def test_what_cannot_be_measured_is_a_reason_and_not_a_number(
    part: tuple[bgars.Capture, bgars.SimulatedTruth, FoundBalls], change: object, reason: str
) -> None:
    capture, _, found = part
    measured = measure_balls(replace(capture, images=change(capture.images)), found)  # type: ignore[operator]
    assert all(np.isnan(ball.top_um) and np.isnan(ball.u_top_um) for ball in measured.balls)
    assert all(reason in ball.reasons[0] for ball in measured.balls)


def test_no_balls_no_numbers(part: tuple[bgars.Capture, bgars.SimulatedTruth, FoundBalls]) -> None:
    measured = measure_balls(part[0], replace(part[2], balls=()))
    assert measured.balls == ()
    assert np.isnan(measured.shadow_residual_rms)


def test_a_sound_capture_has_no_warnings(
    part: tuple[bgars.Capture, bgars.SimulatedTruth, FoundBalls], measured_part: tuple[BallMeasurement, list[float]]
) -> None:
    assert check_shadows(part[0], part[2]) == ()
    assert measured_part[0].warnings == ()


@pytest.mark.parametrize("elevation_deg", [22.0, 65.0])
def test_low_and_high_lights_raise_no_false_alarm(elevation_deg: float) -> None:
    capture, truth, found = photograph(array(4, 5, 11), bgars.LightRig.ring(8, elevation_deg=elevation_deg))
    measured = measure_balls(capture, found)
    assert measured.warnings == ()
    assert rms(errors(measured, truth, "top_um")) < 0.8


def test_small_balls_and_blurred_images() -> None:
    capture, truth, found = photograph(array(4, 4, 12), bgars.LightRig.ring(8), pitch_um=25.0)
    assert rms(errors(measure_balls(capture, found), truth, "top_um")) < 1.0
    capture, truth, found = photograph(array(3, 3, 12), bgars.LightRig.ring(8), pitch_um=10.0, blur_px=2.0)
    assert rms(errors(measure_balls(capture, found), truth, "top_um")) < 1.0
