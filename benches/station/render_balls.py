"""Balls rendered with Mitsuba 3: a judge of `bgars calibrate lights` that shares nothing with it.

    python render_balls.py FOLDER board|grey|matt SEED ...      # a capture and truth.json a seed, 2 to 6 s each

Mirror balls on a board, mirror balls in an evenly grey room, and matt balls on a dark board.

A seed draws eight lamps of 2 degrees at any elevation from 25 to 70 degrees, a ball of about 200 pixels anywhere near
the middle, a chrome or a black one, the board's grey, the exposure and the blur of the lens; noise is 1 level of 8 bit.
A lamp is a thousand times as bright as a board: where the board, and so the outline, is seen, highlights are clipped.
`light` is the direction from the ball's centre.

Needs mitsuba, numpy, scipy and an LLVM.
"""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path

import mitsuba as mi
import numpy as np
from scipy.ndimage import gaussian_filter, median_filter

mi.set_variant("llvm_ad_mono")
SIDE, LAMPS, LAMP_DEG, FAR = 260, 8, 2.0, 1.0e5


def draw(seed: int, kind: str) -> dict:
    """What a seed is."""
    rng = np.random.default_rng([seed, 2024])
    elevation, azimuth = math.radians(rng.uniform(25, 70)), rng.uniform(0, 2 * math.pi) + np.arange(LAMPS) * math.pi / 4
    flat = math.cos(elevation)
    lights = np.column_stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.full(LAMPS, math.sin(elevation))])
    lights += rng.normal(0.0, 0.04, lights.shape)
    return {
        "lights": (lights / np.linalg.norm(lights, axis=1, keepdims=True)).tolist(),
        "ball": [*rng.uniform(-15, 15, 2).tolist(), float(rng.uniform(96, 104))],
        "chrome": bool(rng.random() < 0.6),
        "board": float(rng.uniform(0.1, 0.8)),
        "level": float(10 ** rng.uniform(1.3, 2.5)),
        "blur_px": float(rng.uniform(0.4, 0.9)),
        "kind": kind,
    }


def render(c: dict, light: np.ndarray) -> np.ndarray:
    """Radiance (H, W) under one lamp; a white board straight below it has radiance 1 / pi."""
    transform = mi.ScalarTransform4f
    x, y, radius = c["ball"]
    centre = np.array([x, y, radius])
    half = SIDE / 2.0
    lamp = math.radians(LAMP_DEG / 2.0)
    solid = 2.0 * math.pi * (1.0 - math.cos(lamp))
    disc = transform().look_at(origin=(centre + FAR * light).tolist(), target=centre.tolist(), up=[0.3, 0.2, 1.0])
    mirror = {"type": "conductor", "material": "Cr"}
    if not c["chrome"]:
        mirror = {"type": "roughplastic", "alpha": 0.002, "diffuse_reflectance": 0.002, "int_ior": 1.9}
    scene = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 4},
        "sensor": {
            "type": "orthographic",
            "near_clip": 1.0,
            "far_clip": 4000.0,
            "to_world": transform().look_at(origin=[0, 0, 2000], target=[0, 0, 0], up=[0, 1, 0])
            @ transform().scale([half, half, 1]),
            "film": {
                "type": "hdrfilm",
                "width": SIDE,
                "height": SIDE,
                "pixel_format": "luminance",
                "rfilter": {"type": "box"},
            },
            "sampler": {"type": "multijitter", "sample_count": 81},
        },
        "board": {
            "type": "rectangle",
            "to_world": transform().scale([3000, 3000, 1]),
            "bsdf": {"type": "diffuse", "reflectance": c["board"]},
        },
        "ball": {"type": "sphere", "center": [x, y, radius], "radius": radius, "bsdf": mirror},
        "lamp": {
            "type": "disk",
            "to_world": disc @ transform().scale([FAR * math.tan(lamp)] * 2 + [1]),
            "emitter": {"type": "area", "radiance": 1.0 / solid},
        },
        "room": {"type": "constant", "radiance": 0.004},
    }
    if c["kind"] == "grey":
        del scene["board"]
        scene["room"]["radiance"] = c["board"] / math.pi
    if c["kind"] == "matt":
        scene["board"]["bsdf"]["reflectance"] = 0.05
        scene["ball"]["bsdf"] = {"type": "diffuse", "reflectance": c["board"]}
    return np.array(mi.render(mi.load_dict(scene), seed=1)).reshape(SIDE, SIDE)


def calm(picture: np.ndarray) -> np.ndarray:
    """Without the caustics that a path tracer finds by chance: single bright pixels far from the lamp's own image."""
    usual = median_filter(picture, 5)
    lamp = np.unravel_index(gaussian_filter(picture, 2.0).argmax(), picture.shape)
    rows, cols = np.mgrid[: picture.shape[0], : picture.shape[1]]
    far = np.hypot(rows - lamp[0], cols - lamp[1]) > 12.0
    return np.where(far & (picture > 1.5 * usual + 0.001), usual, picture)


def write(folder: Path, kind: str, seed: int) -> None:
    """Write a capture folder and truth.json."""
    c = draw(seed, kind)
    rng = np.random.default_rng([seed, 7])
    pictures = [gaussian_filter(calm(render(c, np.array(light))), c["blur_px"]) for light in c["lights"]]
    folder.mkdir(parents=True, exist_ok=True)
    # The board's brightest level is exposed for, but a lamp on the ball stands at `level` of the clip level.
    peak = float(np.median([picture.max() for picture in pictures]))
    gain = min(255.0 * c["level"] / peak, 200.0 / max(float(np.percentile(p, 95)) for p in pictures))
    if kind == "matt":
        gain = 230.0 / max(float(p.max()) for p in pictures)
    c["gain_level"] = gain * peak / 255.0
    for index, picture in enumerate(pictures):
        levels = gain * picture + rng.normal(0.0, 1.0, picture.shape)
        grey = np.clip(np.rint(levels), 0, 255).astype(np.uint8)
        mi.Bitmap(grey[..., None]).write(str(folder / f"light_{index}.png"))
    (folder / "capture.toml").write_text('camera = "telecentric"\n', encoding="utf-8")
    (folder / "truth.json").write_text(json.dumps(c, indent=1), encoding="utf-8")


if __name__ == "__main__":
    for text in sys.argv[3:]:
        write(Path(sys.argv[1]) / f"{sys.argv[2]}-{text}", sys.argv[2], int(text))
