"""The pictures of an inspection, drawn by a process of their own: it loads matplotlib while the part is measured."""

from __future__ import annotations

import pickle
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import TYPE_CHECKING

from bgars.report.figures.part import PICTURES, check_pictures, draw_part_pictures, thinned

if TYPE_CHECKING:
    from concurrent.futures import Future
    from pathlib import Path
    from types import TracebackType

    from bgars.records.capture import Capture
    from bgars.records.part_result import PartResult

__all__ = ["PictureProcess", "serve"]

CODE = "import gc, sys; gc.disable(); sys.path[:] = {path!r}; from bgars.report.figures.process import serve; serve()"


class PictureProcess:
    """Draws the pictures of one part beside other work; where its process cannot, this one does.

    As a context it ends the process, whatever became of the part. The process has no terminal and none of its signals:
    it ends when its input does.
    """

    def __init__(self) -> None:
        command = [sys.executable, "-c", CODE.format(path=sys.path)]
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        try:
            self._process = subprocess.Popen(command, start_new_session=True, **pipes)  # type: ignore[call-overload]
        except OSError:
            self._process = None
        self._sender = ThreadPoolExecutor(1)
        self._sent: Future[None] | None = None

    def __enter__(self) -> PictureProcess:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._process is not None:
            self._process.kill()
        self._sender.shutdown()  # first: it may be sending
        if self._process is not None:
            self._process.communicate()

    def start(self, result: PartResult, capture: Capture, folder: Path) -> None:
        """Begin to draw, as :func:`bgars.write_part_pictures` does."""
        check_pictures(result, capture)
        self._job = replace(result, surface=None), thinned(capture), folder
        self._sent = self._sender.submit(self._send)

    def _send(self) -> None:
        if self._process is not None:
            self._process.communicate(pickle.dumps(self._job))

    def finish(self) -> dict[str, str]:
        """Wait for the pictures; their names and what they show."""
        if self._sent is not None:
            self._sent.result()
            if self._process is None or self._process.returncode != 0:
                draw_part_pictures(*self._job)  # says what is wrong, if anything is
        return dict(PICTURES)


def serve() -> None:
    """Load what is needed, wait for a part on the standard input, draw it."""
    import bgars.report.figures.balls  # noqa: PLC0415 - matplotlib, above all
    import bgars.report.figures.shadows  # noqa: F401, PLC0415

    job = sys.stdin.buffer.read()
    if job:
        draw_part_pictures(*pickle.loads(job))
