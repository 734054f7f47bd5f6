"""Known normals and heights that come with a capture."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bgars.errors import FileFormatError
from bgars.files.mat_files import read_arrays
from bgars.files.safe_files import read_bounded, read_text
from bgars.io.given_paths import need_folder
from bgars.io.images import decode_stack
from bgars.io.masks import read_mask
from bgars.records.truth import Truth

if TYPE_CHECKING:
    from os import PathLike

    from bgars.records.pixels import FloatArray

__all__ = ["Truth", "read_truth"]

SCENE_TRUTH = "gt.npz"
NORMAL_TRUTH = ("Normal_gt.npy", "Normal_gt.mat", "normal.txt")
"""Normals of a photographed object: as an array, and as the DiLiGenT benchmark ships them."""
MAX_BYTES = 2_000_000_000
MAX_TEXT_BYTES = 100_000_000
AXES = 3


def read_truth(folder: str | PathLike[str]) -> Truth:
    """Read the truth of a rendered scene (``gt.npz``) or of an object of DiLiGenT.

    Its normals are ``Normal_gt.npy``, or ``Normal_gt.mat`` or ``normal.txt`` as the benchmark ships them. A subfolder
    with other exposures of the same scene (``16bit/``) uses the truth of its parent.

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
    folder = need_folder(folder)
    for place in (folder, folder.resolve().parent):
        if (place / SCENE_TRUTH).is_file():
            return _read_scene(place / SCENE_TRUTH)
        for name in NORMAL_TRUTH:
            if (place / name).is_file():
                return _read_photograph(place / name)
    msg = f"{folder}: has no truth to compare with: expected {SCENE_TRUTH} or {' or '.join(NORMAL_TRUTH)}"
    raise FileFormatError(msg)


def _read_scene(path: Path) -> Truth:
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
            normals, ids = arrays["normals"].astype(np.float32), arrays["id"].astype(np.int16)
            height_um = (arrays["z"].astype(np.float64) * 1000.0).astype(np.float32)
    except Exception as error:  # damaged archives raise whatever zipfile and zlib do
        msg = f"{path}: is not a scene truth with normals, id and z ({type(error).__name__}: {error})"
        raise FileFormatError(msg) from error
    return Truth(normals, ids, ids >= 1, height_um)


def _read_photograph(path: Path) -> Truth:
    mask_path = path.with_name("mask.png")
    try:
        normals = _normals(path, mask_path)
    except FileFormatError:
        raise
    except Exception as error:  # damaged files raise whatever numpy and scipy do
        msg = f"{path}: is not an array of normals ({type(error).__name__}: {' '.join(str(error).split())[:120]})"
        raise FileFormatError(msg) from error
    if normals.ndim != 3 or normals.shape[2] != AXES:  # noqa: PLR2004 - rows, columns, axes
        msg = f"{path}: must hold normals of shape (H, W, 3), got {normals.shape}"
        raise FileFormatError(msg)
    length = np.linalg.norm(normals, axis=2)
    known = np.isfinite(length) & (length > 0.5)  # noqa: PLR2004 - zero vectors mark the background
    if mask_path.exists():
        known &= read_mask(mask_path, known.shape)
    unit = np.where(known[..., None], normals / np.maximum(length, 1e-6)[..., None], np.nan).astype(np.float32)
    return Truth(unit, None, known, None)


def _normals(path: Path, mask_path: Path) -> FloatArray:
    """Normals (H, W, 3) of a file; lines of text are pixels in reading order, and the mask tells their size."""
    if path.suffix == ".npy":
        array: FloatArray = np.load(path, allow_pickle=False).astype(np.float32)
        return array
    if path.suffix == ".mat":
        arrays = read_arrays(read_bounded(path, MAX_BYTES), MAX_BYTES)
        held = [value for value in arrays.values() if value.shape[2:] == (AXES,)]
        if len(held) != 1:
            msg = f"{path}: must hold one variable of shape (H, W, 3), has {len(held)}"
            raise FileFormatError(msg)
        return np.ascontiguousarray(held[0], dtype=np.float32)
    rows = np.array(read_text(path, MAX_TEXT_BYTES).content.split(), dtype=np.float32).reshape(-1, AXES)
    shape = decode_stack([mask_path]).images.shape[1:] if mask_path.is_file() else None
    if shape is None or len(rows) != shape[0] * shape[1]:
        size = "no mask.png tells their size" if shape is None else f"mask.png is {shape[1]} x {shape[0]} pixels"
        msg = f"{path}: holds {len(rows)} normals, one per pixel in reading order is expected, but {size}"
        raise FileFormatError(msg)
    return rows.reshape(*shape, AXES)
