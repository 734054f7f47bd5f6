"""Bits do not depend on threads; Python goes on while Rust works."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bgars
import numpy as np
import pytest
from bgars import _bgars
from bgars.io.images import decode_stack

if TYPE_CHECKING:
    from collections.abc import Callable

    from bgars.normals.methods import Method

DIGEST = """
import hashlib, sys, bgars
threads = int(sys.argv[1]) if len(sys.argv) > 1 else None
result = bgars.reconstruct(bgars.read_capture(bgars.sample_capture()), threads=threads)
print(hashlib.sha256(result.field.normals.tobytes() + result.height.height_px.tobytes()).hexdigest())
"""
SIZE = 1200


def noisy_normals(size: int = SIZE) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    normals = np.random.default_rng(0).normal([0, 0, 2], 0.3, (size, size, 3)).astype(np.float32)
    normals[..., 2] = np.abs(normals[..., 2])
    return normals / np.linalg.norm(normals, axis=-1, keepdims=True)


def noisy_stack(size: int = SIZE) -> np.ndarray[tuple[int, ...], np.dtype[np.uint8]]:
    return np.random.default_rng(1).integers(0, 255, (8, size, size), dtype=np.uint8)


def digest(*arguments: str, **environment: str) -> str:
    return subprocess.run(
        [sys.executable, "-c", DIGEST, *arguments],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=True,
    ).stdout.strip()


def test_one_and_two_threads_give_the_same_bits_however_they_are_asked_for() -> None:
    digests = {digest(RAYON_NUM_THREADS="1"), digest(RAYON_NUM_THREADS="2"), digest("1"), digest("2"), digest("3")}
    assert len(digests) == 1
    assert len(digests.pop()) == 2 * hashlib.sha256().digest_size


def work(name: str, folder: Path) -> Callable[[], Any]:
    """One call into the compiled module that takes a good while."""
    rig = bgars.LightRig.ring(8)
    if name == "estimate_normals":
        stack = noisy_stack()
        return lambda: bgars.estimate_normals(stack, rig.directions)
    if name == "integrate_normals":
        normals = noisy_normals(2 * SIZE)
        return lambda: bgars.integrate_normals(normals)
    if name == "decode_stack":
        noise = np.random.default_rng(2).integers(0, 65535, (SIZE, SIZE, 3), dtype=np.uint16)
        paths = [folder / f"{index}.png" for index in range(3)]
        for path in paths:
            _bgars.write_png16(path, noise)
        return lambda: decode_stack(paths, channel="mean", max_megapixels=100.0)
    height = np.random.default_rng(3).normal(size=(2 * SIZE, 2 * SIZE)).astype(np.float32)
    if name == "triangulate":
        mask = np.ones(height.shape, dtype=np.bool_)
        return lambda: [_bgars.triangulate(height, mask, 1.0, threads=None) for _ in range(3)]
    surface = bgars.HeightMap.from_array(height)
    if name.startswith("height"):
        return lambda: bgars.write_mesh(surface, folder / name)
    mesh = bgars.mesh_from_height(surface)
    return lambda: bgars.write_mesh(mesh, folder / name)


CALLS = ["estimate_normals", "integrate_normals", "decode_stack", "triangulate"]
FILES = ["mesh.ply", "mesh.obj", "height.ply", "height.obj"]


@pytest.mark.parametrize("name", CALLS + FILES)
def test_other_threads_run_while_the_compiled_module_works(name: str, tmp_path: Path) -> None:
    call = work(name, tmp_path)
    ticks = 0
    started, done = threading.Event(), threading.Event()

    def count() -> None:
        nonlocal ticks
        started.set()
        while not done.wait(0.0005):
            ticks += 1

    thread = threading.Thread(target=count, daemon=True)
    thread.start()
    started.wait()
    ticks = 0
    call()
    counted = ticks
    done.set()
    thread.join()
    assert counted >= 3, "the GIL was held"


def test_progress_is_reported_and_its_exception_stops_the_work() -> None:
    stack = noisy_stack(2 * SIZE)
    seen: list[float] = []

    def stop(fraction: float) -> None:
        seen.append(fraction)
        if len(seen) == 2:
            raise StopIteration

    with pytest.raises(StopIteration):
        bgars.estimate_normals(stack, bgars.LightRig.ring(8).directions, progress=stop)
    assert len(seen) == 2
    assert 0.0 < seen[0] < seen[1] < 1.0


def test_reading_and_triangulating_take_a_number_of_threads() -> None:
    one, two = (bgars.read_capture(bgars.sample_capture(), threads=threads).images for threads in (1, 2))
    np.testing.assert_array_equal(one, two)
    surface = bgars.HeightMap.from_array(np.random.default_rng(3).normal(size=(90, 70)))
    one, two = (bgars.mesh_from_height(surface, threads=threads).faces for threads in (1, 2))
    np.testing.assert_array_equal(one, two)


@pytest.mark.parametrize("threads", [0, -1, 1 << 40])
def test_a_senseless_number_of_threads_is_named(threads: int) -> None:
    with pytest.raises(bgars.InputError, match=f"threads: must be 1 to 1024, got {threads}"):
        bgars.integrate_normals(noisy_normals(4), threads=threads)


def test_strided_fortran_ordered_and_read_only_arrays_give_the_same_normals() -> None:
    stack = noisy_stack(40)
    directions = bgars.LightRig.ring(8).directions
    expected = bgars.estimate_normals(stack, directions, method="specular-filter").normals
    twice = np.repeat(stack, 2, axis=2)
    read_only = stack.copy()
    read_only.setflags(write=False)
    for variant in (np.asfortranarray(stack), twice[:, :, ::2], read_only, np.flip(np.flip(stack, 1).copy(), 1)):
        found = bgars.estimate_normals(variant, directions, method="specular-filter").normals
        np.testing.assert_array_equal(found, expected)
    heights = bgars.integrate_normals(expected).height_px
    np.testing.assert_array_equal(bgars.integrate_normals(np.asfortranarray(expected)).height_px, heights)


def test_results_go_into_the_memory_of_an_earlier_field() -> None:
    directions = bgars.LightRig.ring(8).directions
    first, second = noisy_stack(50), noisy_stack(50)[::-1].copy()
    expected = bgars.estimate_normals(second, directions, keep_sets=True)
    field = bgars.estimate_normals(first, directions, method="lambertian", keep_sets=True)
    again = bgars.estimate_normals(second, directions, keep_sets=True, out=field)
    assert again.normals is field.normals
    assert again.method == expected.method
    for name in ("normals", "albedo", "mask", "confidence", "is_measured", "lights_kept", "kept_sets"):
        np.testing.assert_array_equal(getattr(again, name), getattr(expected, name), err_msg=name)


@pytest.mark.parametrize("method", ["lambertian", "specular-filter", "robust-filter"])
def test_what_least_squares_measure_is_a_read_only_view_of_the_mask(method: Method) -> None:
    directions = bgars.LightRig.ring(8).directions
    stack, use = noisy_stack(50), np.ones((50, 50), np.bool_)
    use[10:20, 5:] = False
    for pixels in (None, use):
        field = bgars.estimate_normals(stack, directions, method=method, mask=pixels)
        again = bgars.estimate_normals(stack[::-1].copy(), directions, method=method, out=field)
        for each in (field, again):
            assert np.shares_memory(each.is_measured, each.mask)
            np.testing.assert_array_equal(each.is_measured, each.mask)
            with pytest.raises(ValueError, match="read-only"):
                each.is_measured[0, 0] = False


def test_measured_is_written_where_an_earlier_result_brings_its_own() -> None:
    directions = bgars.LightRig.ring(8).directions
    fresh = bgars.estimate_normals(noisy_stack(50), directions, method="lambertian")
    own = replace(fresh, is_measured=np.zeros_like(fresh.is_measured))
    again = bgars.estimate_normals(noisy_stack(50), directions, method="lambertian", out=own)
    assert again.is_measured is own.is_measured
    np.testing.assert_array_equal(again.is_measured, again.mask)


def test_a_read_only_array_of_an_earlier_result_is_named() -> None:
    directions = bgars.LightRig.ring(8).directions
    field = bgars.estimate_normals(noisy_stack(50), directions, method="lambertian")
    for name in ("albedo", "is_measured"):
        held = np.zeros_like(getattr(field, name))
        held.setflags(write=False)
        with pytest.raises(bgars.InputError, match=f"out: its arrays are overwritten, but {name} is read-only"):
            bgars.estimate_normals(noisy_stack(50), directions, method="lambertian", out=replace(field, **{name: held}))


def test_a_field_of_another_size_is_refused_before_it_is_touched() -> None:
    directions = bgars.LightRig.ring(8).directions
    field = bgars.estimate_normals(noisy_stack(20), directions)
    before = field.normals.copy()
    with pytest.raises(bgars.InputError, match="out: must be the result for images of 21 x 21 pixels"):
        bgars.estimate_normals(noisy_stack(21), directions, out=field)
    with pytest.raises(bgars.InputError, match="kept sets"):
        bgars.estimate_normals(noisy_stack(20), directions, keep_sets=True, out=field)
    np.testing.assert_array_equal(field.normals, before)
