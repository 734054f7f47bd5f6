"""A capture that ships with the package: one shiny solder ball, eight lights, rendered, with its true normals."""

from __future__ import annotations

from pathlib import Path

__all__ = ["sample_capture"]


def sample_capture() -> Path:
    """Return the folder of the sample capture.

    One solder ball of 600 um diameter on its board, strong highlights, 8 lights at 45 degrees, 3.4 um a pixel;
    rendered by a physically based renderer, with its truth in ``gt.npz``.

    Examples
    --------
    >>> (sample_capture() / "capture.toml").exists()
    True
    """
    return Path(__file__).parent / "one_ball"
