"""What a long-lived process loads before its first part comes, which then takes no longer than the next."""

from __future__ import annotations

import tempfile
from contextlib import suppress
from typing import TYPE_CHECKING

from bgars.errors import BgarsError
from bgars.line.batch import store_outcome
from bgars.line.job import Job, run_job
from bgars.normals.methods import DEFAULT_METHOD, Method
from bgars.samples import sample_capture
from bgars.store import open_store

if TYPE_CHECKING:
    from bgars.store import Store

__all__ = ["warm_up"]


def warm_up(store: Store, method: Method = DEFAULT_METHOD, *, threads: int | None = None) -> None:
    """Inspect the ball that ships with bgars into a store that is thrown away, and read what `store` knows."""
    store.known()
    # A disk that is full now is said when a part comes.
    with suppress(BgarsError, OSError), tempfile.TemporaryDirectory(prefix="bgars-warm-") as place:
        for outcome in run_job(Job(str(sample_capture()), method=method, threads=threads)):
            store_outcome(outcome, open_store(f"{place}/store", create=True))
