"""Fig. 5: the sorted values of one pixel, and where the specular filter cuts them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from bgars.normals.pixelwise import DEFAULT_THRESHOLD
from bgars.pipelines.evaluate import angular_error_deg
from bgars.pipelines.normals import estimate_normals

from experiments.measure import FILTER, NAIVE
from experiments.outcome import Experiment, Outcome, Picture
from experiments.setting import Setting
from experiments.style import new_figure, panels, tidy
from experiments.words import markdown_table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from experiments.outcome import Row, Run

__all__ = ["FIG5"]

COLUMNS = (
    "case",
    "i_d",
    "row",
    "col",
    "rank",
    "light",
    "azimuth_deg",
    "grey",
    "gap_to_next",
    "kept",
    "lit",
    "diffuse_grey",
)
BLUE, ORANGE = "#0072B2", "#D55E00"
MIN_KEPT = 3


@dataclass(frozen=True, eq=False)
class Pixel:
    """One pixel under all lights, sorted from the darkest.

    Attributes
    ----------
    case : str
        What it stands for.
    setting : Setting
        Of the capture.
    row, col : int
        Place in the image.
    n_z, naive_deg, filter_deg : float
        True slant, and the error of both methods.
    order : (L,) int
        Light of each rank.
    grey, diffuse_grey : (L,) float
        Measured value, and what a matt surface would show.
    kept, lit : (L,) bool
        Used by the filter; reached by the light.
    """

    case: str
    setting: Setting
    row: int
    col: int
    n_z: float
    naive_deg: float
    filter_deg: float
    order: NDArray[np.intp]
    grey: NDArray[np.float64]
    diffuse_grey: NDArray[np.float64]
    kept: NDArray[np.bool_]
    lit: NDArray[np.bool_]


def pick(case: str, setting: Setting, radius_px: int, *, most_harmed: bool) -> Pixel:
    """The pixel (true n_z > 0.3) whose error the filter lowers most, or raises most."""
    capture, truth = setting.photograph(radius_px)
    field = estimate_normals(capture, method=FILTER, keep_sets=True)
    naive_deg = angular_error_deg(estimate_normals(capture, method=NAIVE).normals, truth.normals)
    filter_deg = angular_error_deg(field.normals, truth.normals)
    gain = (filter_deg - naive_deg) * (1.0 if most_harmed else -1.0)
    judged = truth.mask & (truth.normals[..., 2] > 0.3) & field.mask  # noqa: PLR2004
    row, col = (int(place) for place in divmod(int(np.argmax(np.where(judged, gain, -np.inf))), gain.shape[1]))
    values = capture.images[:, row, col].astype(np.float64)
    order = np.argsort(values, kind="stable")
    facing = capture.rig.directions @ truth.normals[row, col].astype(np.float64)
    if field.kept_sets is None:
        raise AssertionError
    return Pixel(
        case=case,
        setting=setting,
        row=row,
        col=col,
        n_z=float(truth.normals[row, col, 2]),
        naive_deg=float(naive_deg[row, col]),
        filter_deg=float(filter_deg[row, col]),
        order=order,
        grey=values[order],
        diffuse_grey=(capture.full_scale * setting.i_d * np.maximum(facing, 0.0))[order],
        kept=field.kept_sets[row, col][order],
        lit=truth.lit[:, row, col][order],
    )


def run(how: Run) -> Outcome:
    """Three pixels: the filter at its best, at its worst, and at its worst under strong diffuse light."""
    pixels = []
    for index, (case, i_d, harmed) in enumerate((("best", 0.5, False), ("worst", 0.5, True), ("bright", 1.0, True))):
        pixels.append(pick(case, Setting(i_d=i_d), how.radius_px, most_harmed=harmed))
        how.report((index + 1) / 3)
    figure = new_figure(12.5, 6.2)
    top, bottom = panels(figure, 2, len(pixels), sharex=True, sharey="row", height_ratios=(1.7, 1.0))
    headings = ("Most improved", "Most harmed", "Most harmed, bright diffuse")
    for pixel, heading, upper, lower in zip(pixels, headings, top, bottom, strict=True):
        draw_values(upper, pixel)
        draw_gaps(lower, pixel)
        upper.set_title(
            f"{heading} (I_d = {pixel.setting.i_d:g}): row {pixel.row}, col {pixel.col}\n"
            f"error {pixel.naive_deg:.1f}° without, {pixel.filter_deg:.1f}° with the filter"
        )
    top[0].set_ylabel("grey level")
    bottom[0].set_ylabel("gap to the next rank\n(grey levels)")
    figure.legend(*top[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    best, worst, bright = pixels
    dark_kept = sum(int((pixel.kept & ~pixel.lit).sum()) for pixel in (worst, bright))
    return Outcome(
        pictures=(
            Picture(
                "fig5",
                figure,
                "Sorted values of three pixels, the gaps between them, and the cut at the first gap over "
                f"{DEFAULT_THRESHOLD:g} with at least {MIN_KEPT} values below.",
            ),
        ),
        columns=COLUMNS,
        rows=[row for pixel in pixels for row in rows_of(pixel)],
        table=markdown_table(
            ["pixel", "I_d", "n_z", "lights kept", "of them in shadow", "naive (deg)", "filter (deg)"],
            [
                [
                    heading,
                    f"{pixel.setting.i_d:g}",
                    f"{pixel.n_z:.2f}",
                    f"{pixel.kept.sum()}",
                    f"{(pixel.kept & ~pixel.lit).sum()}",
                    f"{pixel.naive_deg:.1f}",
                    f"{pixel.filter_deg:.1f}",
                ]
                for pixel, heading in zip(pixels, headings, strict=True)
            ],
        ),
        about=(
            "The pixels are extremes, chosen by rule: n_z > 0.3, the largest fall and the largest rise of the error "
            "from least squares to the filter. How typical they are says the section on kept lights."
        ),
        agrees=(
            f"a highlight stands apart from the diffuse values by a gap, and cutting there brings the error from "
            f"{best.naive_deg:.1f} to {best.filter_deg:.1f} deg.",
        ),
        differs=(
            f"at the two harmed pixels {dark_kept} of the {int(worst.kept.sum() + bright.kept.sum())} kept values are "
            "attached shadows, whose zeros are no measurement of N.L; where gaps between diffuse values exceed "
            f"{DEFAULT_THRESHOLD:g}, the filter drops those instead ({worst.naive_deg:.1f} to {worst.filter_deg:.1f} "
            f"and {bright.naive_deg:.1f} to {bright.filter_deg:.1f} deg).",
        ),
    )


def draw_values(axes: Axes, pixel: Pixel) -> None:
    """Values over rank: kept, dropped, in shadow, and the matt surface's."""
    rank = np.arange(1, len(pixel.grey) + 1)
    axes.plot(rank, pixel.diffuse_grey, "_", color="black", markersize=16, label="diffuse part alone (truth)")
    for chosen, color, marker, label in ((pixel.kept, BLUE, "o", "kept"), (~pixel.kept, ORANGE, "s", "dropped")):
        axes.plot(rank[chosen], pixel.grey[chosen], marker, color=color, markersize=7, label=label)
    dark = ~pixel.lit
    axes.plot(rank[dark], pixel.grey[dark], "x", color="black", markersize=11, label="in attached shadow")
    if (~pixel.kept).any():
        axes.axvline(float(pixel.kept.sum()) + 0.5, color="0.35", linestyle="--", linewidth=1.2)
    axes.set_ylim(-14, 270)
    tidy(axes)


def draw_gaps(axes: Axes, pixel: Pixel) -> None:
    """Gap after each rank, the threshold, and the cut."""
    gaps = np.diff(pixel.grey)
    cut = int(pixel.kept.sum()) - 1
    colors = [ORANGE if index == cut else "0.7" for index in range(len(gaps))]
    axes.bar(np.arange(len(gaps)) + 1.5, gaps, width=0.55, color=colors)
    axes.axhline(DEFAULT_THRESHOLD, color="0.35", linestyle=":", linewidth=1.4)
    axes.text(0.6, DEFAULT_THRESHOLD + 4, f"threshold {DEFAULT_THRESHOLD:g}", fontsize=8, color="0.25")
    if cut < len(gaps):
        axes.text(cut + 1.5, gaps[cut] + 4, "cut", ha="center", fontsize=9, color=ORANGE)
    axes.set_xlim(0.4, len(pixel.grey) + 0.6)
    axes.set_xticks(range(1, len(pixel.grey) + 1))
    axes.set_xlabel("rank (1 = darkest)")
    axes.margins(y=0.18)
    tidy(axes)


def rows_of(pixel: Pixel) -> list[Row]:
    """A CSV row a rank."""
    gaps: list[float | str] = [*(float(gap) for gap in np.diff(pixel.grey)), ""]
    azimuths_deg = np.arange(pixel.setting.lights) * 360.0 / pixel.setting.lights
    return [
        {
            "case": pixel.case,
            "i_d": pixel.setting.i_d,
            "row": pixel.row,
            "col": pixel.col,
            "rank": rank + 1,
            "light": int(light),
            "azimuth_deg": float(azimuths_deg[light]),
            "grey": float(pixel.grey[rank]),
            "gap_to_next": gaps[rank],
            "kept": int(pixel.kept[rank]),
            "lit": int(pixel.lit[rank]),
            "diffuse_grey": float(pixel.diffuse_grey[rank]),
        }
        for rank, light in enumerate(pixel.order)
    ]


FIG5 = Experiment(
    "fig5",
    "Fig. 5: rank plot of one pixel",
    "sorted values of a pixel, the gaps, and where the filter cuts",
    run,
)
