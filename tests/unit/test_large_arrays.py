"""Arrays whose pages are used again never share them while somebody holds one."""

from __future__ import annotations

import gc
import subprocess
import sys

import bgars
import numpy as np
import pytest
from bgars import large_arrays
from bgars.large_arrays import HELD_BYTES, KEPT_ARRAYS, LARGE_BYTES, MIN_BYTES, any_content

of_both_kinds = pytest.mark.parametrize("shape", [(MIN_BYTES // 4, 3), (LARGE_BYTES // 4, 3)])


@pytest.fixture(autouse=True)
def no_pages_kept() -> None:
    large_arrays._held.clear()
    large_arrays._lent.clear()


@of_both_kinds
def test_an_array_starts_on_a_page_and_is_zero_at_first(shape: tuple[int, int]) -> None:
    array = any_content(shape, np.float32)
    assert array.shape == shape
    assert array.dtype == np.float32
    assert array.flags.c_contiguous
    assert array.flags.writeable
    assert array.ctypes.data % 4096 == 0
    assert not array.any()


@of_both_kinds
def test_pages_are_used_again_by_the_next_array_of_about_the_size(shape: tuple[int, int]) -> None:
    array = any_content(shape, np.float32)
    place = array.ctypes.data
    array[:] = 1
    del array
    other_size = any_content((2 * shape[0], 3), np.float32)
    assert other_size.ctypes.data != place
    assert any_content((3, shape[0] - 5), np.float32).ctypes.data == place  # as many pages


@of_both_kinds
def test_pages_hold_one_type_for_ever(shape: tuple[int, int]) -> None:
    array = any_content(shape, np.float32)
    array[:] = 0.1
    del array
    assert not any_content((shape[0] * 4, 3), np.bool_).view(np.uint8).any()


@of_both_kinds
def test_a_view_keeps_its_pages(shape: tuple[int, int]) -> None:
    array = any_content(shape, np.float32)
    array[:] = 7
    column = array[:, 1]
    del array
    gc.collect()
    others = [any_content(shape, np.float32) for _ in range(3)]
    for other in others:
        assert not np.shares_memory(other, column)
        other[:] = 8
    assert (column == 7).all()


def test_no_more_pages_are_kept_than_promised() -> None:
    arrays = [any_content((MIN_BYTES,), np.uint8) for _ in range(KEPT_ARRAYS + 5)]
    del arrays
    assert len(large_arrays._held) == KEPT_ARRAYS
    assert not large_arrays._lent


def test_pages_that_waited_longest_are_lent_to_the_system_and_used_again() -> None:
    arrays = [any_content((HELD_BYTES // 2,), np.uint8) for _ in range(3)]
    places = [array.ctypes.data for array in arrays]
    while arrays:
        del arrays[0]  # the first one first
    assert [pages.address for pages in large_arrays._lent] == places[:1]
    assert [pages.address for pages in large_arrays._held] == places[1:]
    again = [any_content((HELD_BYTES // 2,), np.uint8) for _ in range(3)]
    assert [array.ctypes.data for array in again] == [*places[1:], places[0]]


def test_arrays_held_to_the_end_of_the_process_say_nothing() -> None:
    code = "from bgars.large_arrays import any_content as a; kept = [a((1 << 21,), 'u1'), a((1 << 17,), bool)]"
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ended.stderr == ""


def test_small_arrays_are_zeros_of_numpy() -> None:
    array = any_content((10, 3), np.uint16)
    assert array.flags.owndata
    assert not array.any()


@pytest.mark.parametrize("method", ["specular-filter", "robust-filter"])
def test_a_field_on_used_pages_is_the_same(method: str) -> None:
    side = 1200
    rng = np.random.default_rng(5)
    directions = bgars.LightRig.ring(8, elevation_deg=50.0).directions
    bright, dim = (rng.integers(0, top, (8, side, side), dtype=np.uint8) for top in (256, 90))
    mask = rng.random((side, side)) > 0.3

    def estimate(images: np.ndarray) -> bgars.NormalField:
        return bgars.estimate_normals(images, directions, method=method, mask=mask, keep_sets=True)

    expected = estimate(dim)
    place = estimate(bright).normals.ctypes.data  # garbage at once
    again = estimate(dim)
    assert again.normals.ctypes.data == place
    for name in ("normals", "albedo", "mask", "confidence", "measured", "lights_kept", "kept_sets"):
        np.testing.assert_array_equal(getattr(again, name), getattr(expected, name), err_msg=name)
