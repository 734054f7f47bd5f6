"""Figs. 7 to 9: how one image changes with I_d, I_s and h."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from experiments.input_images import image_extent_px
from experiments.outcome import Experiment, Outcome, Picture
from experiments.setting import DIFFUSE, HARDNESS, SPECULAR, Setting
from experiments.style import new_figure, panels, tidy
from experiments.words import row_table, span

if TYPE_CHECKING:
    from experiments.outcome import Row, Run

__all__ = ["FIG7", "FIG8", "FIG9"]

COLUMNS = ("i_d", "i_s", "hardness", "mean_grey", "max_grey", "clipped_percent", "black_percent", "highlight_percent")
EFFECTS = {
    "i_d": ("mean_grey", 1.0, "the ball brightens"),
    "i_s": ("highlight_percent", 1.0, "the highlight grows"),
    "hardness": ("highlight_percent", -1.0, "the highlight shrinks"),
}
"""What should change steadily with each quantity: column, direction, in words."""
HIGHLIGHT_LEVELS = 10.0
"""A pixel counts as highlight where the lobe adds more than this to the diffuse grey level."""


def run(how: Run, *, name: str, field: str, symbol: str, values: tuple[float, ...]) -> Outcome:
    """Image of the first light for each value, and its grey levels along the centre row."""
    figure = new_figure(12.5, 5.2)
    top, bottom = panels(figure, 2, len(values), sharex=True, sharey="row", height_ratios=(1.5, 1.0))
    rows: list[Row] = []
    picture = None
    for index, (value, axes, below) in enumerate(zip(values, top, bottom, strict=True)):
        setting = Setting().with_value(field, value)
        capture, truth = setting.photograph(how.radius_px)
        matte, _ = replace(setting, i_s=0.0).photograph(how.radius_px)
        image = capture.images[0]
        extent = image_extent_px(image.shape)
        picture = axes.imshow(image, cmap="gray", vmin=0, vmax=255, extent=extent, interpolation="nearest")
        axes.set_title(f"{symbol} = {value:g}")
        x_px = np.arange(image.shape[1]) + 0.5 - image.shape[1] / 2
        middle = image.shape[0] // 2
        below.plot(x_px, image[middle], color="#0072B2", linewidth=1.4, label="image")
        below.plot(x_px, matte.images[0][middle], color="#D55E00", linewidth=1.2, linestyle="--", label="diffuse part")
        below.set_xlabel("x (px)")
        below.set_ylim(-8, 275)
        tidy(below)
        ball = capture.images[:, truth.mask].astype(np.float64)
        lobe = ball - matte.images[:, truth.mask]
        rows.append(
            {
                "i_d": setting.i_d,
                "i_s": setting.i_s,
                "hardness": setting.hardness,
                "mean_grey": float(ball.mean()),
                "max_grey": float(ball.max()),
                "clipped_percent": 100.0 * float(np.mean(ball >= capture.saturation)),
                "black_percent": 100.0 * float(np.mean(ball == 0)),
                "highlight_percent": 100.0 * float(np.mean(lobe > HIGHLIGHT_LEVELS)),
            }
        )
        how.report((index + 1) / len(values))
    top[0].set_ylabel("y (px)")
    bottom[0].set_ylabel("grey level")
    bottom[0].legend(loc="upper left", handlelength=1.6)
    if picture is not None:
        figure.colorbar(picture, ax=top, label="grey level", shrink=0.9)
    clipped = span(float(row["clipped_percent"]) for row in rows)
    watched, sign, effect = EFFECTS[field]
    course = [sign * float(row[watched]) for row in rows]
    expected = all(later > earlier for earlier, later in pairwise(course))
    told = (
        f"{effect} with {symbol}: from {symbol} = {values[0]:g} to {values[-1]:g}, mean grey level "
        f"{rows[0]['mean_grey']:.0f} to {rows[-1]['mean_grey']:.0f}, highlights {rows[0]['highlight_percent']:.0f} to "
        f"{rows[-1]['highlight_percent']:.0f} % of the ball under a light"
    )
    return Outcome(
        pictures=(Picture(name, figure, f"Image of the light at azimuth 0° over {symbol}; below, its centre row."),),
        columns=COLUMNS,
        rows=rows,
        table=row_table(
            {
                symbol: f"{{{field}:g}}",
                "mean grey": "{mean_grey:.1f}",
                "largest grey": "{max_grey:.0f}",
                "clipped (%)": "{clipped_percent:.1f}",
                "grey level 0 (%)": "{black_percent:.1f}",
                "highlight (%)": "{highlight_percent:.1f}",
            },
            rows,
        ),
        about=(
            "Shares are of hemisphere pixels, over all lights; highlight: the lobe adds more than "
            f"{HIGHLIGHT_LEVELS:g} grey levels."
        ),
        agrees=(f"{told}.",) if expected else (),
        differs=(() if expected else (f"not the steady change one expects: {told}.",))
        + (f"{clipped} % of the values are clipped; to the equation I = k_d L n they are data like any other.",),
    )


FIG7, FIG8, FIG9 = (
    Experiment(
        name,
        f"Fig. {name[3:]}: images over {symbol}",
        f"images over {symbol} = {', '.join(f'{value:g}' for value in values)}",
        partial(run, name=name, field=field, symbol=symbol, values=values),
    )
    for name, field, symbol, values in (
        ("fig7", "i_d", "I_d", DIFFUSE),
        ("fig8", "i_s", "I_s", SPECULAR),
        ("fig9", "hardness", "h", HARDNESS),
    )
)
