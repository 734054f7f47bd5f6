"""What a factory has and a model has not: each deviation, from which range it is drawn, and how often.

The order of the functions is part of the draw.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from draws import Draws
from setup_records import ReliefSizes, Setup

Apply = Callable[[Draws, Setup], None]


class Deviation(NamedTuple):
    """How often it is drawn, and what it does to a setup; its docstring says what it is."""

    weight: int
    apply: Apply

    @property
    def meaning(self) -> str:
        """One line."""
        return (self.apply.__doc__ or "").rstrip(".")


DEVIATIONS: dict[str, Deviation] = {}


def _weight(weight: int) -> Callable[[Apply], Apply]:
    def register(apply: Apply) -> Apply:
        DEVIATIONS[apply.__name__] = Deviation(weight, apply)
        return apply

    return register


@_weight(2)
def noise(draws: Draws, setup: Setup) -> None:
    """Noise of 2 to 4 grey levels."""
    setup.camera.noise_levels = draws.uniform(2, 4, 1)


@_weight(2)
def lights_off(draws: Draws, setup: Setup) -> None:
    """Each lamp off by 0.7 to 2.5 degrees, one perhaps by up to 6."""
    setup.rig.error_deg = draws.uniform(0.7, 2.5, 2)
    setup.rig.one_off = (draws.whole(0, 8), draws.uniform(2.5, 6, 1)) if draws.chance(0.5) else None


@_weight(1)
def intensities(draws: Draws, setup: Setup) -> None:
    """Lamps up to 8 to 25 % brighter or darker than declared."""
    setup.camera.intensity_spread = draws.uniform(0.08, 0.25, 2)


@_weight(2)
def perspective(draws: Draws, setup: Setup) -> None:
    """An ordinary lens, 20 to 200 mm away."""
    setup.view.distance_mm = round(float(np.exp(draws.uniform(np.log(20), np.log(200)))), 1)


@_weight(2)
def extended_lamps(draws: Draws, setup: Setup) -> None:
    """Ring segments, 6 to 30 degrees long and 4 to 12 high."""
    setup.rig.segment_deg = draws.uniform(6, 30, 1), draws.uniform(4, 12, 1)


@_weight(1)
def ambient(draws: Draws, setup: Setup) -> None:
    """Ambient light that is not in the dark frame."""
    setup.camera.ambient_levels = draws.uniform(2, 10, 1)


@_weight(2)
def dark_glossy_board(draws: Draws, setup: Setup) -> None:
    """A dark, glossy board with silk screen, pads and bare copper."""
    setup.board.kind = "glossy"
    setup.board.albedo = draws.uniform(0.012, 0.05, 4)
    setup.board.gloss = draws.uniform(0.1, 0.3, 2)


@_weight(3)
def relief(draws: Draws, setup: Setup) -> None:
    """Board relief: traces, a second layer of mask, openings of 6 to 20 um."""
    setup.board.relief = ReliefSizes(
        trace_mm=draws.uniform(0.008, 0.02, 4),
        step_mm=draws.uniform(0.006, 0.018, 4),
        opening_mm=draws.uniform(0.008, 0.02, 4),
        edge_mm=draws.uniform(0.006, 0.014, 4),
        trace_width_mm=round(draws.pitch_mm * draws.uniform(0.08, 0.14), 3),
        pad_radius_mm=round(draws.diameter_mm * draws.uniform(0.34, 0.42), 3),
    )


@_weight(2)
def dirt(draws: Draws, setup: Setup) -> None:
    """Flux, scratches, burnt spots, oxide, dust fibres."""
    setup.board.fibres = draws.whole(2, 10)
    setup.solder.dirty = True
    setup.solder.ball_spread = (0.25, 0.25, 0.15)
    setup.solder.oxide_spread = (0.18, 0.15, 0.08)


@_weight(2)
def defocus_vignetting(draws: Draws, setup: Setup) -> None:
    """Blur that grows with height, corners up to 25 % darker."""
    setup.camera.defocus_px = draws.uniform(0.4, 0.7, 2), draws.uniform(0.9, 2.2, 2)
    setup.camera.vignetting = draws.uniform(0.05, 0.25, 2)


@_weight(1)
def undeclared_gamma(_draws: Draws, setup: Setup) -> None:
    """An sRGB JPEG that is declared linear."""
    setup.camera.gamma = True


@_weight(1)
def shift_one(draws: Draws, setup: Setup) -> None:
    """One image shifted by up to 0.8 px on each axis."""
    setup.camera.shifts_px = {draws.whole(0, 8): (draws.uniform(-0.8, 0.8, 2), draws.uniform(-0.8, 0.8, 2))}


@_weight(1)
def shift_half(draws: Draws, setup: Setup) -> None:
    """The part moved by up to 0.5 px on each axis halfway through."""
    shift = draws.uniform(-0.5, 0.5, 2), draws.uniform(-0.5, 0.5, 2)
    setup.camera.shifts_px = dict.fromkeys(range(draws.whole(3, 6), 8), shift)


@_weight(2)
def all_squashed(draws: Draws, setup: Setup) -> None:
    """All balls lower than wide: aspect ratio 0.90 to 0.995."""
    setup.part.squash = draws.uniform(0.90, 0.995, 4)


@_weight(2)
def deformed_balls(_draws: Draws, _setup: Setup) -> None:
    """Four more balls with defects: tilted, dented, bumped, oval ones too."""


@_weight(1)
def few_lights(draws: Draws, setup: Setup) -> None:
    """4, 5 or 6 lamps."""
    setup.rig.count = draws.one_of([4, 5, 6])


@_weight(1)
def many_lights(draws: Draws, setup: Setup) -> None:
    """12 or 16 lamps."""
    setup.rig.count = draws.one_of([12, 16])


@_weight(1)
def low_lights(draws: Draws, setup: Setup) -> None:
    """Lamps at 22 to 35 degrees."""
    setup.rig.elevation_deg = draws.uniform(22, 35, 1)


@_weight(2)
def high_lights(draws: Draws, setup: Setup) -> None:
    """Lamps at 55 to 68 degrees."""
    setup.rig.elevation_deg = draws.uniform(55, 68, 1)


@_weight(3)
def metal(draws: Draws, setup: Setup) -> None:
    """Bare metal, exposed for its highlights."""
    setup.solder.metallic_weight = draws.uniform(0.93, 0.98, 3)
    setup.solder.path_segments = 5
    setup.camera.exposed_for = "highlights"
    setup.camera.noise_levels = draws.uniform(0.3, 0.8, 2)


@_weight(1)
def coarse(draws: Draws, setup: Setup) -> None:
    """Balls of 18 to 26 pixels."""
    setup.view.pixel_mm = round(setup.part.diameter_mm / draws.uniform(18, 26), 5)


@_weight(1)
def fine_pitch(draws: Draws, setup: Setup) -> None:
    """A pitch of 1.28 to 1.45 diameters."""
    setup.part.pitch_mm = round(setup.part.diameter_mm * draws.uniform(1.28, 1.45), 4)


@_weight(1)
def turned(draws: Draws, setup: Setup) -> None:
    """The part turned by 8 to 45 degrees."""
    setup.part.rotation_deg = round(draws.uniform(8, 45) * draws.sign(), 1)


@_weight(1)
def white_board(draws: Draws, setup: Setup) -> None:
    """A white board, exposed for it."""
    setup.board.kind = "matte"
    setup.board.albedo = draws.uniform(0.5, 0.8, 2)
    setup.board.texture = 0.03
    setup.camera.exposed_for = "board"


@_weight(1)
def copper_board(_draws: Draws, setup: Setup) -> None:
    """Bare copper, exposed for it."""
    setup.board.kind = "copper"
    setup.board.texture = 0.1
    setup.camera.exposed_for = "board"


@_weight(2)
def tilt_bow(draws: Draws, setup: Setup) -> None:
    """A board that is tilted and bowed by up to 0.04 mm."""
    setup.board.tilt = draws.uniform(-0.02, 0.02, 4), draws.uniform(-0.02, 0.02, 4)
    setup.board.bow_mm = draws.uniform(-0.04, 0.04, 4)


@_weight(1)
def glare(draws: Draws, setup: Setup) -> None:
    """Veiling glare of 2 to 6 %."""
    setup.camera.glare = draws.uniform(0.02, 0.06, 3)


@_weight(1)
def distortion(draws: Draws, setup: Setup) -> None:
    """Lens distortion of up to 0.6 % in the corner."""
    setup.camera.distortion = draws.uniform(-0.006, 0.006, 4)


@_weight(1)
def pixel_pitch_off(draws: Draws, setup: Setup) -> None:
    """The size of a pixel declared wrong by up to 0.8 %."""
    setup.camera.pitch_factor = round(1 + draws.uniform(-0.008, 0.008), 4)


@_weight(2)
def rig_off_together(draws: Draws, setup: Setup) -> None:
    """All lamps declared up to 1.5 degrees too high or too low."""
    setup.camera.raised_deg = draws.uniform(-1.5, 1.5, 2)


@_weight(1)
def no_dark(_draws: Draws, setup: Setup) -> None:
    """No dark frame declared."""
    setup.camera.dark_frame = False


@_weight(1)
def flicker(draws: Draws, setup: Setup) -> None:
    """Ambient light that flickers."""
    setup.camera.flicker_levels = draws.uniform(2, 8, 1)


@_weight(1)
def jpeg(draws: Draws, setup: Setup) -> None:
    """JPEG of quality 70 to 95."""
    setup.camera.jpeg_quality = draws.whole(70, 96)


@_weight(1)
def overexposed(draws: Draws, setup: Setup) -> None:
    """1.6 to 4 times as bright, clipped."""
    setup.camera.gain = draws.uniform(1.6, 4.0, 2)


@_weight(1)
def underexposed(draws: Draws, setup: Setup) -> None:
    """Exposed to 15 to 50 %."""
    setup.camera.gain = draws.uniform(0.15, 0.5, 2)


@_weight(1)
def strip(draws: Draws, setup: Setup) -> None:
    """3 rows of 10 to 17 small balls."""
    setup.part.rows, setup.part.cols = 3, draws.whole(10, 18)
    setup.view.pixel_mm = round(setup.part.diameter_mm / draws.uniform(22, 30), 5)


@_weight(1)
def small_caps(draws: Draws, setup: Setup) -> None:
    """Bumps lower than half a ball: the outline is where they meet the board."""
    setup.part.height_mm = round(setup.part.diameter_mm * draws.uniform(0.25, 0.45), 4)
