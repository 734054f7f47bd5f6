"""Samples that ship with the package: a capture of one solder ball with its true normals, and a part recipe."""

from __future__ import annotations

from pathlib import Path

__all__ = ["sample_capture", "sample_part_recipe"]


def sample_capture() -> Path:
    """Return the folder of the sample capture.

    One solder ball of 600 um diameter on its board, strong highlights, 8 lights at 45 degrees, 3.4 um per pixel;
    rendered by a physically based renderer, with its truth in ``gt.npz``.

    Examples
    --------
    >>> (sample_capture() / "capture.toml").exists()
    True
    """
    return Path(__file__).parent / "one_ball"


def sample_part_recipe() -> Path:
    """Return the part recipe of the simulated part ``defects-5x5``: layout, nominal sizes, every kind of limit.

    Examples
    --------
    >>> sample_part_recipe().name
    'defects-5x5.part.toml'
    """
    return Path(__file__).parent / "defects-5x5.part.toml"
