"""Find the balls of a capture: centres, coarse circles, silhouettes, lattice, names."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from bgars.ball_records import BallLayout, FoundBall, FoundBalls
from bgars.balls.circles import find_circles
from bgars.balls.lattice import fit_lattice, place_name
from bgars.balls.levels import Levels

if TYPE_CHECKING:
    from collections.abc import Callable

    from bgars.records import Capture

__all__ = ["find_balls"]


def find_balls(capture, *, layout=None, threads=None, progress=None):
    levels = Levels(capture, threads)
    circles = find_circles(levels)
    x = circles.col + 0.5 - levels.width / 2
    y = levels.height / 2 - circles.row - 0.5
    lattice = fit_lattice(x, y)
    balls = []
    n=len(x)
    for i in range(n):
        r,c,on = (0,0,True) if lattice is None else (int(lattice.row[i]),int(lattice.col[i]),bool(lattice.on[i]))
        balls.append(FoundBall(place_name(r,c) if on else f"X{i}", r if on else None, c if on else None, float(x[i]), float(y[i]), float(circles.radius_px[i]), float(circles.u_centre_px[i]), float(circles.u_radius_px[i]), "ball" if on else "extra"))
    balls.sort(key=lambda b: (b.row is None, b.row, b.col))
    if lattice is None:
        return FoundBalls(tuple(balls),(),(),len(balls),len(balls),None,0.0,(balls[0].x_px,balls[0].y_px) if balls else (0.0,0.0))
    rows=int(lattice.row[lattice.on].max())+1; cols=int(lattice.col[lattice.on].max())+1
    have={(b.row,b.col) for b in balls}
    missing=tuple((place_name(r,c),r,c) for r in range(rows) for c in range(cols) if (r,c) not in have)
    return FoundBalls(tuple(balls),missing,(),rows,cols,lattice.pitch_px,math.degrees(lattice.angle_rad),(lattice.x_px,lattice.y_px))
