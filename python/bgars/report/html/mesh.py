"""Meshes and grids as plotly's traces, their arrays packed."""

from __future__ import annotations

from base64 import b64decode, b64encode
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["LIGHTING", "grid_trace", "mesh_trace", "packed", "repeated", "unpacked"]

LIGHTING = {"ambient": 0.55, "diffuse": 0.65, "specular": 0.25, "roughness": 0.5}


def packed(values: NDArray[Any]) -> dict[str, str]:
    """An array as plotly's typed array: a third of the size of its digits.

    Examples
    --------
    >>> packed(np.array([0, 1, 65535]))
    {'dtype': 'u2', 'bdata': 'AAABAP//'}
    """
    if values.dtype.kind == "f":
        kind = "f4"  # a damaged result may hold what single precision cannot
        values = np.clip(values, np.finfo(np.float32).min, np.finfo(np.float32).max)
    else:
        kind = "u2" if values.size == 0 or values.max() <= np.iinfo(np.uint16).max else "u4"
    shape = {} if values.ndim == 1 else {"shape": ", ".join(map(str, values.shape))}
    return {"dtype": kind, "bdata": b64encode(values.astype(f"<{kind}").tobytes()).decode("ascii"), **shape}


def unpacked(array: dict[str, str]) -> NDArray[Any]:
    """The array that :func:`packed` packed."""
    values = np.frombuffer(b64decode(array["bdata"]), dtype=f"<{array['dtype']}")
    return values.reshape([int(size) for size in array["shape"].split(",")]) if "shape" in array else values


def grid_trace(x: Array, y: Array, z: Array, color: str, **options: Any) -> dict[str, Any]:  # noqa: ANN401
    """Heights over a grid, x (w,) and y (h,), z (h, w); NaN leaves a hole."""
    return {
        "type": "surface",
        "x": packed(x),
        "y": packed(y),
        "z": packed(z),
        "colorscale": [[0, color], [1, color]],
        "showscale": False,
        "showlegend": True,
        "hoverinfo": "skip",
        "contours": {each: {"highlight": False} for each in "xyz"},
        "lighting": {"ambient": 0.8, "diffuse": 0.3, "specular": 0.0},
        **options,
    }


def mesh_trace(vertices: Array, faces: NDArray[np.int64], **options: Any) -> dict[str, Any]:  # noqa: ANN401
    """Triangles (m, 3) between vertices (n, 3)."""
    x, y, z = vertices.reshape(-1, 3).T
    i, j, k = faces.reshape(-1, 3).T
    arrays = {name: packed(values) for name, values in {"x": x, "y": y, "z": z, "i": i, "j": j, "k": k}.items()}
    look = {"hoverinfo": "skip", "lighting": LIGHTING, "flatshading": False, "showlegend": True}
    return {"type": "mesh3d", **arrays, **look, **options}


def repeated(faces: NDArray[np.int64], count: int, points: int) -> NDArray[np.int64]:
    """The faces of one ball, which has so many points, for all."""
    every: NDArray[np.int64] = (faces[None, :, :] + points * np.arange(count)[:, None, None]).reshape(-1, 3)
    return every
