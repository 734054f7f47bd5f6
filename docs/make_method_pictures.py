"""Draw the pictures of docs/reflectance.md, and one of docs/inspection.md, from simulated captures.

Command: ``make method``.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from typing import NamedTuple

import bgars
import numpy as np
from bgars.records.surface_material import SurfaceLobe, SurfaceMaterial
from bgars.report.figures.prior import prior_overlay, prior_share, show_prior
from bgars.simulate import Defect
from matplotlib.colors import LogNorm
from matplotlib.patches import Circle
from method_failures import failure, inspected_alike
from method_parts import (
    BOARD,
    FOLDER,
    GREY_LEVELS,
    METAL,
    NOISY,
    PAINT,
    RIG,
    Floats,
    Part,
    bent,
    circle_normals,
    levels,
    made,
    say,
)
from scipy.optimize import least_squares

from experiments.style import OKABE_ITO, TRUTH_STYLE, figure_style, new_figure, panels, save, tidy

ERROR_LIMITS_DEG = (0.02, 20.0)
ROUGHNESSES = (0.2, 0.225, 0.25, 0.275, 0.3, 0.325, 0.35, 0.375, 0.4)
SHARED = 3
"""Parameters of the material that all pixels share."""

# --- 1: a ring of lights trades slant against the lobe


class Blind(NamedTuple):
    """What is left, and how wrong the normals are, with an assumed roughness."""

    roughness: float
    residual_anchored: float
    residual_blind: float
    error_deg: float


def simple_material(strength: float, roughness: float, diffuse: float, tail: float = 0.0) -> SurfaceMaterial:
    """One lobe on Lambertian paint."""
    return SurfaceMaterial(diffuse, 0.0, 0.0, (SurfaceLobe(strength, roughness, tail),), "cook-torrance", (1.0,) * 8)


def ring_ambiguity() -> None:
    """Residuals against an assumed roughness, with normals known and with normals free."""
    slants = np.radians(np.linspace(4.0, 60.0, 12))
    azimuths = np.radians(np.linspace(0.0, 330.0, 12) * 1.07)
    true = np.stack([np.sin(slants) * np.cos(azimuths), np.sin(slants) * np.sin(azimuths), np.cos(slants)], axis=1)
    true_material = simple_material(150.0, 0.3, 20.0)
    seen = bent(levels(true_material, true, RIG.directions))

    def predicted(parameters: Floats, roughness: float) -> tuple[Floats, Floats]:
        """Levels and normals; parameters: ln strength, ln diffuse, tail, then n_x, n_y and ln albedo of each pixel."""
        strength, diffuse = np.exp(parameters[:2])
        material = simple_material(float(strength), roughness, float(diffuse), float(np.clip(parameters[2], 0, 1)))
        if len(parameters) == SHARED:
            return levels(material, true, RIG.directions), true
        pixels = parameters[SHARED:].reshape(-1, 3)
        z = np.sqrt(np.maximum(1 - (pixels[:, :2] ** 2).sum(1), 1e-4))
        normals = np.column_stack([pixels[:, :2], z])
        return levels(material, normals, RIG.directions) * np.exp(pixels[:, 2:]), normals

    found: list[Blind] = []
    example: dict[float, Floats] = {}
    for roughness in ROUGHNESSES:

        def residuals(parameters: Floats, roughness: float = roughness) -> Floats:
            rest: Floats = (bent(predicted(parameters, roughness)[0]) - seen).ravel()
            return rest

        known = least_squares(residuals, [*np.log([150.0, 20.0]), 0.05])
        pixels = np.column_stack([true[:, :2], np.zeros(len(true))])
        free = least_squares(residuals, np.concatenate([known.x, pixels.ravel()]))
        example[roughness], normals = predicted(free.x, roughness)
        error = np.degrees(np.arccos(np.clip((normals * true).sum(1), -1, 1)))
        rms = [float(np.sqrt((fit.fun**2).mean())) for fit in (known, free)]
        found.append(Blind(roughness, rms[0], rms[1], float(error.mean())))
    figure = new_figure(11.5, 3.7)
    left, middle, right = panels(figure, 1, 3)[0]
    m = [entry.roughness for entry in found]
    left.plot(
        m, [entry.residual_anchored for entry in found], "o-", color=OKABE_ITO[1], label="normals known (circles)"
    )
    left.plot(m, [entry.residual_blind for entry in found], "s--", color=OKABE_ITO[0], label="normals free (blind)")
    left.set(xlabel="roughness m that is assumed (true: 0.3)", ylabel="residual left, RMS (grey levels, bent)")
    left.set_title("What the data say of the lobe")
    left.legend()
    middle.plot(m, [entry.error_deg for entry in found], "s--", color=OKABE_ITO[0])
    middle.set(xlabel="roughness m that is assumed (true: 0.3)", ylabel="mean error of the free normals (°)")
    middle.set_title("What a wrong lobe does to the normals")
    pixel = 5
    azimuth = np.degrees(np.arctan2(RIG.directions[:, 1], RIG.directions[:, 0])) % 360
    order = np.argsort(azimuth)
    observed = levels(true_material, true, RIG.directions)[pixel]
    right.plot(azimuth[order], observed[order], "o", color="black", markersize=8, markerfacecolor="none", label="seen")
    for roughness, style, color in ((0.25, "--", OKABE_ITO[0]), (0.35, ":", OKABE_ITO[4])):
        right.plot(
            azimuth[order],
            example[roughness][pixel][order],
            style,
            color=color,
            marker=".",
            label=f"fit, m = {roughness}",
        )
    right.set(xlabel="azimuth of the light (°)", ylabel="grey level of 255", xticks=range(0, 361, 90))
    right.set_title(f"One pixel, true slant {np.degrees(slants[pixel]):.0f}°")
    right.legend()
    for axes in (left, middle, right):
        tidy(axes)
        axes.set_ylim(bottom=0)
    save(figure, FOLDER / "ring_ambiguity.png")
    for entry in found:
        say("ring", entry)


# --- 2: what the fitted material predicts


def fit_profile() -> None:
    """Observed and predicted levels along the middle row of a ball, a panel a light."""
    material = bgars.Material(i_d=0.35, i_s=0.7, roughness=0.2, distribution="ggx")
    part = made(bgars.Scene.ball(board=BOARD), material)
    fit = fitted(part)
    circle = fit.circles_px[0]
    normals, inside = circle_normals(part.capture.mask.shape, circle)
    row = int(part.capture.mask.shape[0] / 2 - circle[1])
    cols = np.flatnonzero(inside[row])
    predicted = levels(fit.material, normals[row, cols], part.capture.rig.directions)
    x = normals[row, cols, 0]
    figure = new_figure(11.5, 5.2)
    for light, axes in enumerate(axes for line in panels(figure, 2, 4, sharex=True, sharey=True) for axes in line):
        seen = part.capture.images[light, row, cols].astype(float)
        axes.plot(x, seen, "o", color="black", markersize=3, markerfacecolor="none", label="camera")
        axes.plot(
            x, np.minimum(predicted[:, light], GREY_LEVELS), color=OKABE_ITO[0], linewidth=1.4, label="fitted material"
        )
        axes.set_title(f"light {light}, azimuth {part.capture.rig.azimuths_deg[light] % 360:.0f}°")
        axes.axhline(GREY_LEVELS, color="0.6", linewidth=0.8, linestyle=":")
        tidy(axes)
        if light % 4 == 0:
            axes.set_ylabel("grey level of 255")
        if light >= 4:  # noqa: PLR2004
            axes.set_xlabel("x from the centre (ball radii) = n_x")
        if light == 0:
            axes.legend(loc="upper left")
    save(figure, FOLDER / "fit_profile.png")
    lobe = fit.material.lobes[0]
    say("fit", fit.loss, fit.material.diffuse_level, lobe, fit.material.masking, fit.material.standard_errors)


def fitted(part: Part) -> bgars.records.reflectance_fit.ReflectanceFit:
    """What the estimator learnt of a part."""
    fit = part.field.reflectance
    if fit is None or not fit.accepted:
        sys.exit(f"no material was fitted: {part.field.method_reason}")
    return fit


# --- 3: residuals that the balls share


def residual_table() -> None:
    """A part whose balls mirror the board: what the material leaves, what the other balls say, what is left then."""
    board = bgars.Board(material=bgars.Material.matte(0.35))
    scene = bgars.Scene.ball_array(3, 3, board=board)
    capture, truth = bgars.simulate(scene, RIG, PAINT, NOISY)
    normal = np.where(truth.mask[..., None], truth.normals, [0.0, 0.0, 1.0]).astype(float)
    board_level = GREY_LEVELS * 0.35 * RIG.directions[:, 2]
    # One bounce of a wide board: a facet sees (1 - n_z) / 2 of it; the camera sees it mirrored where the ray goes down.
    diffuse = PAINT.i_d * (1 - normal[..., 2]) / 2
    mirrored = 0.25 * np.clip((1 - 2 * normal[..., 2] ** 2) / 0.2, 0.0, 1.0)
    extra = np.where(truth.mask, diffuse + mirrored, 0.0) * board_level[:, None, None]
    images = np.clip(np.rint(capture.images + extra), 0, 255).astype(np.uint8)
    capture = replace(capture, images=images)
    part = Part(capture, truth, bgars.estimate_normals(capture))
    fit = fitted(part)
    side = 41
    rest = []
    for circle in fit.circles_px:
        normals, inside = circle_normals(capture.mask.shape, circle)
        seen = bent(np.minimum(capture.images[:, inside].T.astype(float), GREY_LEVELS))
        predicted = bent(np.minimum(levels(fit.material, normals[inside], RIG.directions), GREY_LEVELS))
        difference = (seen - predicted)[:, 0]
        cells = np.round((normals[inside][:, :2] + 1) / 2 * (side - 1)).astype(int)
        sums, counts = np.zeros((side, side)), np.zeros((side, side))
        np.add.at(sums, (cells[:, 1], cells[:, 0]), difference)
        np.add.at(counts, (cells[:, 1], cells[:, 0]), 1)
        rest.append(np.where(counts > 0, sums / np.maximum(counts, 1), np.nan))
    one = 4
    tables = np.array([table for ball, table in enumerate(rest) if ball != one])
    others = np.full((side, side), np.nan)
    shown = np.isfinite(tables).any(axis=0)
    others[shown] = np.nanmedian(tables[:, shown], axis=0)
    figure = new_figure(11.5, 3.9)
    titles = ("This ball: seen less fitted material", "Median of the eight other balls", "What is left of this ball")
    for axes, table, title in zip(
        panels(figure, 1, 3)[0], (rest[one], others, rest[one] - others), titles, strict=True
    ):
        picture = axes.imshow(table, cmap="RdBu_r", vmin=-15, vmax=15, origin="lower", extent=(-1, 1, -1, 1))
        axes.set(xlabel="n_x", ylabel="n_y", title=f"{title}\nRMS {np.sqrt(np.nanmean(table**2)):.1f}")
    figure.colorbar(picture, ax=figure.axes, label="grey levels, bent (light 0)", shrink=0.85)
    save(figure, FOLDER / "residual_table.png")
    error = part.error_deg()
    judged = truth.mask & (truth.normals[..., 2] > 0.3)  # noqa: PLR2004
    say("residuals", fit.residuals_learnt, fit.loss, np.nanmean(error[judged]))


# --- 4: measured and prior


def measured_prior() -> None:
    """Stated and true errors of an easy part and of bare metal, priors striped."""
    figure = new_figure(11.0, 10.0)
    rows = panels(figure, 2, 2)
    for line, (name, material) in zip(
        rows, (("solder, I_d = 0.5", PAINT), ("bare metal, I_d = 0", METAL)), strict=True
    ):
        part = made(bgars.Scene.ball_array(2, 2, board=BOARD), material)
        height, width = part.capture.mask.shape
        pitch = part.capture.pixel_pitch_um or 1.0
        extent = (-width / 2 * pitch, width / 2 * pitch, -height / 2 * pitch, height / 2 * pitch)
        stated = np.where(part.truth.mask, part.field.standard_error_deg, np.nan)
        measured = part.truth.mask & part.field.is_measured
        error = part.error_deg()
        prior = part.truth.mask & part.field.mask & ~measured
        inside = (error <= part.field.standard_error_deg)[measured].mean()
        inside_prior = (error <= part.field.standard_error_deg)[prior].mean()
        titles = (
            f"{name}: stated standard error\nprior (striped): {prior_share(part.field)}",
            f"{name}: true error\n"
            f"measured: mean {np.nanmean(error[measured]):.2f}°, {100 * inside:.0f} % within the stated error\n"
            f"prior: mean {np.nanmean(error[prior]):.2f}°, {100 * inside_prior:.0f} % within",
        )
        for axes, values, title in zip(line, (stated, error), titles, strict=True):
            picture = axes.imshow(
                np.maximum(values, ERROR_LIMITS_DEG[0]),
                extent=extent,
                cmap="viridis_r",
                norm=LogNorm(*ERROR_LIMITS_DEG),
            )
            show_prior(axes, prior_overlay(part.field), extent)
            axes.set(xlabel="x (µm)", ylabel="y (µm)", title=title, xlim=(-900, 900), ylim=(-900, 900))
        bar = figure.colorbar(picture, ax=line, label="angle (°)", shrink=0.85, ticks=(0.02, 0.1, 0.5, 2, 10))
        bar.ax.set_yticklabels(["0.02", "0.1", "0.5", "2", "10"])
        say("prior", name, prior_share(part.field), inside, inside_prior, part.field.method_reason)
    save(figure, FOLDER / "measured_prior.png")


# --- 5: a flat top


def flat_top() -> None:
    """Slants along the middle of a clipped ball: sphere of its circle, truth, estimate."""
    scene = bgars.Scene.ball_array(3, 3, board=BOARD, defects={"B2": Defect.clipped(40.0)})
    part = made(scene, PAINT)
    fit = fitted(part)
    ball = int(np.argmin([np.hypot(x, y) for x, y, _ in fit.circles_px]))
    circle, flat = fit.circles_px[ball], fit.flat_radius[ball]
    height, width = part.capture.mask.shape
    normals, inside = circle_normals((height, width), circle)
    row = int(height / 2 - circle[1])
    cols = np.flatnonzero(inside[row])
    slant = lambda values: np.degrees(np.arctan2(values[row, cols, 0], values[row, cols, 2]))  # noqa: E731
    x = normals[row, cols, 0]
    figure = new_figure(11.5, 4.4)
    left, right = panels(figure, 1, 2, width_ratios=(1.5, 1))[0]
    left.plot(x, slant(normals), color=OKABE_ITO[5], linewidth=1.4, label="sphere of its circle")
    left.plot(x, slant(part.truth.normals), **TRUTH_STYLE)
    left.plot(x, slant(part.field.normals), "o", color=OKABE_ITO[0], markersize=3.5, label="estimate")
    if flat is not None:
        left.axvspan(-flat, flat, color="0.93", label="flat top that was found", zorder=0)
    left.set(xlabel="x from the centre (ball radii)", ylabel="slant toward +x (°)", ylim=(-75, 75))
    left.set_title("A ball whose top is cut off, middle row")
    left.legend(loc="upper left")
    tidy(left)
    row0, col0, radius = height / 2 - circle[1] - 0.5, width / 2 + circle[0] - 0.5, circle[2] * 1.1
    error = part.error_deg()
    picture = right.imshow(
        np.maximum(error, ERROR_LIMITS_DEG[0]),
        extent=(
            (-col0 - 0.5) / circle[2],
            (width - 0.5 - col0) / circle[2],
            (row0 - height + 0.5) / circle[2],
            (row0 + 0.5) / circle[2],
        ),
        cmap="viridis_r",
        norm=LogNorm(*ERROR_LIMITS_DEG),
    )
    if flat is not None:
        right.add_patch(Circle((0, 0), flat, fill=False, color="black", linewidth=1.2, linestyle="--"))
    right.set(xlim=(-1.1, 1.1), ylim=(-1.1, 1.1), xlabel="x (ball radii)", ylabel="y (ball radii)")
    right.set_title("True error of its normals; dashed: the flat's edge")
    bar = figure.colorbar(picture, ax=right, label="angle (°)", ticks=(0.02, 0.1, 0.5, 2, 10))
    bar.ax.set_yticklabels(["0.02", "0.1", "0.5", "2", "10"])
    save(figure, FOLDER / "flat_top.png")
    judged = inside & part.truth.mask & (part.truth.normals[..., 2] > 0.3)  # noqa: PLR2004
    say("flat", flat, np.nanmean(error[judged]), radius)


PICTURES = (ring_ambiguity, fit_profile, residual_table, measured_prior, flat_top, failure, inspected_alike)


def main() -> None:
    """Draw all, or those named."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    with figure_style():
        for picture in PICTURES:
            if picture.__name__ in sys.argv[1:] or len(sys.argv) == 1:
                picture()


if __name__ == "__main__":
    main()
