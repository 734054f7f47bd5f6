r"""Centres of balls from their outlines, each light on the side that it shines on.

There ball and board are both lit and their edge is sharp, while the board's shape and the light's direction do not
enter:
what shadows cannot tell apart (a tilt of all lights and of the board, and a shift of all balls) outlines can. With r
the
distance to the centre, along the outline

    I = outside Phi(d / s) + (inside + bend sqrt(1 - r^2 / R^2)) (1 - Phi(d / s)) + move phi(d / s) / s,   d = r - R.

What the shading of the rim does to the edge is the same on the opposite side under the opposite light, so it spoils the
radius only, which is left free.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bgars.inspection.edge_fit import Group, fit_stretches
from bgars.inspection.normal_distribution import normal_distribution

if TYPE_CHECKING:
    from bgars.inspection.radiance import Radiance
    from bgars.inspection.shadow_map import ShadowMap

__all__ = ["Outlines", "moved_back", "outline_centres"]

Array = NDArray[np.float64]

SECTORS = 8
WIDEST_RAD = np.radians(64.0)
"""Half of the arc, around the azimuth of a light, on which outlines are lit."""
LINE_SPACING_PX = 1.45
MAX_LINES = 48
REACH_PX = 3.5
"""Half width of the band across an outline, once it is near."""
COARSE_REACH, COARSE_EXTRA_PX = 0.2, 2.0
"""Half width of the band of a first look: share of the radius, and pixels more."""
MIN_STRETCHES = 12
"""Measured stretches of an outline that is used."""
MIN_SPREAD_DEG = 200.0
"""And how far around the ball they must go: past half, so that both coordinates are held."""
BESIDE_SHARE = 0.8
"""Share of the pixels beside a stretch of outline that must be usable."""
ROUNDS = 8
BIN_DEG = 20.0
CAUCHY = 2.5
"""Scale of the Cauchy loss of stretches, in standard deviations."""
NEIGHBOUR_GAP_PX = 5.0
"""Board beside an outline that must be free of the next ball."""
INV_SQRT_2PI = 0.3989422804014327


class Outlines(NamedTuple):
    """Centres (N, 2) and their standard uncertainty (N,); NaN and inf where too little of an outline is seen.

    `shift_px` (N, L, S) how far each stretch lies outside the predicted circle, `u_shift_px` its uncertainty (inf:
    unknown), `offset_rad` (S,) its place against the direction of its light, `azimuths_rad` (L,).
    """

    centres: Array
    u_centre: Array
    shift_px: Array
    u_shift_px: Array
    offset_rad: Array
    azimuths_rad: Array


def outline_centres(
    radiance: Radiance, shadows: ShadowMap, table: Array, azimuths_rad: Array, spread_px: float, *, coarse: bool = False
) -> Outlines:
    """Measure the outlines of balls.

    Parameters
    ----------
    radiance : Radiance
    shadows : ShadowMap
        Where the board is shadowed.
    table : (N, 5) float64
        Balls, good to a pixel.
    azimuths_rad : (L,) float64
        Of the lights.
    spread_px : float
        Of sharp edges in these images.
    coarse : bool
        By area, as in :mod:`bgars.inspection.shadow_edges`: finds outlines a tenth of a radius and a pixel off.
    """
    count, lights = len(table), len(azimuths_rad)
    radius = float(np.median(table[:, 3]))
    lines = int(np.clip(2.0 * WIDEST_RAD * radius / LINE_SPACING_PX, 2 * SECTORS, MAX_LINES))
    offset = (np.arange(lines) + 0.5) / lines * 2.0 * WIDEST_RAD - WIDEST_RAD
    angle = azimuths_rad[None, :, None] + offset[None, None, :]
    centre_x, centre_y, reach = (table[:, i, None, None] for i in (0, 1, 3))
    edge_x, edge_y = centre_x + reach * np.cos(angle), centre_y + reach * np.sin(angle)
    free = np.ones(edge_x.shape, dtype=np.bool_)
    for index, (x, y, _, size, _) in enumerate(table):
        near = np.hypot(table[:, 0] - x, table[:, 1] - y) < size + table[:, 3] + 2.0 * NEIGHBOUR_GAP_PX
        for other in np.flatnonzero(near):
            if other != index:
                gap = np.hypot(edge_x[other] - x, edge_y[other] - y) - size
                free[other] &= gap > NEIGHBOUR_GAP_PX
    ball, light, place = np.nonzero(free)
    pick = (ball, light, place)
    wide = COARSE_REACH * radius + COARSE_EXTRA_PX if coarse else REACH_PX
    value, distance, usable = _across(radiance, shadows, table, pick, angle, (edge_x[pick], edge_y[pick]), wide)
    if coarse:
        outside = (distance >= 0.0).astype(np.float64)
        # By area only lines count that see the board next to the rim: a neighbour's shadow there is no outline.
        beside = outside * (distance < wide)
        usable *= (beside * usable).sum(axis=0) >= BESIDE_SHARE * beside.sum(axis=0)
        columns = [1.0 - outside, outside, (np.abs(distance) < 0.5 * wide) / wide]
    else:
        columns = _profile(distance, spread_px, table[ball, 3])
    stretch = (ball * lights + light) * SECTORS + place * SECTORS // lines
    group = Group(stretch, count * lights * SECTORS, SECTORS)
    fit = fit_stretches(columns, value, usable, group, robust=not coarse)
    step = fit.solution[:, 0] - fit.solution[:, 1]
    known = fit.measured & (np.abs(step) > 3.0 * fit.deviation[:, 2] / wide)
    shift = np.where(known, fit.solution[:, 2] / np.where(known, step, 1.0), 0.0).reshape(count, -1)
    u_shift = np.where(known, fit.deviation[:, 2] / np.abs(np.where(known, step, 1.0)), np.inf).reshape(count, -1)
    u_shift = np.where(np.abs(shift) < (0.5 * wide if coarse else wide), u_shift, np.inf)
    places = WIDEST_RAD * ((np.arange(SECTORS) + 0.5) / SECTORS * 2.0 - 1.0)
    middle = (azimuths_rad[:, None] + places[None, :]).reshape(-1)
    centres, u_centre = _centres(table, middle, shift, u_shift)
    shape = (count, lights, SECTORS)
    return Outlines(centres, u_centre, shift.reshape(shape), u_shift.reshape(shape), places, azimuths_rad)


def moved_back(outlines: Outlines, table: Array, moves_px: Array) -> Outlines:
    """What outlines are without the shifts (L, 2) of the images; `table` is the one that they were measured by."""
    middle = outlines.azimuths_rad[:, None] + outlines.offset_rad[None, :]
    along = moves_px[:, :1] * np.cos(middle) + moves_px[:, 1:] * np.sin(middle)
    shift = outlines.shift_px - along
    flat = (len(table), -1)
    centres, u_centre = _centres(table, middle.reshape(-1), shift.reshape(flat), outlines.u_shift_px.reshape(flat))
    return outlines._replace(centres=centres, u_centre=u_centre, shift_px=shift)


def _profile(distance: Array, spread_px: float, radius: Array) -> list[Array]:
    """Columns of the fit: inside, outside, move, bend of the shading towards the rim."""
    scaled = distance / spread_px
    outside = normal_distribution(scaled)
    inside = 1.0 - outside
    depth = np.sqrt(np.maximum(1.0 - np.square(1.0 + distance / radius), 0.0))
    return [inside, outside, INV_SQRT_2PI * np.exp(-0.5 * scaled**2) / spread_px, inside * depth]


def _across(
    radiance: Radiance,
    shadows: ShadowMap,
    table: Array,
    pick: tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]],
    angle: Array,
    edge: tuple[Array, Array],
    reach_px: float,
) -> tuple[Array, Array, Array]:
    """Values, distances to the outline and 1 or 0 for usable, (O, M), on lines across it."""
    ball, light, place = pick
    toward = angle[0, light, place]
    steps = int(np.ceil(reach_px))
    offsets = np.arange(-steps, steps + 1)[:, None]
    if reach_px > REACH_PX:
        # Long lines must follow the normal: aslant, shading would differ from light to light.
        rows = np.rint(radiance.row(edge[1])[None, :] - offsets * np.sin(toward)).astype(np.intp)
        cols = np.rint(radiance.col(edge[0])[None, :] + offsets * np.cos(toward)).astype(np.intp)
    else:
        along_cols = np.abs(np.cos(toward)) >= np.abs(np.sin(toward))
        rows = np.rint(radiance.row(edge[1])).astype(np.intp)[None, :] + np.where(along_cols[None, :], 0, offsets)
        cols = np.rint(radiance.col(edge[0])).astype(np.intp)[None, :] + np.where(along_cols[None, :], offsets, 0)
    usable = (rows >= 0) & (rows < radiance.height) & (cols >= 0) & (cols < radiance.width)
    rows, cols = np.clip(rows, 0, radiance.height - 1), np.clip(cols, 0, radiance.width - 1)
    across_x, across_y = radiance.x(cols) - table[ball, 0], radiance.y(rows) - table[ball, 1]
    distance = np.sqrt(across_x * across_x + across_y * across_y) - table[ball, 3]
    value = radiance.under(np.broadcast_to(light, rows.shape), rows * radiance.width + cols).astype(np.float64)
    at = shadows.pixels(rows, cols)
    shadowed = shadows.count.reshape(len(shadows.count), -1)[np.broadcast_to(light, rows.shape), at] > 0
    usable &= np.isfinite(value) & (np.abs(distance) <= reach_px) & ~(shadowed & (distance > 0))
    return np.where(usable, value, 0.0), distance, usable.astype(np.float64)


def _centres(table: Array, middle: Array, shift: Array, u_shift: Array) -> tuple[Array, Array]:
    """Robust circles through the shifts of outlines: centre moves, radius free."""
    system = np.column_stack([np.cos(middle), np.sin(middle), np.ones(len(middle))])
    known = np.isfinite(u_shift)
    bins = np.floor(np.degrees(middle) % 360.0 / BIN_DEG).astype(np.intp)
    seen = np.zeros((len(table), int(360.0 / BIN_DEG)), dtype=np.bool_)
    for bin_index in range(seen.shape[1]):
        seen[:, bin_index] = known[:, bins == bin_index].any(axis=1)
    good = (known.sum(axis=1) >= MIN_STRETCHES) & (seen.sum(axis=1) * BIN_DEG >= MIN_SPREAD_DEG)
    change = np.zeros((len(table), 3))
    change[:, 2] = _median(shift, known)
    normal = np.repeat(np.eye(3)[None], len(table), axis=0)
    scale = np.ones(len(table))
    for _ in range(ROUNDS):
        residual = np.where(known, shift - change @ system.T, 0.0)
        scale = np.maximum(1.4826 * _median(np.abs(residual), known), 1e-3)
        weight = known / (1.0 + (residual / (CAUCHY * scale[:, None])) ** 2)
        normal = np.einsum("km,mi,mj->kij", weight, system, system, optimize=True)
        normal[~good] = np.eye(3)
        right = (weight * residual) @ system
        change = change + np.where(good[:, None], np.linalg.solve(normal, right[..., None])[..., 0], 0.0)
    covariance = np.linalg.inv(normal) * np.square(scale)[:, None, None]
    centres = np.where(good[:, None], table[:, :2] + change[:, :2], np.nan)
    u_centre = np.where(good, np.sqrt((covariance[:, 0, 0] + covariance[:, 1, 1]) / 2.0), np.inf)
    return centres, u_centre


def _median(values: Array, known: NDArray[np.bool_]) -> Array:
    """(N,) medians of the known values of each row; 0 where there is none."""
    count = known.sum(axis=1)
    ascending = np.sort(np.where(known, values, np.inf), axis=1)
    middle = np.column_stack([np.maximum(count - 1, 0) // 2, np.minimum(count // 2, values.shape[1] - 1)])
    median: Array = np.where(count > 0, np.take_along_axis(ascending, middle, axis=1).mean(axis=1), 0.0)
    return median
