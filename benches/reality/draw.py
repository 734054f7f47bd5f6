"""One seed, one part: an ordinary good set-up with 0 to 3 deviations.

python benches/reality/draw.py SEED ...
"""

from __future__ import annotations

import sys
from dataclasses import asdict
from pprint import pprint

import numpy as np
from deviations import DEVIATIONS
from draws import Draws
from setup_records import (
    Board,
    Bulge,
    Camera,
    Coined,
    Defect,
    Lifted,
    Lobe,
    Moved,
    Oval,
    Part,
    Rig,
    Scaled,
    Setup,
    Solder,
    Tilted,
    View,
)

COUNT_SHARES = {0: 0.12, 1: 0.40, 2: 0.30, 3: 0.18}
"""Share of the seeds with so many deviations."""


def draw(seed: int) -> Setup:
    """Draw everything about one part."""
    draws = Draws(seed)
    setup = _ordinary(seed, draws)
    setup.deviations = _names(draws)
    for name in setup.deviations:
        DEVIATIONS[name].apply(draws, setup)
    camera, rig = setup.camera, setup.rig
    if camera.gamma and camera.jpeg_quality is None:
        camera.jpeg_quality = 92
    _defects(draws, setup)
    setup.view.width, setup.view.height = _image_size(setup.part, setup.view.pixel_mm)
    camera.shifts_px = {lamp: shift for lamp, shift in camera.shifts_px.items() if lamp < rig.count}
    if rig.one_off and rig.one_off[0] >= rig.count:
        rig.one_off = None
    return setup


def _ordinary(seed: int, draws: Draws) -> Setup:
    """A good set-up; the arguments are in the order of the draws."""
    uniform = draws.uniform
    diameter_mm = uniform(0.30, 0.65)
    pitch_mm = diameter_mm * uniform(1.5, 1.9)
    pixel_mm = diameter_mm / uniform(34, 60)
    draws.diameter_mm, draws.pitch_mm = diameter_mm, pitch_mm
    part = Part(
        rows=draws.whole(4, 6),
        cols=draws.whole(4, 7),
        diameter_mm=round(diameter_mm, 4),
        pitch_mm=round(pitch_mm, 4),
        height_mm=round(diameter_mm * uniform(0.74, 0.88), 4),
        rotation_deg=uniform(-4, 4, 2),
        centre_mm=(uniform(-0.08, 0.08, 3), uniform(-0.08, 0.08, 3)),
    )
    azimuth_deg, elevation_deg, lamp_deg = uniform(0, 45, 1), uniform(40, 52, 1), uniform(1.0, 3.0, 2)
    board = Board(albedo=uniform(0.06, 0.25, 3), texture=uniform(0.05, 0.3, 2))
    rig = Rig(azimuth_deg, elevation_deg, lamp_deg, error_deg=uniform(0.05, 0.3, 2))
    solder = _solder(draws)
    camera = Camera(noise_levels=uniform(0.3, 1.2, 2))
    return Setup(seed, part, board, solder, rig, View(round(pixel_mm, 5)), camera)


def _solder(draws: Draws) -> Solder:
    uniform = draws.uniform
    first, second = (str(draws.random.choice(["ggx", "beckmann"])) for _ in range(2))
    share = uniform(0.3, 0.7)
    return Solder(
        diffuse=uniform(0.3, 0.6, 3),
        metallic_weight=uniform(0.35, 0.6, 3),
        lobes=(
            Lobe(first, uniform(0.10, 0.2, 3), round(share, 2)),
            Lobe(second, uniform(0.3, 0.45, 3), round(1 - share, 2)),
        ),
        ball_spread=(uniform(0.02, 0.15, 3), uniform(0.02, 0.15, 3), uniform(0.01, 0.1, 3)),
        oxide_spread=(uniform(0.02, 0.12, 3), uniform(0.02, 0.1, 3), uniform(0.01, 0.05, 3)),
    )


def _names(draws: Draws) -> tuple[str, ...]:
    weights = np.array([deviation.weight for deviation in DEVIATIONS.values()], float)
    count = int(draws.random.choice(list(COUNT_SHARES), p=list(COUNT_SHARES.values())))
    names = draws.random.choice(list(DEVIATIONS), size=count, replace=False, p=weights / weights.sum())
    return tuple(str(name) for name in names)


def _defects(draws: Draws, setup: Setup) -> None:
    """Give some balls defects, leave some places empty by design."""
    part, deformed = setup.part, "deformed_balls" in setup.deviations
    left = draws.shuffled(part.ball_names())
    defects = _kinds(draws, part.diameter_mm, deformed=deformed)
    order = draws.random.permutation(len(defects))
    for index in order[: draws.whole(0, 4) + (4 if deformed else 0)]:
        part.defects[left.pop()] = defects[int(index)]
    part.depopulated = tuple(sorted(left[: draws.whole(0, 5)])) if draws.chance(0.4) else ()


def _kinds(draws: Draws, diameter_mm: float, *, deformed: bool) -> list[Defect]:
    uniform = draws.uniform
    kinds: list[Defect] = [
        Scaled(uniform(0.82, 0.93, 3)),
        Scaled(uniform(1.06, 1.15, 3)),
        Coined(round(diameter_mm * uniform(0.05, 0.12), 4)),
        Moved(uniform(0.03, 0.09, 3), uniform(0, 360, 0)),
        Lifted(round(-uniform(0.015, 0.05), 4)),
        Lifted(uniform(0.015, 0.05, 4)),
    ]
    if deformed:
        kinds += [
            Tilted(uniform(0.85, 0.95, 3), uniform(8, 25, 1), uniform(0, 360, 0)),
            Bulge(-uniform(0.06, 0.16, 3), uniform(12, 25, 1), uniform(0, 40, 0), uniform(0, 360, 0)),
            Bulge(uniform(0.04, 0.09, 3), uniform(15, 30, 1), uniform(0, 40, 0), uniform(0, 360, 0)),
            Oval(uniform(1.03, 1.08, 3), uniform(0.92, 0.98, 3), uniform(0, 180, 0)),
        ]
    return kinds


def _image_size(part: Part, pixel_mm: float) -> tuple[int, int]:
    """Width and height (px, multiples of 8) that hold the part and its shadows."""
    wide = (part.cols - 1) * part.pitch_mm + part.diameter_mm
    high = (part.rows - 1) * part.pitch_mm + part.diameter_mm
    turn = np.deg2rad(part.rotation_deg)
    along, across = abs(np.cos(turn)), abs(np.sin(turn))
    margin_mm = 1.15 * part.height_mm + 0.1

    def pixels(side_mm: float) -> int:
        return int(-(-((side_mm + 2 * margin_mm) / pixel_mm) // 8) * 8)

    return pixels(wide * along + high * across), pixels(wide * across + high * along)


if __name__ == "__main__":
    for text in sys.argv[1:]:
        pprint(asdict(draw(int(text))), sort_dicts=False, width=120)
