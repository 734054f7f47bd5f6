"""What is wanted of the calibration of stations, and cells of tables that say where it is not reached."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
TWO = 2.0
WITHIN_U, WITHIN_2U = 68.0, 95.0
"""Per cent of errors that a standard uncertainty, and twice one, holds if it is what it says."""
ERROR_DEG, NEAR_SHARE, DOME_PX, OF_EXACT = 0.1, 1.0, 3.0, 1.5
"""What the tests of the station want, too: mean error of a ball's lights, median of near lamps (%), dome of a flat
board, errors of a calibrated station against those of exact knowledge."""


def marked(text: str, *, reached: bool) -> str:
    """A cell, bold where it falls short."""
    return text if reached else f"**{text}**"


def covered(z: Array) -> str:
    """Two cells: per cent of errors within u and within 2 u."""
    cells = [(100 * float(np.mean(np.abs(z) < times)), least) for times, least in ((1.0, WITHIN_U), (TWO, WITHIN_2U))]
    return " | ".join(marked(f"{share:.0f} %", reached=round(share) >= least) for share, least in cells)
