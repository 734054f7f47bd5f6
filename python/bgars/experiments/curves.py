"""Errors of every method over one quantity, as curves."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from matplotlib.ticker import FixedLocator, NullLocator

from bgars.experiments.style import method_style, panels, tidy
from bgars.experiments.words import of_method

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from bgars.experiments.measure import Measurement

__all__ = ["draw_errors"]


def draw_errors(
    figure: Any,  # noqa: ANN401 - a figure or a part of one
    measurements: Sequence[Measurement],
    value: Callable[[Measurement], float],
    label: str,
    *,
    log: bool = False,
) -> None:
    """Draw the mean angular error (left) and the height RMSE (right) of every method.

    Parameters
    ----------
    figure : Figure or SubFigure
        To draw into.
    measurements : sequence of Measurement
        All methods at all values.
    value : callable
        What the horizontal axis shows.
    label : str
        Its label.
    log : bool
        Whether it is logarithmic.
    """
    (line,) = panels(figure, 1, 2, sharex=True)
    for axes, name, title in (
        (line[0], "mean_deg_nz03", "mean angular error,\nn_z > 0.3 (deg)"),
        (line[1], "height_rmse_px", "height RMSE (px)"),
    ):
        for method in dict.fromkeys(one.method for one in measurements):
            own = of_method(measurements, method)
            axes.plot([value(one) for one in own], [getattr(one, name) for one in own], **method_style(method))
        if log:
            axes.set_xscale("log")
            ticks = sorted({value(one) for one in measurements})
            axes.xaxis.set_major_locator(FixedLocator(ticks))
            axes.xaxis.set_minor_locator(NullLocator())
            axes.xaxis.set_major_formatter("{x:g}")
        axes.set_ylim(bottom=0.0)
        axes.set_xlabel(label)
        axes.set_ylabel(title)
        tidy(axes)
    figure.legend(*line[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
