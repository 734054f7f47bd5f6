"""The camera's curve: with a black level, and with a shoulder or a knee near full scale."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import bgars
import imageio.v3 as iio
import numpy as np
import pytest
from bgars.station import response_from_bracket, response_from_sums
from bgars.station.levels import linear_levels
from bgars.station.response import SEGMENTS, _doubts
from numpy.typing import NDArray
from test_calibrate import bgars_command
from test_station_lights import capture_of

Array = NDArray[np.float64]
TIMES = (0.25, 0.5, 1.0, 2.0)


def scene(seed: int) -> tuple[Array, np.random.Generator]:
    rng = np.random.default_rng(seed)
    return np.exp(rng.uniform(np.log(0.01), 0.0, (120, 160))), rng


def seen(camera: Callable[[Array], Array], light: Array, black: float, rng: np.random.Generator) -> NDArray[np.uint8]:
    levels = black + (255.0 - black) * camera(np.minimum(light, 1.0)) + rng.normal(0.0, 1.0, light.shape)
    return np.clip(np.rint(levels), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("gamma", [1.0, 2.2])
def test_a_black_level_is_no_part_of_the_curve(tmp_path: Path, gamma: float) -> None:
    """A linear camera with a pedestal of 20 was called one of gamma 1.31; dark.png was not looked at."""
    light, rng = scene(3)
    place = tmp_path / "station.toml"

    def camera(light: Array) -> Array:
        return light ** (1.0 / gamma)

    folder = tmp_path / "bracket"
    folder.mkdir()
    dark = seen(camera, 0.0 * light, 20.0, rng)
    for index, time in enumerate(TIMES):
        iio.imwrite(folder / f"image{index}.png", seen(camera, light * time, 20.0, rng))
    iio.imwrite(folder / "dark.png", dark)
    run = bgars_command("calibrate", "response", folder, "-o", place, "--exposures", "0.25,0.5,1,2")
    assert run.code == 0, run.stderr
    assert "above the black level of 20" in run.stdout
    curve = bgars.read_station(place).response
    assert curve is not None
    if gamma == 1.0:
        assert curve.nonlinearity < 0.01
    # Read as parts are: what the dark frame becomes on the curve is subtracted after it.
    images = np.stack([seen(camera, light * time, 20.0, rng) for time in (0.3, 0.6, 0.9)])
    capture = bgars.with_station(capture_of(images, dark=dark), bgars.Station(response=curve))
    means = linear_levels(capture).images.mean(axis=(1, 2))
    np.testing.assert_allclose(means / means[1], [0.5, 1.0, 1.5], atol=0.01)


def test_a_black_level_of_which_nothing_is_said_is_doubted() -> None:
    light, rng = scene(4)
    shots = [seen(lambda light: light, light * time, 20.0, rng) for time in TIMES]
    _, findings = response_from_bracket(shots, TIMES, 255.0)
    assert {one.code for one in findings if one.severity == "doubt"} >= {"black-level"}
    for camera in (lambda light: light, lambda light: light ** (1 / 2.2), lambda light: light**1.3):
        shots = [seen(camera, light * time, 0.0, rng) for time in TIMES]
        assert "black-level" not in {one.code for one in response_from_bracket(shots, TIMES, 255.0)[1]}


@pytest.mark.parametrize(
    "camera",
    [
        lambda light: np.where(light < 0.6, 1.2 * light, 0.72 + 0.7 * (light - 0.6)),
        lambda light: (1.0 - np.exp(-2.0 * light)) / (1.0 - np.exp(-2.0)),
        lambda light: (0.5 * light**0.5 + 0.5 * (3.0 * light**2 - 2.0 * light**3)) ** 0.9,
    ],
)
def test_a_shoulder_near_full_scale_is_followed(camera: Callable[[Array], Array]) -> None:
    """One power law from 0.6 of full scale on left 2 to 4 % of it, at a stated 0.2 to 0.8 %."""
    light, rng = scene(5)
    one, other = rng.uniform(0.01, 0.8, (2, 120, 160))
    shots = [seen(camera, light * time, 0.0, rng) for time in TIMES]
    true = np.linspace(0.05, 0.9, 100)
    for curve, _ in (
        response_from_bracket(shots, TIMES, 255.0),
        response_from_sums(*(seen(camera, each, 0.0, rng) for each in (one, other, one + other)), 255.0),
    ):
        found = np.interp(camera(true), curve.levels, curve.radiances)
        error = np.abs(found * (true @ found) / (found @ found) - true).max()
        assert error < 0.012
        assert error < 3.0 * curve.u_radiance


def test_what_no_curve_explains_is_doubted() -> None:
    light, rng = scene(6)
    shots = [seen(lambda light: light, light * time, 0.0, rng) for time in (0.25, 0.5, 1.2, 2.0)]
    curve, findings = response_from_bracket(shots, TIMES, 255.0)
    assert "response-structure" in {one.code for one in findings if one.severity == "doubt"}
    assert curve.u_radiance > 0.01


@pytest.mark.parametrize(("order", "name"), [((2, 0, 1), "a"), ((1, 2, 0), "b")])
def test_sums_in_another_order_are_refused(order: tuple[int, ...], name: str) -> None:
    """Gamma 0.05, and 'linear within 84 %'."""
    a, b = (
        light * np.random.default_rng(8).uniform(0.3, 0.45, (80, 100)) for light in (np.ones(100), np.ones((80, 1)))
    )
    images = [np.rint(255.0 * each) for each in (a, 0.8 * b, a + 0.8 * b)]
    with pytest.raises(bgars.CalibrationError, match=f"no brighter than that of light {name}: give them as a, b, both"):
        response_from_sums(*(images[at] for at in order), 255.0)


def test_a_curve_that_explains_nothing_is_refused() -> None:
    with pytest.raises(bgars.CalibrationError, match=r"no curve explains the levels: up to 30\.0 %"):
        _doubts(np.ones(SEGMENTS), np.ones((10, 3)), 0.3, 0.0)
