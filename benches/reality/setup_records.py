"""What a seed stands for: a part on a board, a rig of lamps, a view, and the faults of a camera.

Lengths in mm, angles in degrees, grey levels of 255. x right, y up, z to the camera; the origin lies on the smooth
board at the middle of the image.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

ROW_LETTERS = "ABCDEFGHJKLMNPRTUVWY"
"""JEDEC MO-151: I, O, Q, S, X and Z are not used."""


@dataclass(frozen=True)
class Scaled:
    """A ball with too much or too little solder."""

    factor: float


@dataclass(frozen=True)
class Coined:
    """A ball whose top was pressed flat, so far below its apex."""

    depth_mm: float


@dataclass(frozen=True)
class Moved:
    """A ball beside its place."""

    distance_mm: float
    direction_deg: float


@dataclass(frozen=True)
class Lifted:
    """A ball that stands higher (or lower: negative) by a thicker (thinner) pad."""

    height_mm: float


@dataclass(frozen=True)
class Tilted:
    """An ellipsoid of revolution, height / width `q`, whose axis leans."""

    q: float
    tilt_deg: float
    direction_deg: float


@dataclass(frozen=True)
class Bulge:
    """A bump, or a dent (negative height), of Gaussian profile; the height in radii of the ball."""

    height: float
    width_deg: float
    polar_deg: float
    azimuth_deg: float


@dataclass(frozen=True)
class Oval:
    """A ball that is an ellipse from above; half axes in radii of the ball."""

    along: float
    across: float
    direction_deg: float


Defect = Scaled | Coined | Moved | Lifted | Tilted | Bulge | Oval


@dataclass
class Part:
    """The balls; `squash` is height / width of all of them."""

    rows: int
    cols: int
    diameter_mm: float
    pitch_mm: float
    height_mm: float
    rotation_deg: float
    centre_mm: tuple[float, float]
    squash: float = 1.0
    depopulated: tuple[str, ...] = ()
    defects: dict[str, Defect] = field(default_factory=dict)

    def ball_names(self) -> list[str]:
        """All places of the grid, row by row."""
        return [f"{ROW_LETTERS[row]}{col + 1}" for row in range(self.rows) for col in range(self.cols)]


@dataclass(frozen=True)
class ReliefSizes:
    """Heights of traces, of a second layer of solder mask (step), depth of its openings; blur of all edges (sigma)."""

    trace_mm: float
    step_mm: float
    opening_mm: float
    edge_mm: float
    trace_width_mm: float
    pad_radius_mm: float


@dataclass
class Board:
    """The board under the balls; albedo and texture of its mask, roughness of its gloss."""

    albedo: float
    texture: float
    kind: Literal["matte", "glossy", "copper"] = "matte"
    gloss: float = 0.0
    tilt: tuple[float, float] = (0.0, 0.0)
    bow_mm: float = 0.0
    relief: ReliefSizes | None = None
    fibres: int = 0


@dataclass(frozen=True)
class Lobe:
    """One lobe of reflection; the shares of all lobes make one."""

    distribution: str
    roughness: float
    share: float


@dataclass
class Solder:
    """Mixture of a diffuse and a metallic part (shares: the weight)."""

    diffuse: float
    metallic_weight: float
    lobes: tuple[Lobe, Lobe]
    ball_spread: tuple[float, float, float]
    """Relative differences between balls: roughness, diffuse albedo, metallic weight."""
    oxide_spread: tuple[float, float, float]
    """Relative differences on a ball: diffuse albedo, roughness, metallic weight."""
    dirty: bool = False
    path_segments: int = 3
    """Path segments from the camera to a lamp: 2 is direct light, 3 one reflection between balls and board."""


@dataclass
class Rig:
    """A ring of lamps; each lies `error_deg` off its nominal direction, in a drawn direction."""

    azimuth_deg: float
    elevation_deg: float
    lamp_deg: float
    error_deg: float
    count: int = 8
    one_off: tuple[int, float] | None = None
    """A lamp and its own error (degrees)."""
    segment_deg: tuple[float, float] | None = None
    """Azimuth and elevation extent of ring segments; None: round LEDs of `lamp_deg`."""


@dataclass
class View:
    """The image; telecentric, or from a pinhole so far above the board."""

    pixel_mm: float
    width: int = 0
    height: int = 0
    distance_mm: float | None = None


@dataclass
class Camera:
    """Faults of camera, lens and recipe."""

    noise_levels: float
    intensity_spread: float = 0.0
    ambient_levels: float = 0.0
    flicker_levels: float = 0.0
    defocus_px: tuple[float, float] | None = None
    """Sigma of the blur on the board and at 0.42 mm above it."""
    vignetting: float = 0.0
    glare: float = 0.0
    distortion: float = 0.0
    shifts_px: dict[int, tuple[float, float]] = field(default_factory=dict)
    exposed_for: Literal["solder", "board", "highlights"] = "solder"
    gain: float = 1.0
    gamma: bool = False
    """Files are sRGB, but declared linear."""
    jpeg_quality: int | None = None
    dark_frame: bool = True
    pitch_factor: float = 1.0
    """Declared / true size of a pixel."""
    raised_deg: float = 0.0
    """Declared minus nominal elevation of all lamps."""


@dataclass
class Setup:
    """All that a seed stands for."""

    seed: int
    part: Part
    board: Board
    solder: Solder
    rig: Rig
    view: View
    camera: Camera
    deviations: tuple[str, ...] = ()
