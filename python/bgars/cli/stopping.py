"""Commands that run until they are ended finish what is at hand."""

from __future__ import annotations

import signal
from contextlib import contextmanager
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import FrameType

__all__ = ["ended_by_signals"]


class Stoppable(Protocol):
    """What looks at `is_stopping` between two parts."""

    is_stopping: bool


@contextmanager
def ended_by_signals(worker: Stoppable) -> Iterator[None]:
    """SIGTERM and Ctrl-C set `is_stopping` meanwhile."""

    def stop(_signal: int, _frame: FrameType | None) -> None:
        worker.is_stopping = True

    earlier = [(number, signal.signal(number, stop)) for number in (signal.SIGTERM, signal.SIGINT)]
    try:
        yield
    finally:
        for number, handler in earlier:
            signal.signal(number, handler)
