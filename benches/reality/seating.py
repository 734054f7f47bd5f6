"""True coplanarity of a part: the range about the least-squares plane, and the seating plane (JESD22-B108)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial import ConvexHull

if TYPE_CHECKING:
    from balls import BallTruth


def coplanarity(balls: list[BallTruth]) -> dict[str, Any]:
    """Planes z = a x + b y + c through the tops, and deviations from them, in mm.

    The seating plane touches the three tops that carry the part: a facet of the upper hull of the tops, with the
    centroid of all balls over it.
    """
    tops = np.array([[ball.x_mm, ball.y_mm, ball.top_z_mm] for ball in balls])
    design = np.c_[tops[:, :2], np.ones(len(tops))]
    regression = np.linalg.lstsq(design, tops[:, 2], rcond=None)[0]
    found: dict[str, Any] = {
        "lsq_plane_abc": regression.tolist(),
        "lsq_range_mm": float(np.ptp(tops[:, 2] - design @ regression)),
    }
    centroid = tops[:, :2].mean(0)
    hull = ConvexHull(tops, qhull_options="QJ")
    most_inside, carriers = -np.inf, None
    for corners, equation in zip(hull.simplices, hull.equations, strict=True):
        if equation[2] <= 1e-9 or abs(np.linalg.det(design[corners])) < 1e-12:
            continue
        inside = np.linalg.solve(design[corners].T, np.r_[centroid, 1.0]).min()
        if inside > max(-1e-6, most_inside):
            most_inside, carriers = inside, corners
    if carriers is not None:
        plane = np.linalg.solve(design[carriers], tops[carriers, 2])
        deviation = design @ plane - tops[:, 2]
        found |= {
            "seating_plane_abc": plane.tolist(),
            "seating_balls": [balls[index].ball.name for index in carriers],
            "seating_max_dev_mm": float(deviation.max()),
            "seating_dev_mm": {
                one.ball.name: round(float(value), 6) for one, value in zip(balls, deviation, strict=True)
            },
        }
    return found
