"""Hostile arguments for every function that takes arrays: the public ones, and those of the binding below them.

Each call is a function of one source of chance, so that hypothesis can draw (and shrink) it, and the fuzzer repeat it.
About half of the arguments are as they should be: what is wrong everywhere never gets past the first check.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import bgars
import numpy as np
from bgars import _bgars

__all__ = ["CALLS", "hostile_call"]

DTYPES = ("u1", "u2", "f4", "f8", "i4", "i8", ">f4", ">u2", "?", "f2", "c8", "U3", "O")
NUMBERS = (0, 1, 2, 3, 7, -1, 2**31, 2**63, -(2**63), 10**30, 0.5, 1e-300, 1e300, float("nan"), float("inf"), None, "x")
VALUES = (0.0, 1.0, -1.0, 255.0, float("nan"), float("inf"), -float("inf"), 1e38, 1e-45, 65535.0)
MOST = 9


def shape_of(chance: Random, dimensions: int) -> tuple[int, ...]:
    return tuple(chance.choice((0, 1, 2, 3, chance.randint(1, MOST))) for _ in range(dimensions))


def array(chance: Random, shape: tuple[int, ...], dtype: str = "f4") -> Any:  # noqa: ANN401 - anything at all
    """An array of this shape and kind, or nearly, in any layout."""
    odd = chance.random()
    if odd < 0.02:
        return chance.choice((None, [], "x", 3, b"1", {}, [[1.0], [1.0, 2.0]], object()))
    if odd < 0.12:
        shape = shape_of(chance, chance.randint(0, 4))
    elif odd < 0.2 and shape:
        at = chance.randrange(len(shape))
        shape = (*shape[:at], chance.choice((0, 1, shape[at] + 1)), *shape[at + 1 :])
    if chance.random() < 0.12:
        dtype = chance.choice(DTYPES)
    return laid_out(chance, filled(chance, shape, dtype))


def filled(chance: Random, shape: tuple[int, ...], dtype: str) -> Any:  # noqa: ANN401 - as above
    """Ordinary values, the same value everywhere, or some bad ones among them."""
    random = np.random.default_rng(chance.getrandbits(32))
    kind = np.dtype(dtype).kind
    if kind in "UO":
        return np.full(shape, "x", dtype=dtype)
    if kind == "b":
        return random.random(shape) < chance.choice((0.0, 0.5, 1.0))
    values = random.random(shape) * (250.0 if kind in "ui" else 1.0)
    how = chance.random()
    if how < 0.15:
        values = np.full(shape, chance.choice(VALUES))
    elif how < 0.35 and values.size:
        bad = random.random(shape) < 0.2
        values = np.where(bad, chance.choice(VALUES), values)
    with np.errstate(all="ignore"):
        if kind in "ui":
            limits = np.iinfo(dtype)
            values = np.clip(np.nan_to_num(values), max(limits.min, -(2**31)), min(limits.max, 2**31))
        return values.astype(dtype)


def laid_out(chance: Random, values: Any) -> Any:  # noqa: ANN401, PLR0911 - as above; a layout a return
    """The same values in another memory layout."""
    how = chance.randrange(9)
    if how == 1:
        return np.asfortranarray(values)
    if how == 2 and values.ndim:
        return np.repeat(values, 2, axis=-1)[..., ::2]
    if how == 3 and values.ndim:
        return values[::-1]
    if how == 4 and values.ndim:
        values = values.copy()
        values.flags.writeable = False
    if how == 5 and values.dtype.hasobject is False and values.size:
        raw = bytearray(values.nbytes + 1)
        raw[1:] = values.tobytes()
        return np.frombuffer(raw, dtype=values.dtype, offset=1).reshape(values.shape)
    if how == 6 and values.ndim and values.shape[0]:
        return np.broadcast_to(values[:1], values.shape)
    if how == 7 and values.dtype.kind in "uif":
        return np.ma.masked_array(values, mask=False)
    return values


def number(chance: Random, good: Any) -> Any:  # noqa: ANN401 - as above
    return good if chance.random() < 0.8 else chance.choice(NUMBERS)


def size(chance: Random) -> tuple[int, int]:
    return chance.randint(1, MOST), chance.randint(1, MOST)


def normals(chance: Random) -> Any:  # noqa: ANN401 - as above
    return array(chance, (*size(chance), 3), "f4")


def lights(chance: Random, count: int) -> Any:  # noqa: ANN401 - as above
    if chance.random() < 0.6:
        return bgars.LightRig.ring(max(count, 3), elevation_deg=45.0).directions[:count]
    return array(chance, (count, 3), "f8")


def _maybe(chance: Random, value: Any) -> Any:  # noqa: ANN401 - as above
    return value if chance.random() < 0.5 else None


def _images(chance: Random) -> tuple[Any, Any, Any]:
    count, (rows, cols) = chance.randint(1, MOST), size(chance)
    images = array(chance, (count, rows, cols), chance.choice(("u1", "u2", "f4")))
    return images, lights(chance, count), _maybe(chance, array(chance, (rows, cols), "?"))


def _capture(chance: Random) -> bgars.Capture:
    images, directions, mask = _images(chance)
    if mask is None:
        mask = np.ones(getattr(images, "shape", (1, 1))[-2:], dtype=bool)
    rig = bgars.LightRig.from_directions(directions)
    return bgars.Capture(images, rig, mask, pixel_pitch_um=number(chance, 10.0), saturation=number(chance, 255.0))


def _estimate(chance: Random) -> object:
    images, directions, mask = _images(chance)
    method = chance.choice(("lambertian", "specular-filter", "robust-filter", "reflectance", "blind", "x"))
    return bgars.estimate_normals(images, directions, mask=mask, method=method, threads=number(chance, 1))


def _estimate_of(chance: Random) -> object:
    return bgars.estimate_normals(_capture(chance), threads=number(chance, 1))


def _integrate(chance: Random) -> object:
    values = normals(chance)
    mask = _maybe(chance, array(chance, getattr(values, "shape", (1, 1))[:2], "?"))
    method = chance.choice(("least-squares", "bilateral"))
    return bgars.integrate_normals(values, mask=mask, method=method, threads=number(chance, 1))


def _integrate_raw(chance: Random) -> object:
    rows, cols = size(chance)
    return _bgars.integrate_normals(
        array(chance, (rows, cols, 3)),
        array(chance, (rows, cols), "?"),
        _maybe(chance, array(chance, (rows, cols))),
        _maybe(chance, array(chance, (rows, cols), "i4")),
        height_px=array(chance, (rows, cols)),
        labels=array(chance, (rows, cols), "i4"),
        difference=chance.choice(("trapezoid", "forward", "")),
        relative_tolerance=number(chance, 1e-6),
        absolute_tolerance=number(chance, 1e-9),
        max_iters=number(chance, 50),
        threads=number(chance, 1),
        progress=chance.choice((None, 3, lambda *_: 1 / 0, lambda *_: None)),
    )


def _bilateral_raw(chance: Random) -> object:
    rows, cols = size(chance)
    return _bgars.integrate_bilateral(
        array(chance, (rows, cols, 3)),
        array(chance, (rows, cols), "?"),
        _maybe(chance, array(chance, (rows, cols))),
        _maybe(chance, array(chance, (rows, cols), "i4")),
        camera=chance.choice((None, None, (500.0, 500.0, 4.0, 4.0), (0.0, float("nan"), 1e300, -1.0))),
        k=number(chance, 2.0),
        max_iters=number(chance, 20),
        tolerance=number(chance, 1e-4),
        setting=chance.choice(("converged", "fast", "")),
        threads=number(chance, 1),
        progress=None,
    )


def _rims(chance: Random) -> object:
    count = chance.randint(1, 4)
    every, sectors = number(chance, 2), number(chance, 8)
    return _bgars.rim_bands(
        array(chance, (count, 3), "f8"), array(chance, (5,), "f8"), every=every, sectors=sectors, threads=1
    )


def _ring_edges(chance: Random) -> object:
    return _bgars.ring_edges(
        array(chance, (chance.randint(1, 4), *size(chance)), "f4"),
        array(chance, (3, 2), "f8"),
        array(chance, (4,), "f8"),
        directions=number(chance, 8),
        rank=number(chance, 1),
        threads=number(chance, 1),
    )


def _written(chance: Random, write: Callable[[Path], object], suffixes: tuple[str, ...]) -> object:
    with tempfile.TemporaryDirectory() as folder:
        return write(Path(folder) / f"out{chance.choice(suffixes)}")


def _write_mesh_raw(chance: Random) -> object:
    count = chance.randint(1, MOST)
    arguments = array(chance, (count, 3), "f8"), array(chance, (chance.randint(1, 5), 3), "i8")
    extra = {
        "normals": _maybe(chance, array(chance, (count, 3), "f8")),
        "colors": _maybe(chance, array(chance, (count, 3), "u1")),
    }
    comments = chance.choice(([], ["a"], ["a\nelement vertex 9"], ["\x00"], [3]))
    return _written(
        chance,
        lambda path: _bgars.write_mesh(path, *arguments, **extra, comments=comments, threads=1),
        (".ply", ".obj", ".x"),
    )


def _write_height_raw(chance: Random) -> object:
    rows, cols = size(chance)
    arguments = array(chance, (rows, cols)), array(chance, (rows, cols), "?"), number(chance, 1.0)
    extra = {
        "normals": _maybe(chance, array(chance, (rows, cols, 3))),
        "grey": _maybe(chance, array(chance, (rows, cols), "u1")),
    }
    return _written(
        chance,
        lambda path: _bgars.write_height(path, *arguments, **extra, comments=[], threads=number(chance, 1)),
        (".ply", ".obj"),
    )


def _mesh(chance: Random) -> object:
    height = bgars.HeightMap.from_array(array(chance, size(chance)), pixel_pitch_um=number(chance, 10.0))
    mesh = bgars.mesh_from_height(height)
    return _written(chance, lambda path: bgars.write_mesh(mesh, path), (".ply", ".obj", ".stl", ".glb"))


def _rig(chance: Random) -> object:
    return chance.choice(
        (
            lambda: bgars.LightRig.from_directions(array(chance, (4, 3), "f8"), intensities=array(chance, (4,), "f8")),
            lambda: bgars.LightRig.from_positions(array(chance, (4, 3), "f8")),
            lambda: bgars.LightRig.from_angles(array(chance, (4, 2), "f8")),
            lambda: bgars.LightRig.ring(number(chance, 8), elevation_deg=number(chance, 45.0)),
        )
    )()


def _triangles(chance: Random) -> object:
    rows, cols = size(chance)
    return _bgars.triangulate(
        array(chance, (rows, cols)), array(chance, (rows, cols), "?"), number(chance, 1.0), threads=number(chance, 1)
    )


CALLS: dict[str, Callable[[Random], object]] = {
    "estimate_normals of arrays": _estimate,
    "estimate_normals of a capture": _estimate_of,
    "check": lambda chance: bgars.check(_capture(chance)),
    "find_balls": lambda chance: bgars.find_balls(_capture(chance)),
    "integrate_normals": _integrate,
    "mesh": _mesh,
    "lights": _rig,
    "write_normal_map": lambda chance: _written(
        chance, lambda path: bgars.write_normal_map(normals(chance), path), (".png",)
    ),
    "write_height": lambda chance: _written(
        chance,
        lambda path: bgars.write_height(bgars.HeightMap.from_array(array(chance, size(chance))), path),
        (".tif", ".npy"),
    ),
    "_bgars.integrate_normals": _integrate_raw,
    "_bgars.integrate_bilateral": _bilateral_raw,
    "_bgars.usable_normals": lambda chance: _bgars.usable_normals(normals(chance), threads=number(chance, 1)),
    "_bgars.unit_directions": lambda chance: _bgars.unit_directions(array(chance, (4, 3), "f8")),
    "_bgars.float_full_scale": lambda chance: _bgars.float_full_scale(array(chance, (2, 3, 4)), threads=1),
    "_bgars.triangulate": _triangles,
    "_bgars.vertex_normals": lambda chance: _bgars.vertex_normals(
        array(chance, (5, 3), "f8"), array(chance, (4, 3), "i8"), threads=number(chance, 1)
    ),
    "_bgars.rim_bands": _rims,
    "_bgars.ring_edges": _ring_edges,
    "_bgars.write_mesh": _write_mesh_raw,
    "_bgars.write_height": _write_height_raw,
    "_bgars.write_png16": lambda chance: _written(
        chance, lambda path: _bgars.write_png16(path, array(chance, (*size(chance), 3), "u2")), (".png",)
    ),
}
ORDINARY = (ValueError, TypeError, OverflowError, OSError, ZeroDivisionError)
"""What the binding may raise; a panic is none of these."""


def hostile_call(name: str, chance: Random) -> str:  # noqa: PLR0911 - a verdict a return
    """Call; return "" where it answered or refused as it must, else what was wrong."""
    try:
        CALLS[name](chance)
    except bgars.BgarsError as error:
        return "" if "\n" not in str(error).strip() else f"not one line: {error}"
    except MemoryError:
        return ""
    except ORDINARY as error:
        if name.startswith("_bgars.") or isinstance(error, TypeError):
            return ""
        return f"raw {type(error).__name__}: {' '.join(str(error).split())[:120]}"
    except Exception as error:
        return f"raw {type(error).__name__}: {' '.join(str(error).split())[:120]}"
    except BaseException as error:
        if type(error).__name__ != "PanicException":
            raise
        return f"panic: {' '.join(str(error).split())[:120]}"
    return ""
