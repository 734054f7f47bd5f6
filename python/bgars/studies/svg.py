"""A figure as a picture within a page: sharp on any screen and on paper, and the same bytes each time."""

from __future__ import annotations

import base64
import io
from typing import TYPE_CHECKING

from matplotlib import rc_context

from bgars.report.figures.style import figure_style

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure

__all__ = ["PLACEMENT_COLORS", "data_uri"]

PLACEMENT_COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Okabe and Ito, Color universal design, 2008; they come again after seven."""


def data_uri(draw: Callable[[], Figure]) -> str:
    """Return the figure that `draw` makes as a ``data:`` address of an SVG."""
    with figure_style(), rc_context({"svg.hashsalt": "bgars", "svg.fonttype": "path"}):
        text = io.BytesIO()
        draw().savefig(text, format="svg", metadata={"Date": None, "Creator": None})
    return "data:image/svg+xml;base64," + base64.b64encode(text.getvalue()).decode("ascii")
