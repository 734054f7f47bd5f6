"""Find the balls of a capture: circles, places, names, and what is missing, extra or joined."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bgars.balls.bridges import joined_pairs
from bgars.balls.circles import Detection, find_circles
from bgars.balls.lattice import fit_lattice
from bgars.balls.levels import Levels
from bgars.balls.places import look_again
from bgars.balls.registration import register
from bgars.errors import InputError
from bgars.records.ball_names import ball_name
from bgars.records.found_balls import FoundBall, FoundBalls
from bgars.records.scalar_checks import check_progress, thread_count
from bgars.records.whole_capture import need_whole

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from bgars.balls.rim_fit import Circles
    from bgars.records.ball_layout import BallLayout, LayoutPlace
    from bgars.records.capture import Capture

__all__ = ["find_balls"]

ODD_SIZE = 0.25
"""Difference from the median radius, as a share of it, that is told."""
ENOUGH_TO_JUDGE_SIZE = 4
"""Balls that have a usual size."""
BRIDGE_MIDDLE = 0.25
"""Farthest from the middle of two neighbours, in pitches, that a small circle counts as the bridge between them."""
BRIDGE_SIZE = 0.75
"""Of the median radius: what is smaller, and between two balls, is their bridge."""


class _Grid(NamedTuple):
    """Where the balls belong; rows and columns are -1 off the lattice."""

    names: list[str]
    row: list[int]
    col: list[int]
    missing: list[tuple[str, int, int]]
    missing_px: list[tuple[float, float]]
    rows: int
    cols: int
    pitch_px: float | None
    angle_rad: float
    origin_px: tuple[float, float]


def find_balls(
    capture: Capture,
    *,
    layout: BallLayout | None = None,
    threads: int | None = None,
    progress: Callable[[float], object] | None = None,
) -> FoundBalls:
    """Find the balls of a part and where each belongs.

    Centres are places that least-squares normals look away from; a ball is where the same circle shows an edge in every
    direction, in several lights each time. Its silhouette is fitted to all lights and directions at once, with a model
    of a rim averaged over pixels and blurred by the lens (docs/balls.md).

    Parameters
    ----------
    capture : Capture
        Images and lights. Where the mask has round blobs that slope outward, their outlines are the silhouettes.
    layout : BallLayout, optional
        Where balls should be, at any turn of the part. Without it, the lattice is that of the balls: every free place
        of the smallest rectangle around them is missing.
    threads : int, optional
        Largest number of threads; by default one per core.
    progress : callable, optional
        Called with the fraction done.

    Returns
    -------
    FoundBalls
        Without balls when there are none, or when the images show too little.

    Raises
    ------
    InputError
        A layout that does not fit the balls, or one without a pixel pitch in the capture.

    References
    ----------
    R. J. Woodham, "Photometric method for determining surface orientation from multiple images", Opt. Eng. 19 (1980).

    Examples
    --------
    >>> import bgars
    >>> found = bgars.find_balls(bgars.read_capture(bgars.sample_capture()))
    >>> found.balls[0].name, len(found.balls), len(found.missing)
    ('A1', 1, 0)
    """
    check_progress(progress)
    threads = thread_count(threads)
    if layout is not None and capture.pixel_pitch_um is None:
        msg = "layout: needs capture.pixel_pitch_um, which is None, to convert micrometres to pixels"
        raise InputError(msg)
    need_whole(capture)
    levels = Levels(capture, threads)
    found = find_circles(levels, progress)
    x_px = found.circles.col + 0.5 - levels.width / 2
    y_px = levels.height / 2 - found.circles.row - 0.5
    joined: list[tuple[int, int]] = []
    lattice = fit_lattice(x_px, y_px)
    if lattice is not None:
        joined = _joined(x_px, y_px, found, lattice.pitch_px, (levels.height, levels.width))
        between = _bridge_circles(x_px, y_px, found.circles.radius_px, lattice.on, lattice.pitch_px)
        if between:
            keep = np.array([index for index in range(len(x_px)) if index not in between], np.intp)
            new_of = {int(old): new for new, old in enumerate(keep)}
            pairs = {(new_of[i], new_of[j]) for i, j in joined if i in new_of and j in new_of}
            pairs |= {(new_of[i], new_of[j]) for i, j in between.values() if i in new_of and j in new_of}
            joined = sorted(pairs)
            found = found._replace(circles=found.circles.take(keep))
            x_px, y_px = x_px[keep], y_px[keep]
    grid = _grid(x_px, y_px, layout, capture.pixel_pitch_um)
    added, unclear = _second_look(levels, found, grid)
    if len(added.row):
        found = found._replace(circles=found.circles.join(added))
        x_px = found.circles.col + 0.5 - levels.width / 2
        y_px = levels.height / 2 - found.circles.row - 0.5
        grid = _grid(x_px, y_px, layout, capture.pixel_pitch_um)
        unclear &= {name for name, _, _ in grid.missing}
    if progress is not None:
        progress(1.0)
    return _record(x_px, y_px, found, grid, joined, unclear)


def _second_look(levels: Levels, found: Detection, grid: _Grid) -> tuple[Circles, set[str]]:
    """Balls that were overlooked on places of the grid, and names of the places that are not seen to be empty."""
    if not grid.missing:
        return found.circles.take(slice(0)), set()
    x_px, y_px = np.array(grid.missing_px).T
    row, col = levels.height / 2 - y_px - 0.5, x_px + levels.width / 2 - 0.5
    look = look_again(levels, found, row, col, grid.pitch_px or float(max(levels.height, levels.width)))
    return look.circles, {grid.missing[index][0] for index in np.flatnonzero(look.unclear)}


def _grid(
    x_px: NDArray[np.float64], y_px: NDArray[np.float64], layout: BallLayout | None, pixel_pitch_um: float | None
) -> _Grid:
    """The places of a layout, or of the balls' own lattice."""
    return _inferred(x_px, y_px) if layout is None else _from_layout(x_px, y_px, layout, pixel_pitch_um or 1.0)


def _joined(
    x_px: NDArray[np.float64], y_px: NDArray[np.float64], found: Detection, pitch_px: float, shape: tuple[int, int]
) -> list[tuple[int, int]]:
    """Joined neighbours, looked for in the reduced images (whose centre may lie a fraction of a pixel elsewhere)."""
    factor = found.factor
    height, width = found.brightest.shape
    x = (x_px + shape[1] / 2) / factor - width / 2
    y = (y_px - shape[0] / 2) / factor + height / 2
    return joined_pairs(x, y, found.circles.radius_px / factor, pitch_px / factor, found.slopes, found.brightest)


def _bridge_circles(
    x_px: NDArray[np.float64],
    y_px: NDArray[np.float64],
    radius_px: NDArray[np.float64],
    on: NDArray[np.bool_],
    pitch_px: float,
) -> dict[int, tuple[int, int]]:
    """Small circles off the lattice in the middle between two neighbours, with these neighbours: solder, no balls."""
    between = {}
    small = BRIDGE_SIZE * float(np.median(radius_px))
    standing = np.flatnonzero(on)
    for index in np.flatnonzero(~on & (radius_px < small)):
        distance = np.hypot(x_px[standing] - x_px[index], y_px[standing] - y_px[index])
        near = standing[np.argsort(distance)[:2]]
        if len(near) == 2:  # noqa: PLR2004 - a pair
            middle = x_px[near].mean() - x_px[index], y_px[near].mean() - y_px[index]
            apart = math.hypot(x_px[near[0]] - x_px[near[1]], y_px[near[0]] - y_px[near[1]])
            if math.hypot(*middle) < BRIDGE_MIDDLE * pitch_px and abs(apart / pitch_px - 1.0) < BRIDGE_MIDDLE:
                between[int(index)] = (int(near.min()), int(near.max()))
    return between


def _inferred(x_px: NDArray[np.float64], y_px: NDArray[np.float64]) -> _Grid:
    """The lattice of the balls themselves."""
    lattice = fit_lattice(x_px, y_px)
    if lattice is None:
        count = len(x_px)
        origin_px = (float(x_px[0]), float(y_px[0])) if count else (0.0, 0.0)
        return _Grid(["A1"] * count, [0] * count, [0] * count, [], [], count, count, None, 0.0, origin_px)
    rows, cols = int(lattice.row[lattice.on].max()) + 1, int(lattice.col[lattice.on].max()) + 1
    row = [int(r) if on else -1 for r, on in zip(lattice.row, lattice.on, strict=True)]
    col = [int(c) if on else -1 for c, on in zip(lattice.col, lattice.on, strict=True)]
    taken = set(zip(row, col, strict=True))
    free = [(r, c) for r in range(rows) for c in range(cols) if (r, c) not in taken]
    return _Grid(
        names=[ball_name(r, c) if r >= 0 else "" for r, c in zip(row, col, strict=True)],
        row=row,
        col=col,
        missing=[(ball_name(r, c), r, c) for r, c in free],
        missing_px=[lattice.place(r, c) for r, c in free],
        rows=rows,
        cols=cols,
        pitch_px=lattice.pitch_px,
        angle_rad=lattice.angle_rad,
        origin_px=(lattice.x_px, lattice.y_px),
    )


def _from_layout(
    x_px: NDArray[np.float64], y_px: NDArray[np.float64], layout: BallLayout, pixel_pitch_um: float
) -> _Grid:
    """The places of a layout."""
    fit = register(x_px, y_px, layout, pixel_pitch_um)
    places = layout.places()
    count = len(x_px)
    names, row, col = [""] * count, [-1] * count, [-1] * count
    missing, missing_px = [], []
    for (name, r, c, _, _), ball, x, y in zip(places, fit.ball, fit.x_px, fit.y_px, strict=True):
        if ball < 0:
            missing.append((name, r, c))
            missing_px.append((float(x), float(y)))
        else:
            names[ball], row[ball], col[ball] = name, r, c
    rows = layout.rows or max(place.row for place in places) + 1
    cols = layout.cols or max(place.col for place in places) + 1
    # The place (0, 0), which need not have a ball.
    first = min(places, key=lambda place: (place.row, place.col))
    left_um, top_um = min(place.x_um for place in places), max(place.y_um for place in places)
    if layout.pitch_um is not None:
        left_um, top_um = 0.0, 0.0
    shift = (left_um - first.x_um + 1j * (top_um - first.y_um)) * fit.scale_px_per_um * np.exp(1j * fit.angle_rad)
    at = places.index(first)
    pitch_um = layout.pitch_um or _nearest_distance_um(places)
    return _Grid(
        names=names,
        row=row,
        col=col,
        missing=missing,
        missing_px=missing_px,
        rows=rows,
        cols=cols,
        pitch_px=None if pitch_um is None else pitch_um * fit.scale_px_per_um,
        angle_rad=fit.angle_rad,
        origin_px=(float(fit.x_px[at] + shift.real), float(fit.y_px[at] + shift.imag)),
    )


def _nearest_distance_um(places: tuple[LayoutPlace, ...]) -> float | None:
    """Median distance to the nearest other place."""
    if len(places) < 2:  # noqa: PLR2004 - a distance needs two
        return None
    points = np.array([place.x_um + 1j * place.y_um for place in places])
    apart = np.abs(points[:, None] - points)
    np.fill_diagonal(apart, np.inf)
    return float(np.median(apart.min(axis=1)))


def _record(
    x_px: NDArray[np.float64],
    y_px: NDArray[np.float64],
    found: Detection,
    grid: _Grid,
    joined: list[tuple[int, int]],
    unclear: set[str],
) -> FoundBalls:
    """Balls in reading order, those off the lattice last and numbered X1, X2, ..."""
    circles = found.circles
    in_bridge = {index for pair in joined for index in pair}
    off = [index for index in range(len(x_px)) if grid.row[index] < 0]
    off.sort(key=lambda index: (-y_px[index], x_px[index]))
    on = sorted((index for index in range(len(x_px)) if grid.row[index] >= 0), key=lambda i: (grid.row[i], grid.col[i]))
    names = dict(zip(off, (f"X{number}" for number in range(1, len(off) + 1)), strict=True))
    names |= {index: grid.names[index] for index in on}
    order = {index: number for number, index in enumerate(on + off)}
    balls = tuple(
        FoundBall(
            name=names[index],
            row=grid.row[index] if grid.row[index] >= 0 else None,
            col=grid.col[index] if grid.row[index] >= 0 else None,
            x_px=float(x_px[index]),
            y_px=float(y_px[index]),
            radius_px=float(circles.radius_px[index]),
            u_centre_px=float(circles.u_centre_px[index]),
            u_radius_px=float(circles.u_radius_px[index]),
            kind="bridged" if index in in_bridge else "ball" if grid.row[index] >= 0 else "extra",
        )
        for index in on + off
    )
    sizes: list[tuple[str, float]] = []
    if len(balls) >= ENOUGH_TO_JUDGE_SIZE:
        usual_px = float(np.median(circles.radius_px))
        sizes = [(ball.name, ball.radius_px / usual_px) for ball in balls]
    return FoundBalls(
        balls=balls,
        missing=tuple(grid.missing),
        unclear=tuple(name for name, _, _ in grid.missing if name in unclear),
        bridges=tuple(sorted((names[i], names[j]) if order[i] < order[j] else (names[j], names[i]) for i, j in joined)),
        rows=grid.rows,
        cols=grid.cols,
        pitch_px=grid.pitch_px,
        angle_deg=math.degrees(grid.angle_rad),
        origin_px=grid.origin_px,
        odd_sizes=tuple((name, ratio) for name, ratio in sizes if abs(ratio - 1.0) > ODD_SIZE),
    )
