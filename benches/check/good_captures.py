"""Good captures to be silent on, and to put faults into: simulated arrays and reliefs, rendered scenes and parts."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import bgars
import numpy as np
from bgars.records.plain_arrays import every_pixel
from numpy.typing import NDArray

__all__ = ["CHOSEN_ON", "FAULTY", "JUDGED_ON", "captures", "deviations", "rendered", "turned"]

RENDERED_CHOSEN = ("1", "10", "11", "12", "13", "14", "15", "16", "17", "18", "19", "2")
RENDERED_JUDGED = ("20", "21", "22", "23", "24", "3", "4", "5", "6", "7", "8", "9")
FAULTY = {
    # What the renderer's camera does wrong on purpose, and what a check should call it.
    "ambient": "ambient",
    "glare": "ambient",
    "no_dark": "ambient",
    "undeclared_gamma": "response",
    "flicker": "ambient",
    "intensities": "lamp-uneven",
    "shift_one": "motion",
    "shift_half": "motion",
    "noise": "noise",
    "overexposed": "clipped",
    "underexposed": "dark",
}
"""Deviations of rendered parts that are faults of the capture: such parts are no good captures."""
CHOSEN_ON = "chosen"
JUDGED_ON = "judged"
SIMULATED = 42
RELIEFS = 36
DOMES = 20


def captures(which: str) -> Iterator[tuple[str, bgars.Capture]]:
    """Yield names and captures: a hundred, other ones for choosing thresholds than for judging."""
    judged = which == JUDGED_ON
    start = 90_000 if judged else 1000
    for seed in range(start, start + SIMULATED):
        yield f"array {seed}", array(seed)
    for seed in range(start, start + RELIEFS):
        yield f"relief {seed}", relief(seed)
    for seed in range(start, start + DOMES):
        yield f"dome {seed}", array(seed, _dome)
    for folder in rendered(which):
        if deviations(folder) & set(FAULTY):
            continue
        capture = bgars.read_capture(folder)
        for quarter in range(3):
            yield f"rendered part {folder.name}, turned {90 * quarter}", turned(capture, quarter)


def rendered(which: str) -> list[Path]:
    """Folders of rendered parts: for judging, those of BGARS_RENDERED where it is set (seeds nobody has looked at)."""
    fresh, data = os.environ.get("BGARS_RENDERED"), os.environ.get("BGARS_DATA")
    if which == JUDGED_ON and fresh is not None:
        return sorted(path.parent for path in Path(fresh).glob("*/scene.json"))
    if data is None:
        return []
    names = RENDERED_JUDGED if which == JUDGED_ON else RENDERED_CHOSEN
    return [Path(data) / "reality" / name for name in names]


def deviations(folder: Path) -> set[str]:
    """What a rendered part deviates in, as its scene.json says."""
    return set(json.loads((folder / "scene.json").read_text(encoding="utf-8"))["deviations"])


def array(seed: int, lights: Callable[[np.random.Generator], bgars.LightRig] | None = None) -> bgars.Capture:
    """A simulated array of balls on a board, under an even ring or other lights."""
    random = np.random.default_rng(seed)
    rows, cols = random.integers(2, 6, 2)
    texture = bgars.Texture(
        contrast=float(random.uniform(0.05, 0.4)), scale_um=float(random.uniform(100, 600)), seed=seed
    )
    board = bgars.Board(
        material=bgars.Material.matte(float(random.uniform(0.08, 0.4))),
        tilt_x_deg=float(random.uniform(-1.5, 1.5)),
        tilt_y_deg=float(random.uniform(-1.5, 1.5)),
        texture=texture,
    )
    scene = bgars.Scene.ball_array(
        int(rows),
        int(cols),
        pitch_um=1000.0,
        diameter_um=float(random.uniform(350, 650)),
        height_um=float(random.uniform(220, 340)),
        rotation_deg=float(random.uniform(-8, 8)),
        board=board,
        seed=seed,
    )
    material = bgars.Material(
        i_d=float(random.uniform(0.1, 0.5)),
        i_s=float(random.uniform(0.1, 0.9)),
        hardness=float(random.uniform(10, 60)),
    )
    camera = bgars.Camera(
        pixel_pitch_um=float(random.uniform(8, 14)),
        bit_depth=8 if random.random() < 0.6 else 12,
        full_well_e=float(random.uniform(8000, 30000)),
        read_noise_levels=float(random.uniform(0.3, 0.8)),
        supersample=2,
        blur_px=float(random.uniform(0.4, 0.9)),
    )
    camera = replace(camera, read_noise_levels=camera.read_noise_levels * camera.full_scale / 255.0)
    rig = (_ring if lights is None else lights)(random)
    capture, _ = bgars.simulate(scene, rig, material, camera, seed=seed, threads=1)
    return _mislaid(capture, random, 0.7, 0.02)


def _ring(random: np.random.Generator) -> bgars.LightRig:
    return bgars.LightRig.ring(
        int(random.choice([6, 8, 8, 8, 12])),
        elevation_deg=float(random.uniform(38, 62)),
        azimuth0_deg=float(random.choice([0.0, 0.0, 22.5])),
    )


def _dome(random: np.random.Generator) -> bgars.LightRig:
    """Lights anywhere between 24 and 76 degrees of elevation, 12 degrees apart at least."""
    count = int(random.choice([8, 9, 10, 12, 16, 20]))
    directions: list[NDArray[np.float64]] = []
    while len(directions) < count:
        azimuth, height = float(random.uniform(0.0, 2.0 * np.pi)), float(random.uniform(0.4, 0.97))
        flat = (1.0 - height**2) ** 0.5
        light = np.array([flat * np.cos(azimuth), flat * np.sin(azimuth), height])
        if all(light @ other < np.cos(np.radians(12.0)) for other in directions):
            directions.append(light)
    return bgars.LightRig.from_directions(np.array(directions))


def relief(seed: int) -> bgars.Capture:
    """A relief of gentle slopes, such as a coin: mostly matt, texture of albedo, noise; lights all over a dome."""
    random = np.random.default_rng(seed)
    shape = (int(random.integers(180, 420)), int(random.integers(180, 420)))
    height = _clouds(random, shape, float(random.uniform(12, 45)))
    p, q = np.gradient(height, axis=1), -np.gradient(height, axis=0)
    steepness = float(random.uniform(0.15, 0.5)) / float(np.hypot(p, q).std())
    normal = np.stack([-p * steepness, -q * steepness, np.ones(shape)])
    normal /= np.sqrt((normal**2).sum(axis=0))
    count = int(random.choice([6, 8, 8, 12, 16]))
    azimuth = 360.0 / count * np.arange(count) + random.normal(0.0, 4.0, count)
    spread = float(random.choice([0.5, 6.0]))
    elevation = np.clip(float(random.uniform(42, 60)) + random.normal(0.0, spread, count), 25.0, 80.0)
    rig = bgars.LightRig.from_angles(np.column_stack([azimuth, elevation]))
    albedo = float(random.uniform(0.3, 0.6)) * np.exp(0.35 * _clouds(random, shape, float(random.uniform(4, 20))))
    facing = np.tensordot(rig.directions, normal, axes=(1, 0))
    half = rig.directions + np.array([0.0, 0.0, 1.0])
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    shine = np.maximum(np.tensordot(half, normal, axes=(1, 0)), 0.0) ** float(random.uniform(20, 80))
    signal = np.maximum(facing, 0.0) * albedo + float(random.uniform(0.0, 0.15)) * shine * (facing > 0)
    well = float(random.uniform(6000, 25000))
    signal = random.poisson(np.clip(signal, 0, 1) * well) / well + random.normal(0, 0.002, signal.shape)
    images = np.rint(np.clip(signal, 0, 1) * 255).astype(np.uint8)
    capture = bgars.Capture(images, rig, every_pixel(shape), saturation=255.0, full_scale=255.0)
    return _mislaid(capture, random, 0.7, 0.02)


def turned(capture: bgars.Capture, quarter: int) -> bgars.Capture:
    """The capture turned by quarters, counter-clockwise, with its table of lights: as good as before."""
    if quarter == 0:
        return capture
    angle = np.pi / 2 * quarter
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    rig = bgars.LightRig.from_directions(capture.rig.directions @ turn.T, intensities=capture.rig.intensities)
    images = np.ascontiguousarray(np.rot90(capture.images, quarter, axes=(1, 2)))
    dark = None if capture.dark is None else np.ascontiguousarray(np.rot90(capture.dark, quarter))
    return replace(capture, images=images, rig=rig, dark=dark, mask=every_pixel(images.shape[1:]), files=())


def _mislaid(capture: bgars.Capture, random: np.random.Generator, u_deg: float, u_intensity: float) -> bgars.Capture:
    """What every table is: right to half a degree or so, and to some percent."""
    directions = capture.rig.directions + random.normal(0.0, np.radians(u_deg), capture.rig.directions.shape)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    intensities = 1.0 + random.normal(0.0, u_intensity, len(directions))
    return replace(capture, rig=bgars.LightRig.from_directions(directions, intensities=intensities))


def _clouds(random: np.random.Generator, shape: tuple[int, int], size_px: float) -> NDArray[np.float64]:
    """Smooth random field of unit standard deviation."""
    rows, cols = np.fft.fftfreq(shape[0])[:, None], np.fft.rfftfreq(shape[1])[None, :]
    filtered = np.fft.rfft2(random.normal(size=shape)) * np.exp(
        -2.0 * (np.pi * size_px / 2.5) ** 2 * (rows**2 + cols**2)
    )
    field = np.fft.irfft2(filtered, shape)
    return (field - field.mean()) / field.std()
