r"""Where the edges of the shadows really are, sub-pixel: short stretches of edge, each measured across.

Near the predicted edge of a shadow, at signed distance d, the board reads

    I = T [lo + (hi - lo) F(d)] + e,

T the board's own texture (mean of the lights that reach the pixel, each divided by its gain), F the share of the light
that pixel, lens and size of the lamp let through (`edge_profile.py`; of a usual ball, in spreads s of the edge). A
stretch of edge has its own lo and hi (light from neighbouring balls differs along the edge), and to first order a
displacement a and a change b of the spread:

    I = lo T (1 - F) + hi T F - (hi - lo) [a T F' + b T (d / s) F'],

linear in four unknowns: least squares, then once more with Cauchy weights.

That holds for displacements below s. The coarse search goes by area: with H the unit step and r the reach,

    I = lo T (1 - H) + hi T H - (hi - lo) a T [|d| < r/2] / r

has the exact displacement a of any edge, sharp or blunt, that lies within r/2 (three unknowns; lit and dark, inside and
outside of r/2, have r/2 of pixels each).
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bgars import _bgars
from bgars.inspection.edge_profile import NODES, WIDEST_RAD, Lamp, edge_profiles
from bgars.inspection.shadow_map import Casters
from bgars.inspection.shadow_model import Balls, Lights, edge_at, rays
from bgars.inspection.spread import lamp_gradients
from bgars.records.kernel_capture import kernel_capture

if TYPE_CHECKING:
    from bgars.inspection.board import Board
    from bgars.inspection.radiance import Radiance
    from bgars.inspection.shadow_map import ShadowMap

__all__ = ["EdgeSettings", "Edges", "Lines", "edge_lines", "measure_edges"]

Array = NDArray[np.float64]

SECTORS, FEWEST_SECTORS = 20, 4
LINE_SPACING_PX = 1.45
"""Distance of neighbouring lines along the edge: above sqrt(2), so that no two lines share a pixel."""
MAX_LINES = 96
FEW_LINES = 48
FEWEST_LINES = 12
LINES_A_STRETCH, PIXELS_A_STRETCH = 3, 16.0
"""Least lines of a stretch, and pixels on them: 12 must be usable for its four unknowns."""
REACH_SIGMAS, REACH_PX = 3.2, 1.2
"""How far pixels across an edge reach: spreads, and pixels more."""
BEYOND = 1.25
"""Profiles go this much farther than the reach: smaller balls have sharper edges."""


class EdgeSettings(NamedTuple):
    """How edges are looked for.

    Spread of a sharp edge; size of the lamps, standard deviations along the azimuth and up; largest distance to look to
    on both sides; distance of pixels. `coarse`: by area instead, see the head of this file; finds edges up to half of
    `reach_px` away.
    `thorough`: more lines across the edges of large balls.
    """

    spread_px: float
    lamp_azimuth_rad: float
    lamp_elevation_rad: float
    reach_px: float
    stride_px: int = 1
    coarse: bool = False
    thorough: bool = False


@dataclass(frozen=True)
class Edges:
    """Stretches of shadow edges, arrays (N, L, S).

    Attributes
    ----------
    x, y : measured points, px
    shift_px : displacement against the prediction, outward
    u_px : standard uncertainty of the displacement; inf where nothing was measured
    spread_px, u_spread_px : measured spread of the edge
    way_px : way of the light from the tangent point to the board, over the slope of D: penumbra per radian of lamp
    lamp_azimuth_px, lamp_elevation_px : the same of a lamp that is wide along its azimuth, or high
    low, high : shadow and lit level over the board's texture
    contrast_levels : high - low in grey levels of 255
    noise_levels : (N, L) residual of the fit in grey levels of 255
    looked_at : bool, True where enough board was seen on both sides of the predicted edge
    """

    x: Array
    y: Array
    shift_px: Array
    u_px: Array
    spread_px: Array
    u_spread_px: Array
    way_px: Array
    lamp_azimuth_px: Array
    lamp_elevation_px: Array
    low: Array
    high: Array
    contrast_levels: Array
    noise_levels: Array
    looked_at: NDArray[np.bool_]

    def take(self, balls: NDArray[np.bool_]) -> Edges:
        """Some of the balls."""
        return Edges(*(getattr(self, part.name)[balls] for part in fields(self)))

    def lit_levels(self, otherwise: Array) -> Array:
        """(N, L) median lit level over the board's texture, `otherwise` where unknown: the gains as they really are."""
        known = np.isfinite(self.high)
        some: NDArray[np.bool_] = np.asarray(known.any(axis=2))
        high = np.where(some[:, :, None], self.high, 1.0)
        levels: Array = np.where(some, np.nanmedian(high, axis=2), otherwise)
        return np.where(levels > 0, levels, otherwise)


def measure_edges(
    radiance: Radiance,
    shadows: ShadowMap,
    table: Array,
    vectors: Array,
    near: bool,
    board: Board,
    gains: Array,
    settings: EdgeSettings,
    threads: int,
) -> Edges:
    """Measure the edges of the shadows of all balls under all lights.

    Parameters
    ----------
    radiance, shadows
        The images, and what is hidden or shadowed where.
    table : (N, 5) float64
        Predicted balls.
    vectors : (L, 3) float64
        Lights.
    near : bool
        Whether they are positions.
    board : Board
    gains : (N, L) float64
        Irradiance of the board around each ball under each light, relative.
    settings : EdgeSettings
    threads : int
    """
    radius = float(np.median(table[:, 3]))
    most = MAX_LINES if settings.thorough else FEW_LINES
    count = int(np.clip(2.0 * WIDEST_RAD * radius / LINE_SPACING_PX, FEWEST_LINES, most))
    sectors = stretches_of(count, settings.reach_px / settings.stride_px)
    angles_rad = (np.arange(count) + 0.5) / count * 2.0 * WIDEST_RAD - WIDEST_RAD
    stretches, noise = _bgars.measure_edges(
        kernel_capture(radiance.capture),
        Casters.of(table, vectors, near, board),
        edge_lines(angles_rad, np.median(table, axis=0), vectors, near, board, settings),
        angles_rad=angles_rad.tolist(),
        sectors=sectors,
        gains=gains.astype(np.float32),
        step=shadows.step,
        hidden=shadows.hidden,
        count=shadows.count,
        mask=radiance.mask,
        threads=threads,
    )
    shape = (len(table), len(vectors), sectors)
    fit = Stretches(*np.moveaxis(stretches, -1, 0).reshape(-1, *shape))
    balls = Balls.from_table(table).spread(2)
    return _edges(fit, noise, balls, vectors, near, board, settings, radiance.scale)


def stretches_of(lines: int, reach: float) -> int:
    """Into how many stretches the lines of a shadow are shared out, with pixels up to `reach` on both sides of each."""
    together = max(LINES_A_STRETCH, int(np.ceil(PIXELS_A_STRETCH / (2.0 * reach))))
    return int(np.clip(lines // together, FEWEST_SECTORS, SECTORS))


class Lines(NamedTuple):
    """Settings of the kernel: the same of all lines across edges, lists with a value for each, and their profiles.

    `profiles` (L, S, NODES, 2): share of the light, and its growth per spread, at `NODES` places from -`limit` to
    `limit` spreads; empty where `coarse`.
    """

    spread_px: float
    lamp_spread_rad: list[float]
    reach_px: list[float]
    limit: list[float]
    profiles: NDArray[np.float64]
    stride_px: int
    coarse: bool


def edge_lines(
    angles_rad: Array, ball: Array, vectors: Array, near: bool, board: Board, settings: EdgeSettings
) -> Lines:
    """How wide a usual ball's edges are, and their profiles, by the place along them."""
    balls, lights = Balls.from_table(ball[None]).spread(2), Lights.from_table(vectors, near).spread(1, 1)
    edge = edge_at(angles_rad, balls, lights, board)
    beam = rays(edge.x, edge.y, balls, lights, board)
    along, up = lamp_gradients(beam, balls, vectors)
    blurred = np.square(along * settings.lamp_azimuth_rad) + np.square(up * settings.lamp_elevation_rad)
    blurred_px = np.sqrt(blurred.mean(axis=(0, 1)))
    ways_px = np.abs(beam.along / np.maximum(beam.slope, 1e-3))
    lamp_spread_rad = blurred_px / np.maximum(ways_px.mean(axis=(0, 1)), 1e-3)
    reach_px = np.full(len(angles_rad), settings.reach_px)
    if settings.coarse:
        nothing = np.zeros((len(vectors), len(angles_rad), 0, 2))
        return Lines(
            settings.spread_px,
            lamp_spread_rad.tolist(),
            reach_px.tolist(),
            reach_px.tolist(),
            nothing,
            settings.stride_px,
            coarse=True,
        )
    reach_px = np.minimum(reach_px, REACH_SIGMAS * np.hypot(settings.spread_px, blurred_px) + REACH_PX)
    spread_px = np.hypot(settings.spread_px, lamp_spread_rad * ways_px[0])
    limit = BEYOND * (reach_px / spread_px).max(axis=0)
    at = np.linspace(-1.0, 1.0, NODES) * (limit * spread_px)[..., None]
    lamp = Lamp(settings.lamp_azimuth_rad, settings.lamp_elevation_rad)
    share, growth = edge_profiles(edge, beam, balls, vectors, near, board, settings.spread_px, lamp, at)
    profiles = np.stack([share, growth * spread_px[..., None]], axis=-1)
    return Lines(
        settings.spread_px,
        lamp_spread_rad.tolist(),
        reach_px.tolist(),
        limit.tolist(),
        profiles,
        settings.stride_px,
        coarse=False,
    )


class Stretches(NamedTuple):
    """Least squares of every stretch, arrays (N, L, S).

    Coefficients (shadow and lit level, displacement and change of the spread times the contrast) and their standard
    uncertainties; mean texture and its relative growth outward per pixel; means over the lines of the tangent point's
    angle, the way of the light and the spread, weighted by what they say about the displacement; 1 where there was
    enough to see, else 0.
    """

    low: Array
    high: Array
    moved: Array
    widened: Array
    u_low: Array
    u_high: Array
    u_moved: Array
    u_widened: Array
    texture: Array
    growth: Array
    angle_rad: Array
    way_px: Array
    spread_px: Array
    looked_at: Array


def _edges(
    fit: Stretches,
    noise: Array,
    balls: Balls,
    vectors: Array,
    near: bool,
    board: Board,
    settings: EdgeSettings,
    scale: float,
) -> Edges:
    """Points on the edges; `scale` in grey levels per level of 255."""
    contrast = fit.high - fit.low
    looked_at = fit.looked_at > 0
    measured = looked_at & (contrast > 0)
    safe = np.where(measured, contrast, 1.0)
    lights = Lights.from_table(vectors, near).spread(1, 1)
    edge = edge_at(fit.angle_rad, balls, lights, board)
    beam = rays(edge.x, edge.y, balls, lights, board)
    widened, u_widened = fit.spread_px, np.full(contrast.shape, np.inf)
    if not settings.coarse:
        widened = widened - np.where(measured, fit.widened / safe, 0.0)
        u_widened = np.where(measured, fit.u_widened / safe, np.inf)
    # A blurred convex shadow looks smaller than it is, by half of the squared spread times the curvature of its edge.
    # And texture that grows outward by g a pixel, blurred with the shadow, moves its edge inward by g s^2.
    blurred = settings.spread_px**2 * (fit.growth + 0.5 * beam.curvature)
    shift = blurred - np.where(measured, fit.moved / safe, 0.0)
    along, up = lamp_gradients(beam, balls, vectors)
    return Edges(
        x=np.where(measured, edge.x + shift * beam.gradient_x / beam.slope, 0.0),
        y=np.where(measured, edge.y + shift * beam.gradient_y / beam.slope, 0.0),
        shift_px=np.where(measured, shift, 0.0),
        u_px=np.where(measured, fit.u_moved / safe, np.inf),
        spread_px=np.where(measured, widened, np.nan),
        u_spread_px=u_widened,
        way_px=fit.way_px,
        lamp_azimuth_px=along,
        lamp_elevation_px=up,
        low=np.where(measured, fit.low, np.nan),
        high=np.where(measured, fit.high, np.nan),
        contrast_levels=np.where(measured, contrast * fit.texture / scale, np.nan),
        noise_levels=noise / scale,
        looked_at=looked_at,
    )
