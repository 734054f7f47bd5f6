"""Jobs on the processors of this machine: processes times threads."""

from __future__ import annotations

import multiprocessing
import multiprocessing.connection
import os
import signal
import threading
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import TYPE_CHECKING

from bgars.line.job import Outcome, run_job

if TYPE_CHECKING:
    from collections.abc import Generator, Iterator
    from concurrent.futures import Future

    from bgars.line.job import Job

__all__ = ["run_local", "share_cores"]

AHEAD = 2
"""Jobs handed out for each process: it never waits for the next."""
THREAD_VARIABLES = ("RAYON_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
KILLED = "the process that inspected it was killed (out of memory, or a fault in a library); it was tried alone, too"


def share_cores(jobs: int, processes: int | None, threads: int | None) -> tuple[int, int]:
    """Return processes and threads of each, whose product is the number of cores unless both are given.

    Whole parts side by side waste least: there are threads only where there are fewer parts than cores.

    Examples
    --------
    >>> share_cores(100, 2, 3)
    (2, 3)
    """
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if processes is None:
        processes = max(1, min(jobs, cores // (threads or 1)))
    return processes, threads or max(1, cores // processes)


def run_local(jobs: Iterator[Job], processes: int) -> Generator[tuple[Outcome, ...], None, None]:
    """Yield the outcomes of every job, as they come; those at hand, too, before a KeyboardInterrupt goes on.

    A job whose process is killed is tried once more, alone; then it is a failure, and the others go on.
    """
    if processes == 1:
        yield from map(run_job, jobs)
        return
    context = multiprocessing.get_context("spawn")
    suspects: list[Job] = []
    more = True
    while more:
        with ProcessPoolExecutor(processes, context, _start_worker) as pool:
            suspects = yield from _until_broken(pool, jobs, processes)
        more = bool(suspects)
        for job in suspects:
            with ProcessPoolExecutor(1, context, _start_worker) as pool:
                broken = yield from _until_broken(pool, iter([job]), 1)
            if broken:
                yield (Outcome(job.folder, reason=KILLED, is_input=False),)


def _until_broken(
    pool: ProcessPoolExecutor, jobs: Iterator[Job], processes: int
) -> Generator[tuple[Outcome, ...], None, list[Job]]:
    """Yield outcomes; return the jobs that were at hand when a process was killed, or none at the end."""
    running: dict[Future[tuple[Outcome, ...]], Job] = {}
    suspects: list[Job] = []
    interrupted = False
    while True:
        try:
            while not interrupted and not suspects and len(running) < AHEAD * processes:
                job = next(jobs, None)
                if job is None:
                    break
                try:
                    running[pool.submit(run_job, job)] = job
                except BrokenProcessPool:
                    suspects.append(job)
            if not running:
                break
            done, _ = wait(running, return_when=FIRST_COMPLETED)
        except KeyboardInterrupt:
            interrupted = True
            for future in [future for future in running if future.cancel()]:
                del running[future]
            continue
        for future in done:
            job = running.pop(future)
            try:
                outcomes = future.result()
            except BrokenProcessPool:
                suspects.append(job)
                continue
            yield outcomes
    if interrupted:
        raise KeyboardInterrupt
    return suspects


@contextmanager
def thread_environment(threads: int) -> Iterator[None]:
    """Processes that start meanwhile work on so many threads."""
    earlier = {name: os.environ.get(name) for name in THREAD_VARIABLES}
    os.environ.update(dict.fromkeys(THREAD_VARIABLES, str(threads)))
    try:
        yield
    finally:
        for name, value in earlier.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def _start_worker() -> None:
    """Leave Ctrl-C to the parent, and end with it, however it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def follow() -> None:
        multiprocessing.connection.wait([parent.sentinel])
        os._exit(1)

    threading.Thread(target=follow, daemon=True).start()
