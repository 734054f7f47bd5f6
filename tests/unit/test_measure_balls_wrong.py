"""Captures whose images, lights or arguments cannot be right are refused or named before anything is measured."""

from __future__ import annotations

from dataclasses import replace

import bgars
import numpy as np
import pytest
from bgars.inspection import check_shadows, measure_balls
from bgars.records.found_balls import FoundBalls
from measured_captures import errors, rms, sixteen_balls
from numpy.typing import NDArray


@pytest.fixture(scope="module")
def part() -> tuple[bgars.Capture, bgars.SimulatedTruth, FoundBalls]:
    return sixteen_balls()


def swapped(images: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return images[[0, 1, 5, 3, 4, 2, 6, 7]]


def doubled(images: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return images[[0, 1, 2, 2, 4, 5, 6, 7]]


def noisily_doubled(images: NDArray[np.uint8]) -> NDArray[np.uint8]:
    again = doubled(images)
    again[3] = np.clip(again[3].astype(int) + np.random.default_rng(0).integers(-1, 2, again[3].shape), 0, 255)
    return again


def far_shifted(images: NDArray[np.uint8]) -> NDArray[np.uint8]:
    moved = images.copy()
    moved[4] = np.roll(images[4], 12, axis=1)
    return moved


def shifted(images: NDArray[np.uint8]) -> NDArray[np.uint8]:
    moved = images.copy()
    moved[4] = np.roll(images[4], 2, axis=1)
    return moved


@pytest.mark.parametrize(
    ("change", "error", "text"),
    [
        (swapped, bgars.CalibrationError, r"images 2 \(counted from 0\) and 5 \(counted from 0\) are swapped"),
        (doubled, bgars.InputError, "same picture"),
        (
            noisily_doubled,
            bgars.CalibrationError,
            r"image 3 \(counted from 0\) has the shadows of light 2 \(counted from 0\)",
        ),
        (far_shifted, bgars.CalibrationError, r"image 4 \(counted from 0\) is shifted"),
    ],
)
def test_images_that_do_not_belong_are_refused(
    part: tuple[bgars.Capture, bgars.SimulatedTruth, FoundBalls],
    change: object,
    error: type[Exception],
    text: str,
) -> None:
    capture, _, found = part
    wrong = replace(capture, images=change(capture.images))  # type: ignore[operator]
    with pytest.raises(error, match=text):
        check_shadows(wrong, found)
    with pytest.raises(error, match=text):
        measure_balls(wrong, found)


def test_a_shift_of_two_pixels_is_refused(part: tuple[bgars.Capture, bgars.SimulatedTruth, FoundBalls]) -> None:
    capture, _, found = part
    with pytest.raises(bgars.CalibrationError, match=r"image 4 \(counted from 0\) is shifted by"):
        measure_balls(replace(capture, images=shifted(capture.images)), found)


def test_a_light_six_degrees_off_is_named_and_measured(
    part: tuple[bgars.Capture, bgars.SimulatedTruth, FoundBalls],
) -> None:
    capture, truth, found = part
    angles = np.column_stack([capture.rig.azimuths_deg, capture.rig.elevations_deg])
    angles[1, 1] += 6.0
    measured = measure_balls(replace(capture, rig=bgars.LightRig.from_angles(angles)), found)
    assert any("light 1 (counted from 0)" in warning for warning in measured.warnings)
    assert measured.light_change_deg[1] == pytest.approx(6.0, abs=0.1)
    assert rms(errors(measured, truth, "top_um")) < 0.8


def test_a_light_twenty_degrees_off_is_refused(part: tuple[bgars.Capture, bgars.SimulatedTruth, FoundBalls]) -> None:
    capture, _, found = part
    angles = np.column_stack([capture.rig.azimuths_deg, capture.rig.elevations_deg])
    angles[1, 0] += 25.0
    with pytest.raises(bgars.CalibrationError, match=r"light 1 \(counted from 0\) stands about"):
        check_shadows(replace(capture, rig=bgars.LightRig.from_angles(angles)), found)


def test_bad_arguments_are_named(part: tuple[bgars.Capture, bgars.SimulatedTruth, FoundBalls]) -> None:
    capture, _, found = part
    with pytest.raises(bgars.InputError, match="pixel_pitch_um"):
        measure_balls(replace(capture, pixel_pitch_um=None), found)
    with pytest.raises(bgars.InputError, match="threads"):
        measure_balls(capture, found, threads=0)
    outside = replace(found, balls=(replace(found.balls[0], x_px=1e4),))
    with pytest.raises(bgars.InputError, match=found.balls[0].name):
        measure_balls(capture, outside)
    with pytest.raises(bgars.InputError, match="u_centre_px"):
        measure_balls(capture, replace(found, balls=(replace(found.balls[0], u_centre_px=0.0),)))
    field = bgars.estimate_normals(capture.images[:, :50, :50], capture.rig.directions)
    with pytest.raises(bgars.InputError, match="field"):
        measure_balls(capture, found, field=field)
