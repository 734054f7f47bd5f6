"""Pictures of where the method fails: all balls of a part flattened alike."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import bgars
import numpy as np
from method_parts import BOARD, FOLDER, METAL, NOISY, PAINT, RIG, circle_normals, made, say

from experiments.style import OKABE_ITO, TRUTH_STYLE, new_figure, panels, save, tidy


class Squashed(NamedTuple):
    """All balls of a part flattened alike."""

    q: float
    error_deg: float
    circle_deg: float
    stated_deg: float
    loss: float


def failure() -> None:
    """All balls flattened alike: the circles are wrong for all, and nothing in view says so."""
    figure = new_figure(11.5, 4.2)
    left, right = panels(figure, 1, 2)[0]
    for material, name, color, marker in (
        (PAINT, "I_d = 0.5", OKABE_ITO[1], "o"),
        (METAL, "bare metal", OKABE_ITO[0], "s"),
    ):
        found = []
        for q in (1.0, 0.98, 0.95, 0.9, 0.85):
            scene = bgars.Scene.ball_array(2, 2, board=BOARD)
            scene = replace(scene, balls=tuple(replace(ball, aspect_ratio=q) for ball in scene.balls))
            part = made(scene, material)
            error, fit = part.error_deg(), part.field.reflectance
            judged = part.truth.mask & (part.truth.normals[..., 2] > 0.3)  # noqa: PLR2004
            circle = np.full(error.shape, np.nan)
            for place in fit.circles_px if fit is not None else ():
                normals, inside = circle_normals(error.shape, place)
                off = bgars.angular_error_deg(normals.astype(np.float32), part.truth.normals)
                circle[inside] = off[inside]
            stated = float(np.median(part.field.standard_error_deg[judged]))
            found.append(
                Squashed(
                    q,
                    float(np.nanmean(error[judged])),
                    float(np.nanmean(circle[judged])),
                    stated,
                    fit.loss if fit else np.nan,
                )
            )
            say("failure", name, found[-1], part.field.method_reason)
        q_values = [entry.q for entry in found]
        left.plot(
            q_values, [entry.error_deg for entry in found], marker=marker, color=color, label=f"true error, {name}"
        )
        left.plot(
            q_values,
            [entry.stated_deg for entry in found],
            marker=marker,
            color=color,
            linestyle=":",
            markerfacecolor="none",
            label=f"stated (median), {name}",
        )
        right.plot(q_values, [entry.loss for entry in found], marker=marker, color=color, label=name)
        if material is PAINT:
            left.plot(
                q_values,
                [entry.circle_deg for entry in found],
                **{**TRUTH_STYLE, "label": "error of the circles' spheres"},
            )
    left.set(
        xlabel="q of all balls (vertical over horizontal radius)",
        ylabel="angle (°)",
        title="Every ball flattened alike",
    )
    left.invert_xaxis()
    left.legend()
    right.set(
        xlabel="q of all balls (vertical over horizontal radius)",
        ylabel="loss of the material (above 2: refused)",
        title="What the fit itself says",
    )
    right.invert_xaxis()
    right.legend()
    for axes in (left, right):
        tidy(axes)
        axes.set_ylim(bottom=0)
    save(figure, FOLDER / "failure.png")


# --- 7: the same part inspected


def inspected_alike() -> None:
    """Heights of a part whose balls are all flattened alike: true errors and stated uncertainties."""
    q_values, errors_um, stated_um, moved_deg = (1.0, 0.98, 0.95, 0.9), [], [], []
    for q in q_values:
        scene = bgars.Scene.ball_array(4, 4, board=bgars.Board(material=bgars.Material.matte(0.3)))
        scene = replace(scene, balls=tuple(replace(ball, aspect_ratio=q) for ball in scene.balls))
        capture, truth = bgars.simulate(scene, RIG, PAINT, NOISY)
        result = bgars.inspect(capture)
        pairs = list(zip(result.balls, truth.balls, strict=True))
        errors_um.append(float(np.median([found.top_um - true.top_um for found, true in pairs])))
        stated_um.append(float(np.median([2 * found.u_top_um for found, _ in pairs])))
        elevation_deg = np.degrees(np.arcsin(np.array(result.light_directions)[:, 2]))
        moved_deg.append(float(np.mean(elevation_deg - RIG.elevations_deg)))
        ratio = float(np.median([ball.aspect_ratio for ball in result.balls]))
        say("inspected", q, errors_um[-1], stated_um[-1], moved_deg[-1], ratio)
    figure = new_figure(11.5, 3.9)
    left, right = panels(figure, 1, 2)[0]
    left.plot(q_values, errors_um, "o-", color=OKABE_ITO[0], label="true error of the heights (median)")
    left.plot(q_values, stated_um, "s:", color=OKABE_ITO[1], markerfacecolor="none", label="stated, U = 2 u")
    left.set(xlabel="q of all balls (vertical over horizontal radius)", ylabel="height above the board (µm)")
    left.set_title("Every ball of a part flattened alike")
    left.legend()
    right.plot(q_values, moved_deg, "o-", color=OKABE_ITO[0])
    right.set(xlabel="q of all balls (vertical over horizontal radius)", ylabel="mean move of the elevations (°)")
    right.set_title("What the fit blames instead: the lights")
    for axes in (left, right):
        axes.invert_xaxis()
        tidy(axes)
    save(figure, FOLDER.parent / "inspection" / "flattened_alike.png")
