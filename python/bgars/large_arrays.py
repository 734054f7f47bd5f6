"""Large arrays on pages that are used again.

Memory fresh from the operating system costs about as long as the estimate that is written to it. An array that nobody
holds any more leaves its pages here for the next one of the same size. The system is told that it may take those of
large arrays back whenever it wants (``MADV_FREE``), but for the last ones, so that they stand in nobody's way.
"""

from __future__ import annotations

import contextlib
import math
import mmap
import sys
from collections import deque
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import DTypeLike, NDArray

MIN_BYTES = 1 << 16
"""Smaller arrays come from numpy."""
LARGE_BYTES = 1 << 20
"""From here on an array is large."""
LARGE_PAGE_BYTES = 1 << 21
"""A large array takes whole large pages: part of one would be many small pages, each marked anew at every call."""
KEPT_ARRAYS = 16
"""Arrays whose pages are held at most, and as many are lent: those of two normal fields, the one before and the one in
use."""
HELD_BYTES = 1 << 27
"""Kept pages that are not lent to the system: a normal field of five megapixels. To lend what the next call takes again
cost a hundredth of an estimate of four."""
_HAS_PRIVATE_PAGES = hasattr(mmap, "MAP_PRIVATE") and hasattr(mmap, "MAP_ANONYMOUS")


class _Pages(NamedTuple):
    """Memory of the system."""

    dtype: np.dtype[Any]
    """What was written there: other bytes than 0 and 1 are no value of bool."""
    memory: mmap.mmap
    address: int


_held: deque[_Pages] = deque(maxlen=KEPT_ARRAYS)
_lent: deque[_Pages] = deque(maxlen=KEPT_ARRAYS)
"""Those that may read as zeros by now."""


class _Loan:
    """What an array and its views hold of their pages; the last of them gives these back."""

    __slots__ = ("__array_interface__", "_pages")

    def __init__(self, pages: _Pages, shape: tuple[int, ...]) -> None:
        self._pages = pages
        self.__array_interface__ = {
            "version": 3,
            "shape": shape,
            "typestr": pages.dtype.str,
            "data": (pages.address, False),
        }

    def __del__(self, is_finalizing: Callable[[], bool] = sys.is_finalizing) -> None:
        if not is_finalizing():
            _give_back(self._pages)


def any_content(shape: tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
    """Return a C-contiguous array to be written; from `MIN_BYTES` on it starts on a page.

    Parameters
    ----------
    shape : tuple of int
        Its shape.
    dtype : dtype
        Its type; zeros must be a value of it.

    Returns
    -------
    ndarray
        Zeros, or what an array of this type and about this size held.
    """
    dtype = np.dtype(dtype)
    nbytes = math.prod(shape) * dtype.itemsize
    if nbytes < MIN_BYTES or not _HAS_PRIVATE_PAGES:
        return np.zeros(shape, dtype)
    step = LARGE_PAGE_BYTES if nbytes >= LARGE_BYTES else mmap.PAGESIZE
    page_bytes = -(-nbytes // step) * step
    pages = _taken(_held, dtype, page_bytes) or _taken(_lent, dtype, page_bytes) or _fresh(dtype, page_bytes)
    return np.asarray(_Loan(pages, shape))


def _taken(kept: deque[_Pages], dtype: np.dtype[Any], page_bytes: int) -> _Pages | None:
    """As many pages of an earlier array of the type, if there are any."""
    for passed in range(len(kept)):
        try:
            pages = kept.popleft()
        except IndexError:  # another thread was faster
            return None
        if pages.dtype == dtype and len(pages.memory) == page_bytes:
            kept.rotate(passed)  # back to the order in which they came
            return pages
        kept.append(pages)
    return None


def _fresh(dtype: np.dtype[Any], page_bytes: int) -> _Pages:
    """Pages of zeros, large ones where the system has them."""
    memory = mmap.mmap(-1, page_bytes, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    if page_bytes >= LARGE_PAGE_BYTES:
        _advise(memory, "MADV_HUGEPAGE")
    return _Pages(dtype, memory, np.frombuffer(memory, np.uint8).__array_interface__["data"][0])


def _give_back(pages: _Pages) -> None:
    """Keep pages for the next array; what is kept longest is lent to the system, and goes to it in the end."""
    _held.append(pages)
    while sum(len(held.memory) for held in tuple(_held)) > HELD_BYTES:
        try:
            longest = _held.popleft()
        except IndexError:  # another thread was faster
            return
        if len(longest.memory) >= LARGE_PAGE_BYTES:  # or it would take longer than it is worth
            _advise(longest.memory, "MADV_FREE")
        _lent.append(longest)


def _advise(memory: mmap.mmap, name: str) -> None:
    """Give the system an advice, where it takes it."""
    advice = getattr(mmap, name, None)
    if advice is not None:
        with contextlib.suppress(OSError):  # a kernel without it
            memory.madvise(advice)
