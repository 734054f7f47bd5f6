"""The shadow fit over the images: whoever looks sees at once whether heights can be trusted."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.collections import LineCollection

from bgars.files.light_names import light_name
from bgars.report.figures.shadow_lights import flagged_lights, is_fitted, panel_lights
from bgars.report.figures.shadow_outline import shadow_outline_um
from bgars.report.figures.style import (
    VERDICT_COLORS,
    add_axes,
    ball_place_um,
    ball_radius_um,
    discs,
    image_extent_um,
    new_figure,
    part_frame,
    part_window,
    shown_image,
    window_size_in,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from bgars.records.ball_result import BallResult
    from bgars.records.capture import Capture
    from bgars.records.part_result import PartResult

__all__ = ["shadow_figure"]

OUTLINE = "#00E5FF"
SILHOUETTE = "#FF4FD8"
FLAGGED = "; orange title: a reason or warning names this light"
CLOSE_UPS = 4
WHOLE_IN, CLOSE_IN = 6.7, 3.0
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
    window = part_window(result, image_extent_um(capture), margin=2.0)
    wide_in, tall_in = window_size_in(window, WHOLE_IN)
    axes = add_axes(figure, 0.9 + (WHOLE_IN - wide_in) / 2, 0.6 + (WHOLE_IN - tall_in) / 2, wide_in, tall_in)
    first = flagged[0] if flagged else 0
    _show_light(axes, capture, result, first)
    _draw(axes, result.balls, result, capture, first, linewidth=0.9)
    part_frame(axes, window)
    middle = _typical_ball(result)
    lights = panel_lights(result, len(capture.rig), CLOSE_UPS)
    for number, light in enumerate(lights):
        row, col = divmod(number, 2)
        panel = add_axes(figure, 8.3 + 3.4 * col, 4.35 - 3.9 * row, CLOSE_IN, CLOSE_IN)
        _show_light(panel, capture, result, light)
        panel.set(xticks=[], yticks=[], xlabel="", ylabel="")
        place = None if middle is None else ball_place_um(middle)
        if middle is None or place is None:
            continue
        half_um = REACH * ball_radius_um(middle, result)
        near = [
            ball
            for ball in result.balls
            if (at := ball_place_um(ball)) and max(abs(at[0] - place[0]), abs(at[1] - place[1])) < 2.0 * half_um
        ]
        _draw(panel, near, result, capture, light, linewidth=1.6)
        panel.set_xlim(place[0] - half_um, place[0] + half_um)
        panel.set_ylim(place[1] - half_um, place[1] + half_um)
        panel.set_title(f"{middle.name}, {panel.get_title()}", fontsize=10)
        panel.set_xlabel(f"{2 * half_um:.0f} µm wide")
    return figure


def _show_light(axes: Axes, capture: Capture, result: PartResult, light: int) -> None:
    shown = shown_image(capture.images[light])
    axes.imshow(np.sqrt(shown), extent=image_extent_um(capture), cmap="gray", vmin=0.0, vmax=1.0)
    is_flagged = light in flagged_lights(result)
    axes.set_title(
        f"{light_name(light, capture.files)}\nazimuth {capture.rig.azimuths_deg[light]:.0f}°, {_moved(result, light)}",
        fontsize=10,
        color=VERDICT_COLORS["fail"] if is_flagged else "black",
    )
    axes.set_xlabel("x (µm)")
    axes.set_ylabel("y (µm)")


def _draw(
    axes: Axes, balls: Sequence[BallResult], result: PartResult, capture: Capture, light: int, *, linewidth: float
) -> None:
    """Silhouettes of the balls, and the outlines of their shadows as they were fitted."""
    there = [(place, ball) for ball in balls if ball.present and (place := ball_place_um(ball))]
    radii = [ball_radius_um(ball, result) for _, ball in there]
    places = [place for place, _ in there]
    discs(axes, places, radii, facecolors="none", edgecolors=SILHOUETTE, linewidths=linewidth)
    outlines = [outline for _, ball in there if (outline := _shadow(ball, result, capture, light)) is not None]
    axes.add_collection(LineCollection(outlines, colors=OUTLINE, linewidths=linewidth), autolim=False)


def _shadow(ball: BallResult, result: PartResult, capture: Capture, light: int) -> NDArray[np.float64] | None:
    """The outline of a ball's shadow; None where too little of the ball was measured."""
    if not all(math.isfinite(value) for value in (ball.x_um, ball.diameter_um, ball.centre_z_um)):
        return None
    slopes, board_z_um = _board(result.board_coefficients_um, ball.x_um, ball.y_um)
    toward = result.light_directions[light]
    if capture.rig.positions_um is not None:
        toward = toward * np.linalg.norm(capture.rig.positions_um[light]) - [0.0, 0.0, board_z_um]
    return shadow_outline_um(
        np.array([ball.x_um, ball.y_um, ball.centre_z_um]),
        ball.diameter_um / 2,
        ball.aspect_ratio if math.isfinite(ball.aspect_ratio) else 1.0,
        np.asarray(toward, dtype=np.float64),
        slopes,
        is_position=capture.rig.positions_um is not None,
    )


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
    return f"refined by {moved:.2f}°"


def _residual(value: float) -> str:
    return f"residual {100 * value:.1f} % of the contrast" if math.isfinite(value) else "no shadow was fitted"
