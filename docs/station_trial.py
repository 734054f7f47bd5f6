"""Ten parts through a simulated station that is wrong in every way that a calibration can find.

Lights up to 3 degrees from where they should be, vignetting of 20 %, unequal LEDs, a response of gamma 1.8, a lens that
distorts by 0.5 %. The station is calibrated on its own pictures of a ball, a board and a grid.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import bgars
import numpy as np
from bgars.errors import BgarsError
from bgars.station import response_from_bracket
from numpy.typing import NDArray
from rendered_spheres import render
from scipy import ndimage

Array = NDArray[np.float64]
SIDE, PITCH_UM, LIGHTS, FULL = 290, 16.0, 8, 255.0
OFF_DEG, VIGNETTING, GAMMA, DISTORTION, NOISE = 3.0, 0.2, 1.8, 0.005, 1.0
GRID_PX = 20.0
CHROME = complex(3.2, 3.3)
"""Refractive index of chromium, which calibration balls are plated with, in green light (Johnson and Christy 1974)."""


@dataclass(frozen=True)
class Hardware:
    """What a station really is."""

    lights: Array
    intensities: Array
    rng: np.random.Generator

    def rig(self) -> bgars.LightRig:
        """The lights as they are."""
        return bgars.LightRig.from_directions(self.lights, intensities=self.intensities)


def hardware(seed: int) -> Hardware:
    """A ring at 45 degrees, as somebody mounted it."""
    rng = np.random.default_rng([seed, 61])
    nominal = bgars.LightRig.ring(LIGHTS).directions
    aside = np.cross(nominal, rng.normal(size=nominal.shape))
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    turn = np.radians(rng.uniform(0.0, OFF_DEG, (LIGHTS, 1)))
    intensities = rng.uniform(0.75, 1.25, LIGHTS)
    return Hardware(np.cos(turn) * nominal + np.sin(turn) * aside, intensities / intensities.mean(), rng)


def spoiled(images: NDArray[np.generic], rng: np.random.Generator) -> NDArray[np.uint8]:
    """Linear images (L, H, W), 1 = full scale, as that camera delivers them."""
    height, width = images.shape[1:]
    rows, cols = np.mgrid[:height, :width].astype(np.float64)
    down, right = rows - (height - 1) / 2.0, cols - (width - 1) / 2.0
    corner2 = (height**2 + width**2) / 4.0
    # A place of the image shows what lies at u of a straight one, where u (1 + k u^2) is that place.
    inverse = np.ones_like(down)
    for _ in range(8):
        inverse = 1.0 / (1.0 + DISTORTION * (down**2 + right**2) * inverse**2 / corner2)
    places = np.stack([(height - 1) / 2.0 + down * inverse, (width - 1) / 2.0 + right * inverse])
    shade = 1.0 - VIGNETTING * (down**2 + right**2) / corner2
    found = []
    for image in images:
        seen = ndimage.map_coordinates(image.astype(np.float64), places, order=3, mode="nearest")
        levels = FULL * np.clip(seen * shade, 0.0, 1.0) ** (1.0 / GAMMA) + rng.normal(0.0, NOISE, seen.shape)
        found.append(np.clip(np.rint(levels), 0, FULL))
    return np.array(found).astype(np.uint8)


def plain(images: NDArray[np.generic], rng: np.random.Generator) -> NDArray[np.uint8]:
    """The same by a camera without any fault but noise."""
    levels = FULL * np.clip(images, 0.0, 1.0) + rng.normal(0.0, NOISE, images.shape)
    return np.clip(np.rint(levels), 0, FULL).astype(np.uint8)


def as_capture(images: NDArray[np.uint8], rig: bgars.LightRig, pitch_um: float | None = None) -> bgars.Capture:
    """A capture by a telecentric camera."""
    mask = np.ones(images.shape[1:], np.bool_)
    return bgars.Capture(
        images, rig, mask, pixel_pitch_um=pitch_um, camera_distance_mm=float("inf"), saturation=FULL, full_scale=FULL
    )


def calibrated(real: Hardware) -> bgars.Station:
    """The station as its own pictures show it."""
    nominal, shape = bgars.LightRig.ring(LIGHTS), (SIDE, SIDE)
    rows, cols = np.mgrid[:SIDE, :SIDE]
    ramp = np.linspace(0.02, 1.0, SIDE)[None, :] * np.ones(shape)
    bracket = [spoiled((ramp * t)[None], real.rng)[0] for t in (0.125, 0.25, 0.5, 1.0)]
    response, _ = response_from_bracket(bracket, [0.125, 0.25, 0.5, 1.0], FULL)
    off = np.hypot((rows + 0.5) % GRID_PX - GRID_PX / 2, (cols + 0.5) % GRID_PX - GRID_PX / 2)
    dots = 0.1 + 0.6 * np.clip(off - 5.0, 0.0, 1.0)
    seen = bgars.Station("trial", response=response)
    grid = bgars.with_station(as_capture(spoiled(dots[None].repeat(LIGHTS, 0), real.rng), nominal), seen)
    scale, _ = bgars.calibrate_scale(grid, GRID_PX * PITCH_UM)
    seen = replace(seen, scale=scale)
    power = real.intensities
    ball = render(
        real.lights,
        ball=(4.0, -3.0, 100.0),
        size=shape,
        noise=0.0,
        bits=16,
        intensities=power,
        blur_px=0.5,
        lamp_level=1.2,
        samples=3,
        refraction=CHROME,
    )
    mirror = as_capture(spoiled(ball / 65535.0, real.rng), nominal)
    lights = bgars.calibrate_lights(bgars.with_station(mirror, seen), "mirror", near=False)
    board = 0.6 * (power * real.lights[:, 2] / (power * real.lights[:, 2]).max())[:, None, None] * np.ones(shape)
    flat, _ = bgars.calibrate_flat(
        bgars.with_station(as_capture(spoiled(board, real.rng), nominal), bgars.Station("trial", response=response))
    )
    return replace(seen, lights=lights, flat=flat)


def part(real: Hardware, seed: int) -> tuple[NDArray[np.float64], bgars.SimulatedTruth]:
    """Linear images, 1 = full scale, and truth of a part of nine balls."""
    scene = bgars.Scene.ball_array(3, 3, height_um=500.0, jitter=bgars.Jitter(8.0, 6.0, 8.0), seed=seed)
    camera = bgars.Camera(pixel_pitch_um=PITCH_UM, shape=(SIDE, SIDE), bit_depth=16, supersample=2, blur_px=0.5)
    capture, truth = bgars.simulate(scene, real.rig(), bgars.Material(), camera)
    return capture.images / 65535.0, truth


def errors_um(capture: bgars.Capture, truth: bgars.SimulatedTruth) -> Array:
    """(N, 4) errors of height, diameter, x and y of the balls that were measured, micrometres."""
    rows = []
    for ball in bgars.inspect(capture).balls:
        near = min(truth.balls, key=lambda one: np.hypot((one.x_um or 1e9) - ball.x_um, (one.y_um or 1e9) - ball.y_um))
        rows.append([getattr(ball, key) - getattr(near, key) for key in ("top_um", "diameter_um", "x_um", "y_um")])
    found = np.array(rows)
    return found[np.isfinite(found).all(axis=1)]


@dataclass(frozen=True)
class Trial:
    """Root mean square errors over all balls, micrometres: height, diameter, x, y; and how many were measured."""

    name: str
    rms_um: Array
    balls: int


def trial(parts: int, seed: int = 0) -> list[Trial]:
    """The same parts by exact knowledge, by the calibrated station, and by what was declared."""
    real = hardware(seed)
    station = calibrated(real)
    nominal = bgars.LightRig.ring(LIGHTS)
    found: dict[str, list[Array]] = {
        "exact knowledge, perfect camera": [],
        "calibrated station": [],
        "uncalibrated": [],
    }
    for number in range(parts):
        images, truth = part(real, 6100 + 100 * seed + number)
        noise = np.random.default_rng([seed, number])
        seen = spoiled(images, noise)
        captures = {
            "exact knowledge, perfect camera": as_capture(plain(images, noise), real.rig(), PITCH_UM),
            "calibrated station": bgars.with_station(as_capture(seen, nominal), station),
            "uncalibrated": as_capture(seen, nominal, PITCH_UM),
        }
        for name, capture in captures.items():
            try:
                found[name].append(errors_um(capture, truth))
            except BgarsError:
                found[name].append(np.zeros((0, 4)))
    rows = []
    for name, errors in found.items():
        every = np.concatenate(errors)
        rms = np.sqrt(np.mean(every**2, axis=0)) if len(every) else np.full(4, np.nan)
        rows.append(Trial(name, rms, len(every)))
    return rows


def unit(vectors: Array) -> Array:
    """Rows of length 1."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def dome(height: Array, x: Array, y: Array) -> float:
    """Range of heights at places (x, y) about their best plane."""
    plane = np.column_stack([np.ones(len(height)), x, y])
    return float(np.ptp(height - plane @ np.linalg.lstsq(plane, height, rcond=None)[0]))
