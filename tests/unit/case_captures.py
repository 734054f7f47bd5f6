"""Small captures in the dialects that people hold, made on the spot: a smooth bump under eight lights, no shadows."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable
from pathlib import Path

import bgars
import imageio.v3 as iio
import numpy as np
import pytest

SHAPE = (20, 26)
AZIMUTHS_DEG = np.array([3.0, 47.0, 92.0, 141.0, 178.0, 226.0, 269.0, 318.0])
ELEVATIONS_DEG = np.array([52.0, 56.0, 49.0, 58.0, 47.0, 54.0, 59.0, 50.0])
LIGHTS = bgars.LightRig.from_angles(np.column_stack([AZIMUTHS_DEG, ELEVATIONS_DEG])).directions
COUNT = len(LIGHTS)


def truth() -> np.ndarray:
    """(H, W, 3) normals of the bump: no two turns or mirrors of it are alike."""
    rows, cols = np.mgrid[: SHAPE[0], : SHAPE[1]]
    x, y = (cols - 11.0) / 20.0, (8.0 - rows) / 20.0
    normals = np.stack([0.9 * x + 0.25 * y, 0.7 * y + 0.1, np.ones(SHAPE)], axis=-1)
    return normals / np.linalg.norm(normals, axis=2, keepdims=True)


def radiances() -> np.ndarray:
    """(L, H, W) in [0, 1], all lit, none clipped."""
    return 0.8 * np.einsum("lk,hwk->lhw", LIGHTS, truth())


def levels(bits: int = 8) -> np.ndarray:
    return np.rint(radiances() * (2**bits - 1)).astype(np.uint8 if bits == 8 else np.uint16)


def write_images(
    folder: Path, names: list[str] | None = None, images: np.ndarray | None = None, **options: object
) -> list[str]:
    """Write the images as PNG, or as the endings of `names` say; return the names."""
    names = [f"img_{index:02d}.png" for index in range(1, COUNT + 1)] if names is None else names
    for name, image in zip(names, levels() if images is None else images, strict=True):
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        iio.imwrite(path, image, **options)
    return names


def write_directions(folder: Path, name: str = "light_directions.txt", vectors: np.ndarray = LIGHTS) -> None:
    np.savetxt(folder / name, vectors, fmt="%.6f")


def lp_lines(names: list[str], vectors: np.ndarray = LIGHTS, join: str = " ") -> list[str]:
    return [
        join.join([name, *(f"{value:.6f}" for value in vector)]) for name, vector in zip(names, vectors, strict=True)
    ]


def names_of(pattern: str, first: int = 1) -> list[str]:
    return [pattern.format(index) for index in range(first, first + COUNT)]


def with_names(change: Callable[[str], str]) -> list[str]:
    return lp_lines([change(f"img_{index:02d}.png") for index in range(1, COUNT + 1)])


PLAIN = with_names(str)


def write_lp(
    folder: Path, lines: list[str], *, name: str = "lights.lp", count: bool = True, encoding: str = "utf-8"
) -> None:
    text = "\n".join([str(len(lines)), *lines] if count else lines) + "\n"
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(text.encode(encoding))


def recipe(folder: Path, text: str) -> None:
    (folder / "capture.toml").write_text(text, encoding="utf-8")


def read_with_notes(folder: Path) -> tuple[bgars.Capture, list[str]]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        capture = bgars.read_capture(folder)
    assert all(entry.category is bgars.CaptureWarning for entry in caught), [str(entry.message) for entry in caught]
    notes = [str(entry.message) for entry in caught]
    assert len(notes) == len(capture.assumed)
    assert not any("\n" in note for note in notes)
    return capture, notes


def reads_right(folder: Path, *words: str, within_deg: float = 0.5) -> bgars.Capture:
    """The capture gives the true normals, and says each of the words; without words it says nothing."""
    capture, notes = read_with_notes(folder)
    told = " | ".join(notes)
    if not words:
        assert not notes, told
    for word in words:
        assert word in told, told
    assert capture.images.shape == (COUNT, *SHAPE)
    field = bgars.estimate_normals(capture, method="lambertian")
    errors = bgars.angular_error_deg(field.normals, truth().astype(np.float32))
    assert np.nanmax(errors[field.mask]) < within_deg
    return capture


def refused(folder: Path, *words: str) -> None:
    """Reading raises one line that holds all words."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", bgars.CaptureWarning)
        with pytest.raises(bgars.BgarsError) as caught:
            bgars.read_capture(folder)
    message = str(caught.value)
    assert "\n" not in message
    assert len(message) < 1500
    for word in words:
        assert re.search(re.escape(word), message), message


def pfm(values: np.ndarray, order: str = "<") -> bytes:
    """A PFM file of grey or RGB values."""
    rows, columns = values.shape[:2]
    head = f"{'Pf' if values.ndim == 2 else 'PF'}\n{columns} {rows}\n{'-1.0' if order == '<' else '1.0'}\n"
    return head.encode() + values[::-1].astype(f"{order}f4").tobytes()
