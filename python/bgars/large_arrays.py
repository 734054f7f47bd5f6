"""Large arrays on pages that are used again.

Memory fresh from the operating system costs about as long as the estimate that is written to it. An array that nobody
holds any more leaves its pages here for the next one of the same size. The system is told that it may take those of
large arrays back whenever it wants (``MADV_FREE``), so that they stand in nobody's way; for small ones that would take
longer than it is worth.
"""

from __future__ import annotations

import contextlib
import math
import mmap
import weakref
from collections import deque
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import DTypeLike, NDArray

MIN_BYTES = 1 << 16
"""Smaller arrays come from numpy."""
LARGE_BYTES = 1 << 20
"""From here on an array is large."""
LARGE_PAGE_BYTES = 1 << 21
"""A large array takes whole large pages: part of one would be many small pages, each marked anew at every call."""
KEPT_ARRAYS = 16
"""Arrays whose pages are kept at most: those of two normal fields, the one before and the one in use."""
_HAS_PRIVATE_PAGES = hasattr(mmap, "MAP_PRIVATE") and hasattr(mmap, "MAP_ANONYMOUS")

_free: deque[tuple[np.dtype[Any], mmap.mmap]] = deque(maxlen=KEPT_ARRAYS)
"""With the type that was written there: other bytes than 0 and 1 are no value of bool."""


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
    page_bytes = math.ceil(nbytes / step) * step
    pages = _taken(dtype, page_bytes) or _fresh(page_bytes)
    content = np.frombuffer(pages, np.uint8, nbytes)
    # Views hold `content`, which holds the pages; the last of them gives these back.
    weakref.finalize(content, _give_back, dtype, pages).atexit = False
    return content.view(dtype).reshape(shape)


def _taken(dtype: np.dtype[Any], page_bytes: int) -> mmap.mmap | None:
    """As many pages of an earlier array of the type, if there are any."""
    for _ in range(len(_free)):
        try:
            written, pages = _free.popleft()
        except IndexError:  # another thread was faster
            return None
        if written == dtype and len(pages) == page_bytes:
            return pages
        _free.append((written, pages))
    return None


def _fresh(page_bytes: int) -> mmap.mmap:
    """Pages of zeros, large ones where the system has them."""
    pages = mmap.mmap(-1, page_bytes, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    if page_bytes >= LARGE_PAGE_BYTES:
        _advise(pages, "MADV_HUGEPAGE")
    return pages


def _give_back(dtype: np.dtype[Any], pages: mmap.mmap) -> None:
    """Keep pages for the next array; what is kept longest goes to the system."""
    if len(pages) >= LARGE_PAGE_BYTES:
        _advise(pages, "MADV_FREE")
    _free.append((dtype, pages))


def _advise(pages: mmap.mmap, name: str) -> None:
    """Give the system an advice, where it takes it."""
    advice = getattr(mmap, name, None)
    if advice is not None:
        with contextlib.suppress(OSError):  # a kernel without it
            pages.madvise(advice)
