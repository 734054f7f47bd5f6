"""How even the lights are: a flat white or grey board under each of them, as smooth maps."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.errors import CalibrationError
from bgars.files.light_names import light_name
from bgars.records.flat_field import FlatField
from bgars.records.remark import Remark
from bgars.records.same_images import refuse_repeated
from bgars.records.station_apply import flat_maps
from bgars.station.levels import linear_levels

if TYPE_CHECKING:
    from bgars.records.capture import Capture
    from bgars.records.light_calibration import LightCalibration

__all__ = ["calibrate_flat", "falloff_findings"]

Array = NDArray[np.float64]

BLOCKS = 48
"""Blocks along the longer side whose means are fitted: dust and noise go, what lights and lenses do stays."""
DEGREES = (2, 3, 4, 5, 6, 8, 10)
BETTER = 0.98
"""A higher degree must lower the error on blocks left out by 2 %."""
LEAST_LEVEL, CLIPPED_SHARE = 10.0, 0.001
ROUNDING = 5e-4
"""Share of the level that rounded grey levels leave in the mean of a block."""
STRUCTURE = 0.01
"""Residual of the maps from which on the board, or dust, is in the light."""
LARGEST, NO_BOARD = 0.03, 0.1
"""Largest misfit of a block that is doubted, and of four that is refused: 3 % of the light turn a normal by a degree;
with a tenth of it images that are divided by the map are worse than those that are not."""
BLOCK_SIGMAS = 4.0
"""Of noise, which one of two thousand blocks exceeds seldom."""
FALLOFF = 0.05
"""How far the shape of a map may be from that of the near-light model."""


def calibrate_flat(capture: Capture) -> tuple[FlatField, tuple[Remark, ...]]:
    """Fit the levels of a flat board under each light by smooth maps.

    Parameters
    ----------
    capture : Capture
        A flat, matt, evenly coloured board that fills the mask, one image per light; a dark frame helps.

    Returns
    -------
    flat : FlatField
        Polynomials whose degree is chosen on blocks of pixels that were left out.
    findings : tuple of Remark
        What is left in the board, and how far the corners fall off.

    Raises
    ------
    CalibrationError
        An image too dark or clipped, or no board that a smooth map fits within a tenth.
    InputError
        The same image twice.

    Examples
    --------
    >>> import bgars
    >>> board, _ = bgars.simulate(bgars.Scene.plane(), bgars.LightRig.ring(8), bgars.Material(i_s=0.0), bgars.Camera())
    >>> flat, findings = bgars.calibrate_flat(board)
    >>> flat.degree, flat.residual < 0.01
    (2, True)
    """
    levels = linear_levels(capture)
    refuse_repeated(capture)
    height, width = capture.mask.shape
    step = max(1, math.ceil(max(height, width) / BLOCKS))
    means, weights, x, y = _blocks(levels.images, capture.mask, step)
    if not len(weights):
        msg = f"{capture.name}: the mask has {np.count_nonzero(capture.mask)} pixels, too few for a flat field"
        raise CalibrationError(msg)
    if not np.isfinite(means).all():
        msg = f"{capture.name}: images: must be finite inside the mask"
        raise CalibrationError(msg)
    for index, image in enumerate(levels.images):
        name = light_name(index, capture.files)
        inside = image[capture.mask]
        clipped = float((inside >= levels.clip).mean())
        if clipped > CLIPPED_SHARE:
            msg = f"{capture.name}: {name}: {100 * clipped:.1f} % of the board is clipped; expose shorter"
            raise CalibrationError(msg)
        if float(np.median(inside)) < LEAST_LEVEL:
            msg = (
                f"{capture.name}: {name}: the board is too dark ({np.median(inside):.1f} of 255, "
                f"{LEAST_LEVEL:g} is least)"
            )
            raise CalibrationError(msg)
    noise = levels.noise / np.sqrt(np.maximum(weights, 1.0))
    degree = _degree(means, weights, x, y, noise)
    rows = _rows(x, y, degree)
    root = np.sqrt(weights)
    coefficients, *_ = np.linalg.lstsq(rows * root[:, None], (means * root).T, rcond=None)
    fitted = (rows @ coefficients).T
    off = np.sqrt(np.average((means - fitted) ** 2, axis=1, weights=weights))
    left = np.sqrt(np.maximum(off**2 - float(np.average(noise**2, weights=weights)), 0.0)) / fitted.mean(axis=1)
    errors, u_errors = means / fitted - 1.0, noise / fitted
    wide = _worst(errors, u_errors, x, y, (height / step, width / step))
    worst = np.maximum(wide, (np.abs(errors) - BLOCK_SIGMAS * u_errors).max(axis=1))
    flat = FlatField(np.array(coefficients.T, dtype=np.float64), degree, (height, width), float(left.max()))
    least = min(float(flat_maps(flat, index).min()) for index in range(len(flat.coefficients)))
    if least <= 0:
        msg = f"{capture.name}: a map falls to 0: the board must be flat, of one colour, and fill the image"
        raise CalibrationError(msg)
    for light in np.flatnonzero(wide > NO_BOARD):
        msg = (
            f"{capture.name}: {light_name(int(light), capture.files)}: no smooth map fits the board: a place is off by "
            f"{100 * wide[light]:.0f} % (limit {100 * NO_BOARD:g} %): a pattern, an edge of the board, a shadow, or "
            "corners that the lens cuts off; photograph a plain board, or mask what is none"
        )
        raise CalibrationError(msg)
    spare = max(len(x) - rows.shape[1], 1)
    scatter = np.array(np.sqrt((weights * (means - fitted) ** 2).sum(axis=1) / spare), dtype=np.float64)
    inverse = np.array(np.linalg.pinv((rows * weights[:, None]).T @ rows), dtype=np.float64)
    return flat, tuple(_findings(capture, left, worst, least) + _unsure(capture, flat, inverse, scatter, step))


def falloff_findings(flat: FlatField, lights: LightCalibration, pitch_um: float) -> list[Remark]:
    """Say which light falls off otherwise than a point at its place would."""
    rig = lights.rig
    if rig.positions_um is None:
        return []
    height, width = flat.size_px
    x = (np.arange(width) + 0.5 - width / 2.0) * pitch_um
    y = (height / 2.0 - np.arange(height) - 0.5) * pitch_um
    ratios = []
    for light, (px, py, pz) in enumerate(rig.positions_um):
        distance = np.sqrt((px - x[None, :]) ** 2 + (py - y[:, None]) ** 2 + pz**2)
        ratios.append(np.log(flat_maps(flat, light) * distance**3 / np.linalg.norm(rig.positions_um[light]) ** 3))
    shared = np.mean(ratios, axis=0)
    off = [float(np.std(ratio - shared)) for ratio in ratios]
    return [
        Remark(
            "note",
            f"{light_name(light)}: falls off {100 * size:.1f} % otherwise than a point at its place; the flat "
            "field corrects it",
            "falloff",
            size,
            FALLOFF,
            "",
            light,
        )
        for light, size in enumerate(off)
        if size > FALLOFF
    ]


def _blocks(images: Array, mask: NDArray[np.bool_], step: int) -> tuple[Array, Array, Array, Array]:
    """(L, B) means of blocks, (B,) pixels in them, (B,) x and y from -1 to 1."""
    height, width = mask.shape
    rows, cols = np.arange(0, height, step), np.arange(0, width, step)

    def total(values: Array) -> Array:
        sums: Array = np.add.reduceat(np.add.reduceat(values, rows, axis=0), cols, axis=1)
        return sums

    count = total(mask.astype(np.float64))
    sums = np.array([total(np.where(mask, image, 0.0)) for image in images])
    row, col = np.mgrid[:height, :width].astype(np.float64)
    x = total(np.where(mask, (col + 0.5) / width * 2.0 - 1.0, 0.0))
    y = total(np.where(mask, 1.0 - (row + 0.5) / height * 2.0, 0.0))
    use = count > 0.5 * step**2
    n = count[use]
    return sums[:, use] / n, n, x[use] / n, y[use] / n


def _worst(errors: Array, noise: Array, x: Array, y: Array, blocks: tuple[float, float]) -> Array:
    """(L,) largest mean of four neighbouring blocks of (L, B) errors, less three standard deviations of their noise."""
    row = np.minimum((1.0 - y) / 2.0 * blocks[0], blocks[0] - 0.5).astype(int)
    col = np.minimum((x + 1.0) / 2.0 * blocks[1], blocks[1] - 0.5).astype(int)

    def of_four(values: Array) -> Array:
        grid = np.zeros((row.max() + 2, col.max() + 2))
        grid[row, col] = values
        return np.asarray(grid[1:, 1:] + grid[1:, :-1] + grid[:-1, 1:] + grid[:-1, :-1])

    count = of_four(np.ones(len(x)))
    whole = count >= min(4.0, float(count.max()))
    found = []
    for error, spread in zip(errors, noise, strict=True):
        size = np.abs(of_four(error)) - 3.0 * np.sqrt(of_four(spread**2))
        found.append(float(np.max(size[whole] / count[whole], initial=0.0)))
    return np.array(found)


def _rows(x: Array, y: Array, degree: int) -> Array:
    powers = np.eye(degree + 1)
    of_x = [np.polynomial.legendre.legval(x, row) for row in powers]
    of_y = [np.polynomial.legendre.legval(y, row) for row in powers]
    return np.column_stack([of_x[i] * of_y[j] for i in range(degree + 1) for j in range(degree + 1 - i)])


def _degree(means: Array, weights: Array, x: Array, y: Array, noise: Array) -> int:
    """Degree with the least error on every other block (in a chequered order), no higher than pays."""
    half = (np.arange(len(x)) * 7 // 3) % 2 == 0
    best, chosen = math.inf, DEGREES[0]
    # What noise and rounding leave of the blocks is no reason for another term.
    floor = 4.0 * float(np.mean(noise**2)) + (ROUNDING * float(means.mean())) ** 2
    for degree in DEGREES:
        terms = (degree + 1) * (degree + 2) // 2
        if terms * 3 > min(int(half.sum()), int((~half).sum())):
            break
        error = floor
        for kept in (half, ~half):
            rows = _rows(x[kept], y[kept], degree) * np.sqrt(weights[kept])[:, None]
            law, *_ = np.linalg.lstsq(rows, (means[:, kept] * np.sqrt(weights[kept])).T, rcond=None)
            error += float(np.mean((means[:, ~kept] - (_rows(x[~kept], y[~kept], degree) @ law).T) ** 2))
        if error < BETTER**2 * best:
            best, chosen = error, degree
    return chosen


def _unsure(capture: Capture, flat: FlatField, inverse: Array, scatter: Array, step: int) -> list[Remark]:
    """Name maps that a place, mostly a dark corner, is known to badly: twice the standard uncertainty of the fit."""
    height, width = flat.size_px
    at = np.ix_(np.unique([*range(0, height, step), height - 1]), np.unique([*range(0, width, step), width - 1]))
    row, col = (each[capture.mask[at]] for each in np.broadcast_arrays(*at))
    rows = _rows((col + 0.5) / width * 2.0 - 1.0, 1.0 - (row + 0.5) / height * 2.0, flat.degree)
    # The scatter of a pixel, were it alone; the inverse counts the pixels of each block.
    usual = np.sqrt(np.einsum("ij,jk,ik->i", rows, inverse, rows))
    u = np.maximum(scatter, np.finfo(float).tiny)[:, None] * usual / np.abs(flat.coefficients @ rows.T)
    found = []
    for light in np.flatnonzero(2.0 * u.max(axis=1) > LARGEST):
        place = int(u[light].argmax())
        share = 2.0 * float(u[light, place])
        message = (
            f"{capture.name}: {light_name(int(light), capture.files)}: the map is known to {100 * share:.0f} % only at "
            f"column {col[place]}, row {row[place]} (limit {100 * LARGEST:g} %): too dark there, or a lamp too near "
            "for a smooth map; expose longer, or move the lamp away"
        )
        found.append(Remark("doubt", message, "flat-unsure", share, LARGEST, "", int(light)))
    return found


def _findings(capture: Capture, left: Array, worst: Array, least: float) -> list[Remark]:
    found = []
    for light in np.flatnonzero((worst > LARGEST) & (left <= STRUCTURE)):
        message = (
            f"{capture.name}: {light_name(int(light), capture.files)}: the map is off by {100 * worst[light]:.0f} % at "
            "a place: a shadow, dust, an edge, or corners that the lens cuts off"
        )
        found.append(Remark("doubt", message, "flat-structure", float(worst[light]), LARGEST, "", int(light)))
    for light in np.flatnonzero(left > STRUCTURE):
        name = light_name(int(light), capture.files)
        message = (
            f"{capture.name}: {name}: {100 * left[light]:.1f} % of structure is left in the board: texture, "
            "dust, gloss or a shadow"
        )
        found.append(Remark("doubt", message, "flat-structure", float(left[light]), STRUCTURE, "", int(light)))
    found.append(
        Remark(
            "note",
            f"{capture.name}: the darkest place of a map has {100 * least:.0f} % of the level at the centre",
            "evenness",
            least,
        )
    )
    return found
