"""What an orthographic camera sees from above: height, normal and label of each sample."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bgars.simulate.solids import Array, Points, Solid, solids_of

if TYPE_CHECKING:
    from bgars.simulate.board import Board
    from bgars.simulate.scene import Scene

__all__ = ["Patch", "World", "window"]


class Patch(NamedTuple):
    """The visible surface on the grid of `x_um` (C,) and `y_um` (R,); y falls from row to row.

    `owner` (R, C) int32 is the index into the world's solids, -1 = board.
    """

    x_um: Array
    y_um: Array
    z_um: Array
    normal: Points
    owner: NDArray[np.int32]


@dataclass(frozen=True)
class World:
    """A scene made ready: solids in world coordinates."""

    board: Board
    solids: list[Solid]
    labels: NDArray[np.int32]

    @classmethod
    def of(cls, scene: Scene) -> World:
        """Place everything."""
        solids = solids_of(scene)
        return cls(scene.board, solids, np.array([*(solid.label for solid in solids), 0], dtype=np.int32))

    def look(self, x_um: Array, y_um: Array) -> Patch:
        """See the grid from above: the highest surface wins."""
        across, up = x_um[None, :], y_um[:, None]
        shape = (len(y_um), len(x_um))
        z_um = np.broadcast_to(self.board.height_um(across, up), shape).copy()
        normal = Points(*(np.broadcast_to(part, shape).copy() for part in self.board.normal(across, up)))
        owner = np.full(shape, -1, dtype=np.int32)
        for index, solid in enumerate(self.solids):
            box = solid.bounds
            rows, cols = window(x_um, y_um, box.x0, box.x1, box.y0, box.y1)
            if rows.start >= rows.stop or cols.start >= cols.stop:
                continue
            top = solid.top_um(x_um[None, cols], y_um[rows, None])
            seen = top > z_um[rows, cols]
            at_row, at_col = np.nonzero(seen)
            at = Points(x_um[cols][at_col], y_um[rows][at_row], top[seen])
            z_um[rows, cols][seen] = at.z
            owner[rows, cols][seen] = index
            for whole, part in zip(normal, solid.normal(at), strict=True):
                whole[rows, cols][seen] = part
        return Patch(x_um, y_um, z_um, normal, owner)


def window(x_um: Array, y_um: Array, x0: float, x1: float, y0: float, y1: float) -> tuple[slice, slice]:
    """Rows and columns of the grid inside a box; x grows, y falls."""
    down_um = -y_um
    rows = slice(int(down_um.searchsorted(-y1)), int(down_um.searchsorted(-y0, side="right")))
    return rows, slice(int(x_um.searchsorted(x0)), int(x_um.searchsorted(x1, side="right")))
