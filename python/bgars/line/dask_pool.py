"""Jobs on an existing Dask cluster."""

from __future__ import annotations

import importlib
import logging
import time
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from bgars.errors import BgarsError, InputError
from bgars.line.job import Outcome, run_job

if TYPE_CHECKING:
    from collections.abc import Generator, Iterator

    from bgars.line.job import Job

__all__ = ["run_on_cluster"]

CONNECT_S = 10.0
LOST_S = 30.0
"""How long a scheduler may be away before the run ends; what is done is in the store."""
POLL_S = 0.05
AHEAD = 2
RETRIES = 2


def run_on_cluster(jobs: Iterator[Job], address: str) -> Generator[tuple[Outcome, ...], None, None]:
    """Yield the outcomes of every job, as they come.

    A job whose worker is killed is done by another one (three times at most). Jobs that a scheduler forgot, because it
    was started anew at its address, are handed out again.

    Raises
    ------
    InputError
        distributed is not installed, no scheduler answers, or a worker has another version of bgars.
    BgarsError
        The scheduler is lost.
    """
    distributed = _need_distributed()
    for name in ("distributed.client", "distributed.core", "distributed.comm", "distributed.batched"):
        logging.getLogger(name).setLevel(logging.CRITICAL)  # what is lost is said here, in one line
    try:
        client = distributed.Client(address, timeout=CONNECT_S, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        told = str(error).splitlines()[0] if str(error) else type(error).__name__
        msg = f"{address}: no Dask scheduler answers within {CONNECT_S:g} s ({told})"
        raise InputError(msg) from None
    try:
        _check_versions(client, address)
        yield from _outcomes(client, jobs, address)
    finally:
        client.close(timeout=2)


def _outcomes(client: Any, jobs: Iterator[Job], address: str) -> Generator[tuple[Outcome, ...], None, None]:  # noqa: ANN401
    running: dict[Any, Job] = {}
    again: list[Job] = []
    away_since: float | None = None
    while True:
        if client.status == "running":
            away_since = None
            room = max(2, AHEAD * _threads(client)) - len(running)
            for _ in range(room):
                job = again.pop() if again else next(jobs, None)
                if job is None:
                    break
                # Not pure: the result of an earlier run must not be taken for this one's.
                running[client.submit(run_job, job, pure=False, retries=RETRIES)] = job
            if not running:
                return
        else:
            away_since = away_since or time.monotonic()
            if client.status == "closed" or time.monotonic() - away_since > LOST_S:
                msg = f"{address}: the scheduler is lost; what was done is in the store, run again to go on"
                raise BgarsError(msg)
        done = [future for future in running if future.done()]
        for future in done:
            job = running.pop(future)
            if future.status == "finished":
                yield from _result(future, job, again)
            elif future.status == "error":
                error = future.exception()
                reason = " ".join(f"{type(error).__name__}: {error}".split())
                yield (Outcome(job.folder, reason=f"on the cluster: {reason}", is_input=False),)
            else:  # cancelled or lost: forgotten by a scheduler that was started anew
                again.append(job)
        if not done:
            time.sleep(POLL_S)


def _result(future: Any, job: Job, again: list[Job]) -> Generator[tuple[Outcome, ...], None, None]:  # noqa: ANN401 - no types
    try:
        yield future.result(timeout=60)
    except Exception:
        again.append(job)


def _threads(client: Any) -> int:  # noqa: ANN401 - no types
    """Threads of all workers, as the client last heard."""
    workers = client.scheduler_info(n_workers=-1).get("workers", {})
    return sum(int(worker["nthreads"]) for worker in workers.values())


def _check_versions(client: Any, address: str) -> None:  # noqa: ANN401 - no types
    """Results of one store come from one version."""
    own = version("bgars")
    try:
        found = client.run(version, "bgars")
    except Exception as error:
        msg = f"{address}: a worker cannot tell its version of bgars ({type(error).__name__}: {error})"
        raise InputError(msg) from None
    other = next(((worker, told) for worker, told in found.items() if told != own), None)
    if other is not None:
        msg = f"{address}: every worker must have bgars {own}, but {other[0]} has {other[1]}"
        raise InputError(msg)


def _need_distributed() -> Any:  # noqa: ANN401 - a module
    try:
        return importlib.import_module("distributed")
    except ImportError:
        msg = "scheduler: needs distributed, which is not installed; install it with: pip install 'bgars[dask]'"
        raise InputError(msg) from None
