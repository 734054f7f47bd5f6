"""A station that is simulated: parts drop into an inbox, three of them with a defect."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import imageio.v3 as iio

from bgars.records.rig import LightRig
from bgars.simulate import Camera, Defect, Jitter, Material, Scene, SimulationSetup, simulate

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["PARTS", "RECIPE", "RIG", "defects_of", "drop_part", "serial_of"]

PARTS = 50
LIGHTS = 8
RECIPE = """\
name = "demo 3x3"
rows = 3
cols = 3
pitch_um = 1000.0
diameter_um = 600.0
height_um = 500.0

[limits]
true_position_um = 50.0
diameter_um = [560.0, 640.0]
height_um = [460.0, 540.0]
seating_coplanarity_um = 80.0
"""
RIG = f"""\
pixel_pitch_um = 16.0
response = "linear"

[lights]
ring = {{ count = {LIGHTS}, elevation_deg = 45.0 }}

[part]
station = "demo"
"""


def defects_of(number: int, parts: int) -> Mapping[str, Defect]:
    """Return the defects of a part: one in a quarter, the middle, and the last quarter of the lot.

    Examples
    --------
    >>> [number for number in range(50) if defects_of(number, 50)]
    [12, 25, 37]
    """
    return {
        parts // 4: {"B2": Defect.missing()},
        parts // 2: {"B2": Defect.missing()},
        3 * parts // 4: {"C1": Defect.missing()},
    }.get(number, {})


def serial_of(number: int) -> str:
    """Serial number of a part.

    Examples
    --------
    >>> serial_of(0)
    'SN0001'
    """
    return f"SN{number + 1:04d}"


def drop_part(inbox: Path, number: int, parts: int) -> None:
    """Do as a camera's software does: make a folder, and write one image after the other into it.

    The process drifts a little: balls get taller by 12 um over the lot.
    """
    scene = Scene.ball_array(
        3,
        3,
        height_um=494.0 + 12.0 * number / max(parts - 1, 1),
        jitter=Jitter(4.0, 1.0, 2.0),
        defects=defects_of(number, parts),
        seed=number + 1,
    )
    camera = Camera(pixel_pitch_um=16.0, shape=(290, 290))
    setup = SimulationSetup(scene, LightRig.ring(LIGHTS), Material(), camera)
    capture, _ = simulate(setup.scene, setup.rig, setup.material, setup.camera)
    folder = inbox / serial_of(number)
    folder.mkdir()
    for light, image in enumerate(capture.images):
        temporary = folder / f".light_{light:02d}.png.partial"
        iio.imwrite(temporary, image, extension=".png")
        temporary.replace(folder / f"light_{light:02d}.png")
