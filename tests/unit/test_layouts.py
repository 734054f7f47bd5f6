"""Every public function reads the same numbers from every memory layout: a new function is one line of `TAKERS`."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import bgars
import numpy as np
import pytest
from bgars import _bgars
from bgars.records.anchors import Anchors

SHAPE = (18, 23)
Array = np.ndarray
RIG = bgars.LightRig.ring(6, elevation_deg=50.0)


def surface() -> np.ndarray:
    rows, cols = np.mgrid[: SHAPE[0], : SHAPE[1]]
    return (2.0 * np.sin(rows / 5.0) + 0.1 * cols + 0.01 * rows * cols).astype(np.float32)


def unit_normals() -> np.ndarray:
    z_down, z_right = np.gradient(surface().astype(np.float64))
    normals = np.stack([-z_right, z_down, np.ones(SHAPE)], axis=-1)
    return (normals / np.linalg.norm(normals, axis=2, keepdims=True)).astype(np.float32)


def photographs() -> np.ndarray:
    shade = np.clip(np.einsum("lc,hwc->lhw", RIG.directions, unit_normals()), 0.0, None)
    return np.rint(200.0 * shade).astype(np.uint16)


MASK = np.hypot(*(np.mgrid[: SHAPE[0], : SHAPE[1]] - 9)) < 8


def capture(**arrays: Array) -> bgars.Capture:
    given = {"images": photographs(), "mask": np.ones(SHAPE, np.bool_), **arrays}
    return bgars.Capture(rig=RIG, full_scale=255.0, pixel_pitch_um=5.0, **given)


def estimated(record: bgars.Capture) -> list[np.ndarray]:
    field = bgars.estimate_normals(record, method="robust-filter", keep_sets=True)
    return [field.normals, field.mask, field.albedo]


def height(**arrays: Array) -> bgars.HeightMap:
    record = bgars.HeightMap.from_array(np.where(MASK, surface(), np.nan))
    return replace(record, **arrays)


def field(**arrays: Array) -> bgars.NormalField:
    return replace(bgars.estimate_normals(capture(), method="robust-filter", keep_sets=True), **arrays)


def reused(array: np.ndarray) -> list[np.ndarray]:
    if not array.flags.writeable:
        array = array.copy(order="K")
    again = bgars.estimate_normals(capture(), method="robust-filter", keep_sets=True, out=field(normals=array))
    return [again.normals, again.mask]


def written(write: Callable[[Path], object], suffix: str, folder: Path) -> bytes:
    path = folder / f"f{suffix}"
    write(path)
    return path.read_bytes()


def mesh_bytes(record: bgars.HeightMap, folder: Path, normal_field: bgars.NormalField | None = None) -> bytes:
    return written(lambda path: bgars.write_mesh(record, path, field=normal_field), ".ply", folder)


def anchored(**arrays: Array) -> np.ndarray:
    given = {"height_um": surface(), "weights": np.ones(SHAPE, np.float32), "regions": MASK.astype(np.int32), **arrays}
    return bgars.integrate_normals(unit_normals(), anchors=Anchors(**given), pixel_pitch_um=5.0).height_px


def triangles(record: bgars.HeightMap) -> list[np.ndarray]:
    mesh = bgars.mesh_from_height(record, field())
    return [np.asarray(mesh.vertices), np.asarray(mesh.faces)]


def integrated(normals: Array, **options: object) -> np.ndarray:
    return bgars.integrate_normals(normals, **options).height_px


def loose_mesh(vertices: np.ndarray) -> list[np.ndarray]:
    mesh = bgars.mesh_from_height(height())
    mesh.vertices = vertices
    return [np.asarray(mesh.vertices)]


# name: (array in C order, what is made of it and the folder of the test)
TAKERS: dict[str, tuple[np.ndarray, Callable[[Any, Path], Any]]] = {
    "Capture.images uint16": (photographs(), lambda a, _: estimated(capture(images=a))),
    "Capture.images uint8": (photographs().astype(np.uint8), lambda a, _: estimated(capture(images=a))),
    "Capture.images float32": (photographs().astype(np.float32), lambda a, _: estimated(capture(images=a))),
    "Capture.dark": (MASK.astype(np.uint16) * 9, lambda a, _: estimated(capture(dark=a))),
    "Capture.mask": (MASK, lambda a, _: estimated(capture(mask=a))),
    "Capture.response": (
        np.linspace(0, 255, 65536, dtype=np.float32) ** 1.1,
        lambda a, _: estimated(capture(response=a)),
    ),
    "estimate_normals(images)": (
        photographs(),
        lambda a, _: bgars.estimate_normals(a, RIG.directions, method="robust-filter").normals,
    ),
    "estimate_normals(light_directions)": (
        RIG.directions,
        lambda a, _: bgars.estimate_normals(photographs(), a, method="lambertian").normals,
    ),
    "estimate_normals(mask)": (
        MASK,
        lambda a, _: bgars.estimate_normals(capture(), method="lambertian", mask=a).normals,
    ),
    "estimate_normals(out)": (np.zeros((*SHAPE, 3), np.float32), lambda a, _: reused(a)),
    "estimate_normals blind": (photographs(), lambda a, _: bgars.estimate_normals(capture(images=a)).normals),
    "integrate_normals(normals)": (unit_normals(), lambda a, _: integrated(a)),
    "integrate_normals(normals) bilateral": (unit_normals(), lambda a, _: integrated(a, method="bilateral")),
    "integrate_normals(mask)": (MASK, lambda a, _: integrated(unit_normals(), mask=a)),
    "integrate_normals(weights)": (surface() + 3, lambda a, _: integrated(unit_normals(), weights=a)),
    "integrate_normals(NormalField.normals)": (unit_normals(), lambda a, _: integrated(field(normals=a))),
    "integrate_normals(NormalField.mask)": (MASK, lambda a, _: integrated(field(mask=a))),
    "Anchors.height_um": (surface(), lambda a, _: anchored(height_um=a)),
    "Anchors.weights": (surface() + 3, lambda a, _: anchored(weights=a)),
    "Anchors.regions": (MASK.astype(np.int32), lambda a, _: anchored(regions=a)),
    "HeightMap.from_array": (surface(), lambda a, _: triangles(bgars.HeightMap.from_array(a))),
    "mesh_from_height(height_px)": (surface(), lambda a, _: triangles(height(height_px=a))),
    "mesh_from_height(mask)": (MASK, lambda a, _: triangles(height(mask=a, height_px=surface()))),
    "write_mesh(HeightMap.height_px)": (surface(), lambda a, to: mesh_bytes(height(height_px=a), to)),
    "write_mesh(HeightMap.mask)": (MASK, lambda a, to: mesh_bytes(height(mask=a, height_px=surface()), to)),
    "write_mesh(field.normals)": (unit_normals(), lambda a, to: mesh_bytes(height(), to, field(normals=a))),
    "write_mesh(field.albedo)": (surface(), lambda a, to: mesh_bytes(height(), to, field(albedo=a))),
    "write_mesh(Trimesh.vertices)": (
        np.asarray(bgars.mesh_from_height(height()).vertices, np.float64) * 2.0,
        lambda a, _: loose_mesh(a),
    ),
    "write_height(HeightMap)": (
        surface(),
        lambda a, to: written(lambda path: bgars.write_height(height(height_px=a), path), ".npy", to),
    ),
    "write_normal_map": (
        unit_normals(),
        lambda a, to: written(lambda path: bgars.write_normal_map(a, path), ".png", to),
    ),
    "angular_error_deg": (unit_normals(), lambda a, _: bgars.angular_error_deg(a, unit_normals()[::-1])),
    "find_balls": (photographs(), lambda a, _: len(bgars.find_balls(capture(images=a)).balls)),
}


def memory_mapped(array: np.ndarray, folder: Path) -> np.ndarray:
    path = folder / "mapped.npy"
    np.save(path, array)
    return np.load(path, mmap_mode="r")


def read_only(array: np.ndarray) -> np.ndarray:
    array = array.copy()
    array.flags.writeable = False
    return array


def strided(array: np.ndarray) -> np.ndarray:
    wide = np.repeat(array, 2, axis=-1)
    return wide[..., ::2]


def negative(array: np.ndarray) -> np.ndarray:
    flipped = np.ascontiguousarray(array[tuple([slice(None, None, -1)] * array.ndim)])
    return flipped[tuple([slice(None, None, -1)] * array.ndim)]


def other_bytes(array: np.ndarray) -> np.ndarray:
    return (array.view(np.uint8) * 254).view(np.bool_) if array.dtype == np.bool_ else array


def unaligned(array: np.ndarray) -> np.ndarray:
    room = bytearray(array.nbytes + 1)
    found = np.frombuffer(room, np.uint8)[1:].view(array.dtype).reshape(array.shape)
    found[...] = array
    return found


LAYOUTS: dict[str, Callable[[np.ndarray, Path], np.ndarray]] = {
    "C": lambda array, _: array.copy(),
    "Fortran": lambda array, _: np.asfortranarray(array),
    "strided": lambda array, _: strided(array),
    "negative strides": lambda array, _: negative(array),
    "read-only": lambda array, _: read_only(array),
    "memory-mapped": memory_mapped,
    "big-endian": lambda array, _: array.astype(array.dtype.newbyteorder(">")),
    "bools of other bytes": lambda array, _: other_bytes(array),
    "unaligned": lambda array, _: unaligned(array),
    "masked, nothing hidden": lambda array, _: np.ma.MaskedArray(array),
}


def parts(result: object) -> list[object]:
    each = result if isinstance(result, list) else [result]
    return [part.tobytes() if isinstance(part, np.ndarray) else part for part in each]


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("name", TAKERS)
def test_the_same_numbers_in_another_layout_give_the_same_result(name: str, layout: str, tmp_path: Path) -> None:
    array, take = TAKERS[name]
    expected = parts(take(array.copy(), tmp_path))
    given = LAYOUTS[layout](array, tmp_path)
    if layout.startswith("masked"):
        # Some records refuse them, in one line; no function loses the mask without a word.
        with suppress(bgars.InputError):
            assert parts(take(given, tmp_path)) == expected
        return
    assert parts(take(given, tmp_path)) == expected


def test_what_a_masked_stack_hides_is_not_used() -> None:
    images = np.ma.MaskedArray(photographs(), mask=np.zeros((6, *SHAPE), np.bool_))
    images[2, 4, 5] = np.ma.masked
    for result in (
        bgars.estimate_normals(images, RIG.directions, method="lambertian"),
        bgars.estimate_normals(capture(images=images), method="lambertian"),
    ):
        assert not result.mask[4, 5]
        assert result.mask.sum() == result.mask.size - 1


def test_what_masked_normals_hide_is_not_integrated_and_black_in_a_map(tmp_path: Path) -> None:
    hidden = np.broadcast_to(~MASK[..., None], (*SHAPE, 3))
    normals = np.ma.MaskedArray(unit_normals(), mask=hidden)
    assert (bgars.integrate_normals(normals).mask == MASK).all()
    bgars.write_normal_map(normals, tmp_path / "n.png")
    assert (np.isfinite(bgars.read_normal_map(tmp_path / "n.png")[..., 0]) == MASK).all()
    hidden_height = np.ma.MaskedArray(surface(), mask=~MASK)
    assert (bgars.HeightMap.from_array(hidden_height).mask == MASK).all()


def test_the_binding_itself_refuses_other_orders_and_other_bytes() -> None:
    with pytest.raises(bgars.InputError, match="C-contiguous"):
        _bgars.usable_normals(np.asfortranarray(unit_normals()), threads=1)
    flat = np.zeros(SHAPE, np.float32)
    bad = np.full(SHAPE, 7, np.uint8).view(np.bool_)
    with pytest.raises(bgars.InputError, match="0 or 1"):
        _bgars.triangulate(flat, bad, 1.0, threads=1)
