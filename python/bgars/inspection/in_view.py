"""Lights whose shadows lie mostly outside the image: what can be said of them, and what cannot."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.files.light_names import light_name, numbered
from bgars.inspection.board import Board
from bgars.inspection.shadow_model import Balls, Lights, edge_at
from bgars.inspection.start import ANGLES

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from bgars.inspection.problem import Problem
    from bgars.inspection.shadow_edges import Edges

__all__ = ["fitting_stretches", "lights_in_view", "unjudged_lights"]

Array = NDArray[np.float64]
Index = NDArray[np.intp]

MOSTLY = 0.5
"""A first look judges a light by the ends of its shadows, where this share of them lies in the image."""
FITTING_WEIGHT, STRONG = 0.3, 0.4
"""Weight in the fit from which on a stretch of edge fits, and contrast, of the median's, that is an edge."""
MISFIT_SHARE = 0.3
"""Where fewer of the stretches of edge that are in view fit, a light or an image is not what the rig says."""
FEWEST_STRETCHES = 3
"""Fewer stretches in view say nothing."""


def lights_in_view(problem: Problem, table: Array) -> NDArray[np.bool_]:
    """(L,) whether most of the predicted ends of a light's shadows lie in the image; (N, 5) balls.

    What balls hide counts as in view: the fit tells hidden shadows from wrong lights, but outside there is nothing.
    """
    balls, lights = Balls.from_table(table).spread(2), Lights.from_table(problem.vectors, problem.near).spread(1, 1)
    edge = edge_at(ANGLES, balls, lights, Board())
    radiance = problem.radiance
    row, col = radiance.row(edge.y), radiance.col(edge.x)
    inside = (row >= 0) & (row < radiance.height) & (col >= 0) & (col < radiance.width)
    in_view: NDArray[np.bool_] = inside.mean(axis=(0, 2)) >= MOSTLY
    return in_view


def fitting_stretches(edges: Edges, weight: Array) -> tuple[Index, Index]:
    """(L,) stretches of edge where enough board was seen, and those of them that fit."""
    strong = edges.contrast_levels > STRONG * np.nanmedian(edges.contrast_levels)
    fitting: Index = ((weight > FITTING_WEIGHT) & strong).sum(axis=(0, 2))
    looked_at: Index = edges.looked_at.sum(axis=(0, 2))
    return looked_at, fitting


def unjudged_lights(
    in_view: NDArray[np.bool_], edges: Edges, weight: Array | None, files: Sequence[Path] = ()
) -> tuple[str, ...]:
    """Say what the fit knows of lights whose shadows lie mostly outside the image.

    Parameters
    ----------
    in_view : (L,) bool
    edges : Edges
        Of the balls in the fit.
    weight : (N, L, S) float64 or None
        Weights of the stretches of edge in the fit; None without a fit.
    files : sequence of Path
        Image of each light.

    Returns
    -------
    tuple of str
        A text for each light whose few stretches do not fit, one for all others.
    """
    none = np.zeros(len(in_view), dtype=np.intp)
    looked_at, fitting = (none, none) if weight is None else fitting_stretches(edges, weight)
    wrong = ~in_view & (looked_at >= FEWEST_STRETCHES) & (fitting < MISFIT_SHARE * looked_at)
    texts = [
        f"{light_name(light, files, what='image')}: most of its shadows lie outside of it, and the rest is not "
        f"where light {light} of the rig casts it ({fitting[light]} of {looked_at[light]} stretches of edge fit)"
        for light in map(int, np.flatnonzero(wrong))
    ]
    others = [int(light) for light in np.flatnonzero(~in_view & ~wrong)]
    if others:
        names = "all lights" if len(others) == len(in_view) else _names(others, files)
        why = "no shadow could be fitted" if weight is None else "most of the shadows lie outside the image"
        texts.append(f"{names}: {why}: where they stand cannot be judged by their shadows")
    return tuple(texts)


def _names(lights: list[int], files: Sequence[Path]) -> str:
    if len(lights) == 1:
        return light_name(lights[0], files)
    return "lights " + ", ".join(numbered(light, files) for light in lights)
