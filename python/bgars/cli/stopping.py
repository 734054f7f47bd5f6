"""Commands that are ended: those that run until then finish what is at hand, the others clean up."""

from __future__ import annotations

import signal
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import FrameType

__all__ = ["ended_by_signals", "sigterm_as_ctrl_c"]


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


def sigterm_as_ctrl_c() -> list[int]:
    """Let SIGTERM end this process as Ctrl-C does, which removes what is half-written; return where it notes itself.

    By itself it ends a process at once, with its temporary folders and processes left behind.
    """
    noted: list[int] = []

    def end(number: int, _frame: FrameType | None) -> None:
        noted.append(number)
        raise KeyboardInterrupt

    # Only a main thread may take signals; what a parent ignores stays ignored, as with nohup.
    if threading.current_thread() is threading.main_thread() and signal.getsignal(signal.SIGTERM) == signal.SIG_DFL:
        signal.signal(signal.SIGTERM, end)
    return noted
