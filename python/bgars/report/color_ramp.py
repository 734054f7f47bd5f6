"""Colour maps by a few of their colours, for pictures that are drawn without matplotlib."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["cividis", "hex_of", "rgb_of", "viridis"]

VIRIDIS = (
    "#440154 #48186a #472d7b #424086 #3b528b #33638d #2c728e #26828e #21918c #1fa088 #28ae80 #3fbc73 #5ec962 #84d44b "
    "#addc30 #d8e219 #fde725"
)
CIVIDIS = "#00224e #1a386f #434e6c #61656f #7d7c78 #9b9476 #bcae6c #dec958 #fee838"


def rgb_of(color: str) -> tuple[float, float, float]:
    """Red, green, blue from 0 to 1 of ``#rrggbb``."""
    red, green, blue = (int(color[at : at + 2], 16) / 255.0 for at in (1, 3, 5))
    return red, green, blue


def hex_of(rgb: NDArray[np.float64]) -> str:
    """``#rrggbb`` of red, green, blue from 0 to 1."""
    return "#" + "".join(f"{round(255 * float(part)):02x}" for part in rgb)


def viridis(levels: ArrayLike) -> NDArray[np.float64]:
    """(..., 3) colours of levels from 0 to 1; beyond them the ends.

    Examples
    --------
    >>> hex_of(viridis(0.5))
    '#21918c'
    """
    return _between(VIRIDIS, levels)


def cividis(levels: ArrayLike) -> NDArray[np.float64]:
    """(..., 3) colours of levels from 0 to 1; beyond them the ends."""
    return _between(CIVIDIS, levels)


def _between(stops: str, levels: ArrayLike) -> NDArray[np.float64]:
    known = np.array([rgb_of(stop) for stop in stops.split()])
    at = np.linspace(0.0, 1.0, len(known))
    wanted = np.asarray(levels, dtype=np.float64)
    return np.stack([np.interp(wanted, at, known[:, channel]) for channel in range(3)], axis=-1)
