"""Fig. 3: the input images of one ball."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from experiments.outcome import Experiment, Outcome, Picture
from experiments.setting import Setting
from experiments.style import new_figure, panels
from experiments.words import listed, row_table, span

if TYPE_CHECKING:
    from experiments.outcome import Row, Run

__all__ = ["FIG3"]

COLUMNS = ("light", "azimuth_deg", "elevation_deg", "mean_grey", "max_grey", "clipped_percent", "shadow_percent")


def run(how: Run) -> Outcome:
    """One image a light, and what of the ball it clips and leaves dark."""
    setting = Setting()
    capture, truth = setting.photograph(how.radius_px)
    extent = image_extent_px(capture.images.shape)
    figure = new_figure(11.0, 6.0)
    grid = panels(figure, 2, (len(capture.rig) + 1) // 2, sharex=True, sharey=True)
    places = [axes for line in grid for axes in line]
    rows: list[Row] = []
    picture = None
    for index, (axes, image) in enumerate(zip(places, capture.images, strict=False)):
        azimuth_deg = float(capture.rig.azimuths_deg[index])
        picture = axes.imshow(image, cmap="gray", vmin=0, vmax=255, extent=extent, interpolation="nearest")
        axes.set_title(f"light {index}: azimuth {azimuth_deg:.0f}°")
        ball = image[truth.mask]
        rows.append(
            {
                "light": index,
                "azimuth_deg": azimuth_deg,
                "elevation_deg": setting.elevation_deg,
                "mean_grey": float(ball.mean()),
                "max_grey": float(ball.max()),
                "clipped_percent": 100.0 * float(np.mean(ball >= capture.saturation)),
                "shadow_percent": 100.0 * float(np.mean(~truth.lit[index][truth.mask])),
            }
        )
    for line in grid:
        line[0].set_ylabel("y (px)")
    for axes in grid[-1]:
        axes.set_xlabel("x (px)")
    if picture is not None:
        figure.colorbar(picture, ax=places, label="grey level", shrink=0.8)
    clipped = span((float(row["clipped_percent"]) for row in rows), 2)
    shadow = span(float(row["shadow_percent"]) for row in rows)
    return Outcome(
        pictures=(Picture("fig3", figure, "Input images: one light at a time, ring at 45° elevation."),),
        columns=COLUMNS,
        rows=rows,
        table=row_table(
            {
                "light": "{light}",
                "azimuth (deg)": "{azimuth_deg:g}",
                "mean grey": "{mean_grey:.1f}",
                "largest grey": "{max_grey:.0f}",
                "clipped (% of the ball)": "{clipped_percent:.2f}",
                "in shadow (%)": "{shadow_percent:.1f}",
            },
            rows,
        ),
        about=f"A hemisphere under {listed([float(setting.lights)])} lights, one image per light.",
        agrees=("each image has one highlight, which walks around the top with the light.",),
        differs=(
            f"each image also leaves {shadow} % of the hemisphere in attached shadow, at grey level 0, and clips "
            f"{clipped} % of it; the equation I = k_d L n has no term for either.",
        ),
    )


def image_extent_px(shape: tuple[int, ...]) -> tuple[float, float, float, float]:
    """Left, right, bottom, top of an image, origin at its centre."""
    height, width = shape[-2:]
    return (-width / 2, width / 2, -height / 2, height / 2)


FIG3 = Experiment("fig3", "Fig. 3: input images of a ball", "the input images of one ball, a light at a time", run)
