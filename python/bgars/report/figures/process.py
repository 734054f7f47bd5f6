"""Pictures drawn by a process of their own: it loads matplotlib while there is nothing to draw yet."""

from __future__ import annotations

import gc
import pickle
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from concurrent.futures import Future
    from types import TracebackType

__all__ = ["PictureProcess", "serve"]

CODE = """import gc, sys
gc.disable()
sys.path[:] = {path!r}
from bgars.report.figures.process import serve
serve({module!r})"""


class PictureProcess:
    """Draws beside other work; where its process cannot, this one does.

    As a context it ends the process, whatever became of the work. The process has no terminal and none of its signals:
    it ends when its input does.

    Parameters
    ----------
    module : str
        What draws, and what to load before there is anything to draw.
    """

    def __init__(self, module: str) -> None:
        command = [sys.executable, "-c", CODE.format(path=sys.path, module=module)]
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

    def start(self, module: str, function: str, *content: object) -> None:
        """Begin to draw: the function of the module is called with what is to be seen, and where it is written."""
        self._job = module, function, content
        self._sent = self._sender.submit(self._send)

    def _send(self) -> None:
        if self._process is not None:
            self._process.communicate(pickle.dumps(self._job))

    def finish(self) -> None:
        """Wait for what was begun."""
        if self._sent is not None:
            self._sent.result()
            if self._process is None or self._process.returncode != 0:
                _draw(*self._job)  # says what is wrong, if anything is


def serve(module: str) -> None:
    """Load a module, wait for something to draw on the standard input, draw it."""
    import_module(module)
    job = sys.stdin.buffer.read()
    if job:
        _draw(*pickle.loads(job))
    gc.freeze()  # nothing is left to do: to look for garbage in matplotlib at the end takes a tenth of the work


def _draw(module: str, function: str, content: tuple[object, ...]) -> None:
    getattr(import_module(module), function)(*content)
