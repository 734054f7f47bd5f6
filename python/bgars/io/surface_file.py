"""surface.npz: the height map of a part's page, beside its result."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import numpy as np

from bgars.errors import FileFormatError
from bgars.io.guarded import load_npz
from bgars.records.part_surface import PartSurface

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

__all__ = ["SURFACE_FILE", "read_surface", "surface_bytes"]

SURFACE_FILE = "surface.npz"
MOST_SAMPLES = 64_000_000
ABOUT = "what `bgars inspect` writes beside its result; remove it to do without"
ARRAYS = {"ball_height_um": np.float32, "ball_measured": np.bool_, "board_height_um": np.float32}


def surface_bytes(surface: PartSurface) -> bytes:
    """Return the file: numpy's npz with the fields of :class:`bgars.PartSurface`, compressed."""
    content = io.BytesIO()
    np.savez_compressed(content, **{name: np.asarray(value) for name, value in vars(surface).items()})  # type: ignore[arg-type]
    return content.getvalue()


def read_surface(path: Path) -> PartSurface:
    """Read a file that :func:`surface_bytes` made.

    Raises
    ------
    FileFormatError
        It cannot be read, or is not such a file.
    """
    values = load_npz(path, ABOUT)
    try:
        maps = {name: _array(values[name], name, kind) for name, kind in ARRAYS.items()}
        rows, cols = (int(size) for size in values["shape_px"])
        surface = PartSurface(
            shape_px=(rows, cols),
            pixel_pitch_um=float(values["pixel_pitch_um"]),
            ball_step_px=int(values["ball_step_px"]),
            board_step_px=int(values["board_step_px"]),
            ball_height_um=maps["ball_height_um"],
            ball_measured=maps["ball_measured"],
            board_height_um=maps["board_height_um"],
        )
        _check(surface)
    except (ValueError, KeyError, TypeError, OverflowError) as error:
        msg = f"{path}: is not {ABOUT} ({error!r})"
        raise FileFormatError(msg) from error
    return surface


def _array(values: NDArray[Any], name: str, kind: type) -> NDArray[Any]:
    if values.dtype != kind or values.ndim != len(("row", "col")) or not 0 < values.size <= MOST_SAMPLES:
        msg = f"{name}: must be a map of {kind.__name__}, got {values.dtype} of shape {values.shape}"
        raise ValueError(msg)
    return values


def _check(surface: PartSurface) -> None:
    """Raise ValueError unless every map covers the image at its step."""
    maps = (("ball", surface.ball_height_um), ("ball", surface.ball_measured), ("board", surface.board_height_um))
    for name, values in maps:
        step = getattr(surface, f"{name}_step_px")
        if step < 1 or values.shape != tuple(-(-size // step) for size in surface.shape_px):
            msg = f"{name}_step_px: {step} does not fit maps of {values.shape} over {surface.shape_px} pixels"
            raise ValueError(msg)
    if not surface.pixel_pitch_um > 0:
        msg = f"pixel_pitch_um: must be above 0, got {surface.pixel_pitch_um}"
        raise ValueError(msg)
