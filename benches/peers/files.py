"""Eight files to normals: reading and computing by bgars against a peer's reading alone.

python benches/peers/files.py png 4000 5000        also: tiff
"""

from __future__ import annotations

import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING

import bgars
import numpy as np
from light_stack import make_stack
from process import own_threads
from rows import emit_ratio, has
from timing import alternate

if TYPE_CHECKING:
    from collections.abc import Callable

GROUP = "read"
METHODS = ("specular-filter", "robust-filter")
"""The limit is set against the published filter; the default, robust one does more."""
THREADS_OF_LIMIT = 2


def bgars_call(folder: Path, method: bgars.normals.Method) -> Callable[[], object]:
    """From a folder to normals, as a user writes it."""
    return lambda: bgars.estimate_normals(bgars.read_capture(folder), method=method)


def write_lights(folder: Path, directions: np.ndarray) -> None:
    """What read_capture needs beside the images."""
    np.savetxt(folder / "light_directions.txt", directions)


def emit_rows(folder: Path, size: str, what: str, peer: str, read: Callable[[], object], limit: float | None) -> None:
    """Both methods against one reader."""
    for method in METHODS:
        applied = limit if method == METHODS[0] else None
        timed = alternate(bgars_call(folder, method), read)
        emit_ratio(GROUP, f"{what} -> normals, {method}", size, own_threads(), peer, timed, "at most", applied)


def from_png(rows: int, cols: int) -> None:
    """PNG as OpenCV writes it, decoded by OpenCV in a pool of as many threads."""
    if not has(GROUP, "cv2 PNG decode", "cv2"):
        return
    import cv2  # noqa: PLC0415 - an optional install

    threads, stack = own_threads(), make_stack(rows, cols)
    cv2.setNumThreads(1)
    with tempfile.TemporaryDirectory() as name, ThreadPoolExecutor(threads) as pool:
        folder = Path(name)
        write_lights(folder, stack.directions)
        paths = [str(folder / f"light_{light}.png") for light in range(len(stack.images))]
        for path, image in zip(paths, stack.images, strict=True):
            cv2.imwrite(path, image)
        decode = lambda: list(pool.map(lambda path: cv2.imread(path, cv2.IMREAD_UNCHANGED), paths))  # noqa: E731
        limit = 1.1 if threads == THREADS_OF_LIMIT else None
        size = f"{len(paths)} x {rows * cols / 1e6:.3g} MP"
        emit_rows(folder, size, "PNG", f"cv2.imread alone, pool of {threads}", decode, limit)


def from_tiff(rows: int, cols: int) -> None:
    """Uncompressed TIFF, read by tifffile one after the other, and in a pool."""
    if not has(GROUP, "tifffile read", "tifffile"):
        return
    import tifffile  # noqa: PLC0415 - an optional install

    threads, stack = own_threads(), make_stack(rows, cols)
    with tempfile.TemporaryDirectory() as name, ThreadPoolExecutor(threads) as pool:
        folder = Path(name)
        write_lights(folder, stack.directions)
        paths = [folder / f"light_{light}.tif" for light in range(len(stack.images))]
        for path, image in zip(paths, stack.images, strict=True):
            tifffile.imwrite(path, image)
        size = f"{len(paths)} x {rows * cols / 1e6:.3g} MP"
        one_by_one = lambda: [tifffile.imread(path) for path in paths]  # noqa: E731
        emit_rows(folder, size, "TIFF", "tifffile.imread alone", one_by_one, limit=3.0)
        if threads > 1:
            pooled = lambda: list(pool.map(tifffile.imread, paths))  # noqa: E731
            emit_rows(folder, size, "TIFF", f"tifffile.imread alone, pool of {threads}", pooled, limit=None)


if __name__ == "__main__":
    {"png": from_png, "tiff": from_tiff}[sys.argv[1]](int(sys.argv[2]), int(sys.argv[3]))
