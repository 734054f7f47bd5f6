"""Large arrays on pages that are used again.

Memory fresh from the operating system costs about as long as the estimate that is written to it. An array that nobody
holds any more leaves its pages here for the next one of the same size. The system is told that it may take them back
whenever it wants (``MADV_FREE``), so that they stand in nobody's way.
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

MIN_BYTES = 1 << 20
"""Smaller arrays come from numpy."""
KEPT_ARRAYS = 16
"""Arrays whose pages are kept at most: those of two normal fields, the one before and the one in use."""
_HAS_PRIVATE_PAGES = hasattr(mmap, "MAP_PRIVATE") and hasattr(mmap, "MAP_ANONYMOUS")

_free: deque[mmap.mmap] = deque(maxlen=KEPT_ARRAYS)


def any_content(shape: tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
    """Return a C-contiguous array to be written; large ones start on a page.

    Parameters
    ----------
    shape : tuple of int
        Its shape.
    dtype : dtype
        Its type; any bytes must be a value of it that was written before, or zeros.

    Returns
    -------
    ndarray
        Zeros, or what an array of the same size held.
    """
    nbytes = math.prod(shape) * np.dtype(dtype).itemsize
    if nbytes < MIN_BYTES or not _HAS_PRIVATE_PAGES:
        return np.zeros(shape, dtype)
    pages = _taken(nbytes) or _fresh(nbytes)
    content = np.frombuffer(pages, np.uint8)
    # Views hold `content`, which holds the pages; the last of them gives these back.
    weakref.finalize(content, _give_back, pages).atexit = False
    return content.view(dtype).reshape(shape)


def _taken(nbytes: int) -> mmap.mmap | None:
    """Pages of an earlier array of this size, if there are any."""
    for _ in range(len(_free)):
        try:
            pages = _free.popleft()
        except IndexError:  # another thread was faster
            return None
        if len(pages) == nbytes:
            return pages
        _free.append(pages)
    return None


def _fresh(nbytes: int) -> mmap.mmap:
    """Pages of zeros, large ones where the system has them."""
    pages = mmap.mmap(-1, nbytes, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    _advise(pages, "MADV_HUGEPAGE")
    return pages


def _give_back(pages: mmap.mmap) -> None:
    """Keep pages for the next array; what is kept longest goes to the system."""
    _advise(pages, "MADV_FREE")
    _free.append(pages)


def _advise(pages: mmap.mmap, name: str) -> None:
    """Give the system an advice, where it takes it."""
    advice = getattr(mmap, name, None)
    if advice is not None:
        with contextlib.suppress(OSError):  # a kernel without it
            pages.madvise(advice)
