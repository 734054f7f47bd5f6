"""The shadow fit over the images: whoever looks sees at once whether heights can be trusted."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.patches import Circle

from bgars.light_names import light_name
from bgars.report.part_style import (
    VERDICT_COLORS,
    ball_place_um,
    ball_radius_um,
    image_extent_um,
    new_figure,
    part_frame,
    shown_image,
)
from bgars.report.shadow_lights import flagged_lights, is_fitted, panel_lights
from bgars.report.shadow_outline import shadow_outline_um

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from bgars.part_result import BallResult, PartResult
    from bgars.records import Capture

__all__ = ["shadow_figure"]

OUTLINE = "#00E5FF"
SILHOUETTE = "#FF4FD8"
FLAGGED = "; orange title: a reason or warning names this light"
CLOSE_UPS = 4
REACH = 3.4
"""Half width of a close-up in radii."""


def shadow_figure(result: PartResult, capture: Capture) -> Figure:
    """One light with the fitted outlines of all shadows, and one ball under four lights."""
    figure = new_figure(15.0, 8.2)
    flagged = flagged_lights(result)
    figure.suptitle(
        f"{result.name}: fitted shadows (cyan) and silhouettes (pink) over the images; "
        f"{_residual(result.shadow_residual_rms)}{FLAGGED if flagged else ''}",
        fontsize=13,
    )
    whole, close = figure.subfigures(1, 2, width_ratios=[1.05, 1.0], squeeze=False)[0]
    axes = whole.subplots()
    first = flagged[0] if flagged else 0
    _show_light(axes, capture, result, first)
    for ball in result.balls:
        _draw(axes, ball, result, capture, first, linewidth=0.9)
    part_frame(axes, result, image_extent_um(capture), margin=2.0)
    middle = _typical_ball(result)
    grid = [panel for row in close.subplots(2, 2, squeeze=False) for panel in row]
    lights = panel_lights(result, len(capture.rig), CLOSE_UPS)
    for panel, light in zip(grid, lights, strict=False):
        _show_light(panel, capture, result, light)
        if middle is None:
            continue
        for ball in result.balls:
            _draw(panel, ball, result, capture, light, linewidth=1.6)
        place = ball_place_um(middle)
        if place is not None:
            half_um = REACH * ball_radius_um(middle, result)
            panel.set_xlim(place[0] - half_um, place[0] + half_um)
            panel.set_ylim(place[1] - half_um, place[1] + half_um)
            panel.set_title(f"{middle.name}, {panel.get_title()}", fontsize=10)
    for panel in grid[len(lights) :]:
        panel.set_visible(False)
    return figure


def _show_light(axes: Axes, capture: Capture, result: PartResult, light: int) -> None:
    shown = shown_image(capture, capture.images[light])
    axes.imshow(np.sqrt(shown), extent=image_extent_um(capture), cmap="gray", vmin=0.0, vmax=1.0)
    is_flagged = light in flagged_lights(result)
    axes.set_title(
        f"{light_name(light, capture.files)}\nazimuth {capture.rig.azimuths_deg[light]:.0f}°, {_moved(result, light)}",
        fontsize=10,
        color=VERDICT_COLORS["fail"] if is_flagged else "black",
    )
    axes.set_xlabel("x (µm)")
    axes.set_ylabel("y (µm)")


def _draw(axes: Axes, ball: BallResult, result: PartResult, capture: Capture, light: int, *, linewidth: float) -> None:
    place = ball_place_um(ball)
    if place is None or not ball.present:
        return
    axes.add_patch(Circle(place, ball_radius_um(ball, result), fill=False, edgecolor=SILHOUETTE, linewidth=linewidth))
    q = ball.q if math.isfinite(ball.q) else 1.0
    if not all(math.isfinite(value) for value in (ball.x_um, ball.diameter_um, ball.centre_z_um)):
        return
    slopes, board_z_um = _board(result.board_coefficients_um, ball.x_um, ball.y_um)
    toward = result.light_directions[light]
    if capture.rig.positions_um is not None:
        toward = toward * np.linalg.norm(capture.rig.positions_um[light]) - [0.0, 0.0, board_z_um]
    outline = shadow_outline_um(
        np.array([ball.x_um, ball.y_um, ball.centre_z_um]),
        ball.diameter_um / 2,
        q,
        np.asarray(toward, dtype=np.float64),
        slopes,
        is_position=capture.rig.positions_um is not None,
    )
    if outline is not None:
        axes.plot(outline[:, 0], outline[:, 1], color=OUTLINE, linewidth=linewidth)


def _board(coefficients_um: NDArray[np.float64], x_um: float, y_um: float) -> tuple[NDArray[np.float64], float]:
    """Slopes and height of the board at a place; unknown terms count as 0."""
    c = np.nan_to_num(coefficients_um)
    slopes = np.array([c[1] + 2 * c[3] * x_um + c[4] * y_um, c[2] + c[4] * x_um + 2 * c[5] * y_um])
    height_um = c @ [1.0, x_um, y_um, x_um**2, x_um * y_um, y_um**2]
    return slopes, float(height_um)


def _typical_ball(result: PartResult) -> BallResult | None:
    """The measured ball nearest to the middle."""
    known = [ball for ball in result.balls if ball.present and math.isfinite(ball.top_um)]
    if not known:
        return None
    middle = np.mean([(ball.x_um, ball.y_um) for ball in known], axis=0)
    return min(known, key=lambda ball: math.dist((ball.x_um, ball.y_um), middle))


def _moved(result: PartResult, light: int) -> str:
    """How far the fit moved a light."""
    moved = result.light_change_deg[light] if light < len(result.light_change_deg) else math.nan
    if not is_fitted(result) or not math.isfinite(moved):
        return "not fitted"
    return f"moved by {moved:.2f}°"


def _residual(value: float) -> str:
    return f"residual {value:.1%} of the contrast" if math.isfinite(value) else "no shadow was fitted"
