"""Iterations of the least-squares integrator to a relative residual of 1e-6, by kind of mask.

python benches/mask_iterations.py                       prints the table of docs/method.md; BGARS_DATA adds to it
python benches/mask_iterations.py --save FILE.json      keeps the counts of this build for a later table
"""

from __future__ import annotations

import argparse
import json
import os
from pathlib import Path
from typing import TYPE_CHECKING

import bgars
import imageio.v3 as iio
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    Mask = NDArray[np.bool_]

SIDE_PX = 512
TOLERANCE = 1e-6
EARLIER = Path(__file__).with_suffix(".json")
"""Counts of the hierarchy before: grids that kept every other pixel, an algebraic graph where they failed."""
LANES_PX = (1, 4, 16)
MIN_N_Z = 0.3


def wavy_normals(shape: tuple[int, int]) -> NDArray[np.float32]:
    """Noisy normals of a wavy surface, so that every frequency has to be solved for."""
    random = np.random.default_rng(4)
    row, col = np.indices(shape) * 20.0 / np.array(shape)[:, None, None]
    slope_x = 0.6 * np.sin(col) * np.cos(row) + 0.1 * (random.random(shape) - 0.5)
    slope_y = 0.6 * np.cos(row + col) + 0.1 * (random.random(shape) - 0.5)
    normals = np.stack([-slope_x, -slope_y, np.ones(shape)], axis=-1)
    return (normals / np.linalg.norm(normals, axis=-1, keepdims=True)).astype(np.float32)


def disc_with_holes(side: int) -> Mask:
    """A disc with round holes, twelve across."""
    row, col = np.indices((side, side))
    pitch, middle = side / 12, (side - 1) / 2
    hole = np.hypot(row % pitch - pitch / 2, col % pitch - pitch / 2) < 0.2 * pitch
    return (np.hypot(row - middle, col - middle) < 0.48 * side) & ~hole


def serpentine(side: int, lane: int) -> Mask:
    """One winding lane, walls of one pixel open at the top and bottom by turns."""
    row, col = np.indices((side, side))
    from_gap = np.where(col // (lane + 1) % 2 == 0, side - 1 - row, row)
    return (col % (lane + 1) != lane) | (from_gap < lane)


def spiral(side: int, lane: int) -> Mask:
    """A lane that winds inward, walls of one pixel."""
    mask = np.ones((side, side), dtype=np.bool_)
    pitch = lane + 1
    for turn in range(side // (2 * pitch)):
        low, high = turn * pitch + lane, side - 1 - turn * pitch - lane
        if high - low < pitch:
            break
        mask[low, low : high + 1] = mask[high, low : high + 1] = mask[low : high + 1, high] = False
        mask[low : high + 1, low] = False
        # The gap through the wall, and beside it the barrier that makes a spiral of rings.
        middle = side // 2
        mask[low, middle : middle + lane] = True
        mask[low + 1 : low + pitch, middle - 1] = False
    return mask


def maze(side: int, lane: int) -> Mask:
    """A random spanning tree of square cells."""
    random, pitch = np.random.default_rng(lane), lane + 1
    cells = side // pitch
    row, col = np.indices((side, side))
    mask = (row % pitch != lane) & (col % pitch != lane) & (row < cells * pitch) & (col < cells * pitch)
    seen, path = {(0, 0)}, [(0, 0)]
    while path:
        here = path[-1]
        for turn in random.permutation(4):
            step = ((0, 1), (1, 0), (0, -1), (-1, 0))[turn]
            there = (here[0] + step[0], here[1] + step[1])
            if min(there) >= 0 and max(there) < cells and there not in seen:
                first, second = min(here, there), max(here, there)
                top, left = first[0] * pitch, first[1] * pitch
                mask[top : second[0] * pitch + lane, left : second[1] * pitch + lane] = True
                seen.add(there)
                path.append(there)
                break
        else:
            path.pop()
    return mask


def islands(side: int, island: int) -> Mask:
    """Squares apart by one pixel, every third one tied to its right neighbour."""
    row, col = np.indices((side, side))
    pitch = island + 1
    bridge = (row % pitch == island // 2) & ((col // pitch + row // pitch) % 3 == 0)
    return (row % pitch != island) & ((col % pitch != island) | bridge)


def silhouettes(side: int) -> Mask:
    """Walls of a pixel or two around balls on a grid."""
    row, col = np.indices((side, side))
    distance = np.hypot(row % 100 - 50, col % 100 - 50)
    return (distance < 29.3) | (distance > 30.7)


def read_mask(path: Path) -> Mask:
    """A mask of the data folder."""
    levels = np.asarray(iio.imread(path))
    return (levels[..., 0] if levels.ndim > 2 else levels) > 0


def masks() -> Iterator[tuple[str, Mask]]:
    """Every kind, with its name."""
    yield "rectangle", np.ones((SIDE_PX, SIDE_PX), dtype=np.bool_)
    yield "disc with holes", disc_with_holes(SIDE_PX)
    if folder := os.environ.get("BGARS_DATA"):
        for scene in ("C_grid_4x4_paper", "G_grid_10x10_large", "H_bridge"):
            truth = bgars.read_truth(Path(folder) / "scenes" / scene)
            yield f"scene {scene}, n_z > {MIN_N_Z}", truth.normals[..., 2] > MIN_N_Z
        for name in ("bear", "cat"):
            yield f"DiLiGenT {name}", read_mask(Path(folder) / "normal_maps" / "diligent" / name / "mask.png")
    yield "walls along silhouettes", silhouettes(SIDE_PX)
    random = np.random.default_rng(7)
    for percent in (1, 5, 10, 20, 35):
        yield f"{percent} % of the pixels missing at random", random.random((SIDE_PX, SIDE_PX)) >= percent / 100
    yield "islands of 6 pixels, some tied", islands(SIDE_PX, 6)
    for lane in LANES_PX:
        for make in (serpentine, spiral, maze):
            yield f"{make.__name__}, lanes of {lane} px", make(SIDE_PX, lane)


def main() -> None:
    """Count, then print or save."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--save", type=Path, help="write the counts there instead")
    save = parser.parse_args().save
    counts = {}
    for name, mask in masks():
        found = bgars.integrate_normals(wavy_normals(mask.shape), mask=mask, relative_tolerance=TOLERANCE)
        counts[name] = found.iterations
    if save:
        save.write_text(json.dumps(counts, indent=1) + "\n", encoding="utf-8")
        return
    before = json.loads(EARLIER.read_text(encoding="utf-8")) if EARLIER.exists() else {}
    print("| mask | grids and graph, before | connected parts of blocks |\n| --- | --- | --- |")
    for name, count in counts.items():
        print(f"| {name} | {before.get(name, '')} | {count} |")


if __name__ == "__main__":
    main()
