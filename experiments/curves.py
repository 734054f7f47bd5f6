"""Errors of every method over one quantity, as curves."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from matplotlib.ticker import FixedLocator, NullLocator

from experiments.style import method_style, panels, tidy
from experiments.words import of_method

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from experiments.measure import Measurement

__all__ = ["draw_errors", "marks_in_words"]

NEARLY_ALL_PERCENT = 95.0
"""Below this share of measured pixels a mark is drawn open."""


def draw_errors(
    figure: Any,  # noqa: ANN401 - a figure or a part of one
    measurements: Sequence[Measurement],
    value: Callable[[Measurement], float],
    label: str,
    *,
    log: bool = False,
) -> None:
    """Draw the mean angular error (left) and the height RMSE (right) of every method, on logarithmic axes.

    An open mark: a good part of the normals is not measured but drawn to the sphere of the ball's circle.

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
            style = method_style(method)
            axes.plot([value(one) for one in own], [getattr(one, name) for one in own], **style)
            partly = [one for one in own if one.measured_percent_nz03 < NEARLY_ALL_PERCENT]
            marks = style | {"linestyle": "none", "markerfacecolor": "white", "label": "_open"}
            axes.plot([value(one) for one in partly], [getattr(one, name) for one in partly], **marks)
        if log:
            axes.set_xscale("log")
            ticks = sorted({value(one) for one in measurements})
            axes.xaxis.set_major_locator(FixedLocator(ticks))
            axes.xaxis.set_minor_locator(NullLocator())
            axes.xaxis.set_major_formatter("{x:g}")
        # A hundredfold lies between the methods.
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter("{x:g}")
        axes.set_xlabel(label)
        axes.set_ylabel(title)
        tidy(axes)
    figure.legend(*line[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)


def marks_in_words(measurements: Sequence[Measurement]) -> str:
    """What an open mark means, where there is one; to be put behind a caption."""
    if all(one.measured_percent_nz03 >= NEARLY_ALL_PERCENT for one in measurements):
        return ""
    return (
        f" Open marks: less than {NEARLY_ALL_PERCENT:g} % of the pixels are measured, the others have no solution or "
        "are drawn to the sphere of the ball's circle."
    )
