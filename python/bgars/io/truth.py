"""Known normals and heights that come with a capture."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bgars.errors import FileFormatError
from bgars.io.masks import read_mask
from bgars.records import Truth

if TYPE_CHECKING:
    from os import PathLike

__all__ = ["Truth", "read_truth"]

SCENE_TRUTH = "gt.npz"
NORMAL_TRUTH = "Normal_gt.npy"


def read_truth(folder: str | PathLike[str]) -> Truth:
    """Read the truth of a rendered scene (``gt.npz``) or of a DiLiGenT object (``Normal_gt.npy``).

    A subfolder with other exposures of the same scene (``16bit/``) uses the truth of its parent.

    Raises
    ------
    FileFormatError
        There is no truth, or it cannot be read.

    Examples
    --------
    >>> import bgars
    >>> bgars.read_truth(bgars.sample_capture()).normals.shape
    (240, 256, 3)
    """
    folder = Path(folder)
    for place in (folder, folder.resolve().parent):
        if (place / SCENE_TRUTH).is_file():
            return _read_scene(place / SCENE_TRUTH)
        if (place / NORMAL_TRUTH).is_file():
            return _read_photograph(place)
    msg = f"{folder}: has no truth to compare with: expected {SCENE_TRUTH} or {NORMAL_TRUTH}"
    raise FileFormatError(msg)


def _read_scene(path: Path) -> Truth:
    try:
        with np.load(path, allow_pickle=False) as arrays:
            normals, ids = arrays["normals"].astype(np.float32), arrays["id"].astype(np.int16)
            height_um = (arrays["z"].astype(np.float64) * 1000.0).astype(np.float32)
    except (OSError, ValueError, KeyError, EOFError) as error:
        msg = f"{path}: is not a scene truth with normals, id and z ({error})"
        raise FileFormatError(msg) from error
    return Truth(normals, ids, ids >= 1, height_um)


def _read_photograph(folder: Path) -> Truth:
    path = folder / NORMAL_TRUTH
    try:
        normals = np.load(path, allow_pickle=False).astype(np.float32)
    except (OSError, ValueError, EOFError) as error:
        msg = f"{path}: is not an array of normals ({error})"
        raise FileFormatError(msg) from error
    length = np.linalg.norm(normals, axis=2)
    known = np.isfinite(length) & (length > 0.5)  # noqa: PLR2004 - zero vectors mark the background
    mask_path = folder / "mask.png"
    if mask_path.exists():
        known &= read_mask(mask_path, known.shape)
    unit = np.where(known[..., None], normals / np.maximum(length, 1e-6)[..., None], np.nan).astype(np.float32)
    return Truth(unit, None, known, None)
