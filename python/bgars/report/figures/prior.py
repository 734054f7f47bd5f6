"""What is prior and what is measured, made visible: stripes where a pixel's own light does not fix its normal."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bgars.records.circle_pixels import inside_circles

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from bgars.records.normal_field import NormalField

__all__ = [
    "STRIPE_COLOR",
    "prior_label",
    "prior_legend",
    "prior_overlay",
    "prior_pixels",
    "prior_share",
    "show_prior",
    "stripes",
]

STRIPE_COLOR = (0.08, 0.08, 0.08)
STRIPE_ALPHA = 0.75
OVERLAY_PX = 1200
"""Size that a small image is enlarged to, so that stripes are finer than its pixels."""
STRIPES = 75
"""Along the longer side of the image."""
SMALL_SHARE = 0.001


def prior_pixels(field: NormalField) -> NDArray[np.bool_]:
    """(H, W) True where a normal is valid but not measured."""
    return field.mask & ~field.is_measured


def prior_label(field: NormalField) -> str:
    """Where the normals of these pixels come from."""
    fit = field.reflectance
    if fit is not None and fit.accepted:
        return (
            "drawn to the sphere of its circle (prior)" if fit.circles_px else "fixed by its light to over 2° (prior)"
        )
    return "left to its neighbours (prior)"


def stripes(prior: NDArray[np.bool_], count: float = STRIPES) -> NDArray[np.float64]:
    """Opacity of diagonal stripes over pixels, `count` of them along the longer side of the image."""
    row, col = np.arange(prior.shape[0])[:, None], np.arange(prior.shape[1])
    wave = np.cos(2.0 * np.pi * count / max(prior.shape) * (row + col))
    opacity: NDArray[np.float64] = STRIPE_ALPHA * np.where(prior, np.clip(0.5 + 1.5 * wave, 0.0, 1.0), 0.0)
    return opacity


def prior_overlay(field: NormalField) -> NDArray[np.uint8] | None:
    """Stripes over all that is a prior, as an image with transparency; None where nothing is."""
    prior = prior_pixels(field)
    if not prior.any():
        return None
    step = max(1, -(-max(prior.shape) // OVERLAY_PX))
    enlarge = max(1, OVERLAY_PX // max(prior.shape))
    shown = prior[::step, ::step].repeat(enlarge, axis=0).repeat(enlarge, axis=1)
    overlay = np.zeros((*shown.shape, 4), np.uint8)
    overlay[..., :3] = np.rint(255.0 * np.array(STRIPE_COLOR))
    overlay[..., 3] = np.rint(255.0 * stripes(shown))
    return overlay


def show_prior(
    axes: Axes, overlay: NDArray[np.uint8] | None, extent: tuple[float, float, float, float], *, legend: str = ""
) -> None:
    """Lay what :func:`prior_overlay` returns over a picture, and say below it what it is; nothing where it is None."""
    if overlay is None:
        return
    axes.imshow(overlay, extent=extent, interpolation="antialiased")
    if legend:
        from matplotlib.patches import Patch  # noqa: PLC0415 - what is shown is also made where nothing is drawn

        patch = Patch(facecolor="white", edgecolor=STRIPE_COLOR, hatch="//////", linewidth=0.8)
        axes.legend([patch], [legend], loc="upper center", bbox_to_anchor=(0.5, -0.13), frameon=False, fontsize=9)


def prior_legend(field: NormalField) -> str:
    """Where the prior normals come from, and how many they are."""
    return f"{prior_label(field)}: {prior_share(field)}"


def prior_share(field: NormalField) -> str:
    """How many of the normals on balls, or of all where there are none, are a prior."""
    prior = prior_pixels(field)
    fit = field.reflectance
    where, name = field.mask, "normals"
    if fit is not None and fit.accepted and fit.circles_px:
        where, name = field.mask & inside_circles(fit.circles_px, field.mask.shape), "normals on balls"
    share = (prior & where).sum() / max(int(where.sum()), 1)
    return f"{100 * share:.1f} % of the {name}" if share >= SMALL_SHARE else f"under 0.1 % of the {name}"
