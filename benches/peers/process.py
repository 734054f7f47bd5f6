"""Each measurement in a process of its own: thread counts are read once a process, and memory starts afresh."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent


def environment(threads: int) -> dict[str, str]:
    """The environment of a child that computes on `threads` threads, those of a BLAS not among them."""
    count = str(threads)
    return os.environ | {
        "RAYON_NUM_THREADS": count,
        "NUMBA_NUM_THREADS": count,
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
        "MKL_NUM_THREADS": "1",
        # A peer's idle threads must not spin while bgars runs.
        "OMP_WAIT_POLICY": "PASSIVE",
    }


def own_threads() -> int:
    """Threads this process was given by `environment`; a script that is run by itself computes on every core."""
    return int(os.environ.get("RAYON_NUM_THREADS") or os.cpu_count() or 1)


def run_script(script: str, arguments: list[str], threads: int) -> list[dict[str, Any]]:
    """Run a script of this folder and collect the rows it prints; what it says on standard error passes through.

    Raises
    ------
    subprocess.CalledProcessError
        The script failed.
    """
    command = [sys.executable, str(HERE / script), *arguments]
    done = subprocess.run(command, env=environment(threads), stdout=subprocess.PIPE, text=True, check=True)
    return [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]


class Worker:
    """A child that does one prepared piece of work whenever asked: two of them alternate with different threads.

    The script prints a line when it is ready and one after each piece, and stops at the end of its input.
    """

    def __init__(self, script: str, arguments: list[str], threads: int) -> None:
        command = [sys.executable, str(HERE / script), *arguments]
        self._process = subprocess.Popen(
            command, env=environment(threads), stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
        )
        self.answer = self._read()

    def _read(self) -> dict[str, Any]:
        line = self._process.stdout.readline() if self._process.stdout else ""
        if not line:
            msg = f"a measuring process ended early, exit status {self._process.wait()}"
            raise RuntimeError(msg)
        return dict(json.loads(line))

    def run(self) -> None:
        """Have the work done once; `answer` is then what the child says of it."""
        if self._process.stdin is None:
            return
        self._process.stdin.write("run\n")
        self._process.stdin.flush()
        self.answer = self._read()

    def close(self) -> None:
        """Let the child end."""
        if self._process.stdin is not None:
            self._process.stdin.close()
        self._process.wait()
