"""Many captures into one store, on this machine or on a cluster."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass, field, replace
from datetime import datetime, timezone
from pathlib import Path
from typing import TYPE_CHECKING

from bgars.errors import InputError
from bgars.io.part_recipe import read_part_recipe
from bgars.line.dask_pool import run_on_cluster
from bgars.line.folders import capture_folders
from bgars.line.job import Job, Outcome, place_serial, with_content
from bgars.line.local_pool import run_local, share_cores, thread_environment
from bgars.line.naming import Naming
from bgars.normals.methods import ALL_METHODS, DEFAULT_METHOD, Method, added_method
from bgars.records.scalar_checks import check_progress
from bgars.records.short import Short
from bgars.store import Store, open_store
from bgars.store.rows import TIME_FORM

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterable, Iterator
    from os import PathLike

    from bgars.records.part_result import PartResult
    from bgars.records.strip_layout import StripLayout

__all__ = ["Batch", "Progress", "inspect_many", "now_utc", "store_outcome"]

COMPACT_FROM = 200
"""Parts of a run that are worth a compaction."""


@dataclass(frozen=True)
class Progress:
    """How far a run is.

    Attributes
    ----------
    done, total : int
        Captures.
    failed : int
        Of them, those that could not be inspected.
    seconds : float
        Since the start.
    """

    done: int
    total: int
    failed: int
    seconds: float

    @property
    def per_minute(self) -> float:
        """Captures a minute."""
        return 60.0 * self.done / self.seconds if self.seconds > 0 else 0.0

    @property
    def remaining_s(self) -> float:
        """Time that the others will take at this rate; infinite at the start."""
        return (self.total - self.done) * self.seconds / self.done if self.done else float("inf")


@dataclass(repr=False)
class Batch(Short):
    """What a run did.

    Attributes
    ----------
    total : int
        Captures.
    verdicts : dict of int
        Of the parts that this run inspected.
    known : int
        Parts that were in the store.
    failures : list of (str, str)
        Folder and reason of each capture that could not be inspected.
    notes : list of str
        What to look at: serial numbers that came in another lot before.
    results : list of PartResult
        Without a store only, in the order of the folders.
    seconds : float
    processes, threads : int
        0 on a cluster.
    """

    total: int
    verdicts: dict[str, int] = field(default_factory=lambda: {"pass": 0, "fail": 0, "undecided": 0})
    known: int = 0
    failures: list[tuple[str, str]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    results: list[PartResult] = field(default_factory=list)
    seconds: float = 0.0
    processes: int = 0
    threads: int = 0

    @property
    def inspected(self) -> int:
        """Parts that this run inspected."""
        return sum(self.verdicts.values())

    def _facts(self) -> dict[str, object]:
        told = {"total": self.total, **self.verdicts, "known": self.known, "failures": len(self.failures)}
        return {**told, "seconds": f"{self.seconds:.1f}"}


def inspect_many(
    folders: str | PathLike[str] | Iterable[str | PathLike[str]],
    recipe: str | PathLike[str] | None = None,
    *,
    store: Store | str | PathLike[str] | None = None,
    method: Method = DEFAULT_METHOD,
    naming: Naming | None = None,
    processes: int | None = None,
    threads: int | None = None,
    scheduler: str | None = None,
    send_images: bool = False,
    progress: Callable[[Progress], object] | None = None,
) -> Batch:
    """Inspect many captures; failures are kept with their reason and do not stop the others.

    The results are the same in any order and for any number of processes and threads. What the store has, by the
    contents of images, recipe and version, is not done again: a killed run continues where it stopped.

    Parameters
    ----------
    folders : path or iterable of path
        Captures, folders of captures, or patterns such as ``"lots/L7/*"``.
    recipe : path, optional
        Part recipe.
    store : Store or path, optional
        Where results go as they come; made where there is nothing. Without one they are in ``Batch.results``.
    method : str
        Estimator of the normals.
    naming : Naming, optional
        Where serial numbers come from; the folder's name by default.
    processes, threads : int, optional
        Processes, and threads of each; together one per core by default.
    scheduler : str, optional
        Address of a Dask scheduler, ``tcp://HOST:PORT``: work there. Its workers see the folders under the same names,
        unless `send_images`.
    send_images : bool
        Send the files to the cluster's workers.
    progress : callable, optional
        Called with a :class:`Progress` after every capture.

    Returns
    -------
    Batch

    Raises
    ------
    InputError
        No captures, wrong numbers, a recipe that contradicts itself, or a scheduler that does not answer.
    FileFormatError
        A folder or the recipe is missing, or the store cannot be written: then nothing more is done.

    Notes
    -----
    More than one process imports the caller's main module again: scripts need ``if __name__ == "__main__":``.

    Examples
    --------
    >>> import bgars
    >>> done = bgars.inspect_many([bgars.sample_capture()], processes=1)
    >>> done.verdicts, done.results[0].serial
    ({'pass': 0, 'fail': 0, 'undecided': 1}, 'one_ball')
    """
    check_progress(progress)
    _check_arguments(recipe, store, method, naming, {"processes": processes, "threads": threads})
    captures = capture_folders(folders)
    part = None if recipe is None else read_part_recipe(recipe)
    if send_images and part is not None and part.material_file is not None:
        msg = f"{recipe}: material.file: cannot be sent to a cluster; put it where the workers see it, without sending"
        raise InputError(msg)
    opened = store if isinstance(store, Store) or store is None else open_store(store, create=True)
    used = share_cores(len(captures), processes, threads) if scheduler is None else (0, threads or 1)
    batch = Batch(len(captures), processes=used[0], threads=used[1])
    template = Job("", "" if recipe is None else str(recipe), method, naming or Naming(), threads=used[1])
    jobs = _jobs(captures, template, opened, None if part is None else part.strip, send=send_images)
    started = time.monotonic()
    results: dict[str, list[PartResult]] = {}
    for done, outcomes in enumerate(_run(jobs, used, scheduler), 1):
        for outcome in outcomes:
            name, lot = "" if part is None else part.name, template.naming.common.lot
            stamped = store_outcome(outcome, opened, recipe=name, lot=lot, say=batch.notes.append)
            _count(batch, outcome, is_new=stamped is not None)
            if opened is None and stamped is not None:
                results.setdefault(outcome.folder, []).append(stamped)
        batch.seconds = time.monotonic() - started
        if progress is not None:
            progress(Progress(done, batch.total, len(batch.failures), batch.seconds))
    batch.results = [result for folder in captures for result in results.get(str(folder), ())]
    if opened is not None and batch.inspected >= COMPACT_FROM:
        opened.compact()
    return batch


def _check_arguments(recipe: object, store: object, method: str, naming: object, counts: dict[str, object]) -> None:
    """Refuse what would fail every capture, or after the first of them."""
    for name, value in (("recipe", recipe), ("store", store)):
        if not isinstance(value, str | os.PathLike | None) and not (name == "store" and isinstance(value, Store)):
            msg = f"{name}: must be a path, got {value!r}"
            raise InputError(msg)
    if not isinstance(naming, Naming | None):
        msg = f"naming: must be a Naming, such as bgars.Naming('{{lot}}/{{serial}}'), got {naming!r}"
        raise InputError(msg)
    for name, count in counts.items():
        if count is not None and (isinstance(count, bool) or not isinstance(count, int) or count < 1):
            msg = f"{name}: must be a whole number of 1 or more, got {count!r}"
            raise InputError(msg)
    if method not in ALL_METHODS:
        added_method(method)


def store_outcome(
    outcome: Outcome,
    store: Store | None,
    *,
    recipe: str = "",
    lot: str = "",
    moved_to: Path | None = None,
    say: Callable[[str], object] = lambda _note: None,
) -> PartResult | None:
    """Stamp a result with the time and keep it, or keep why there is none; return it where it is new.

    `moved_to` is where the capture will lie, if elsewhere; `say` gets a note where a serial number changes its lot.

    Raises
    ------
    FileFormatError
        The store cannot be written.
    """
    if outcome.is_known:
        return None
    folder = str((moved_to or Path(outcome.folder)).absolute())
    if outcome.result is None:
        if store is not None:
            store.append_failure(folder, outcome.reason, serial=outcome.serial, recipe=recipe, lot=lot)
        return None
    result = replace(outcome.result, inspected_utc=now_utc())
    if store is None:
        return result
    result = store.numbered(result)
    note = store.lot_note(result)
    if not store.append(result, capture_folder=folder, seconds=outcome.seconds):
        return None
    if note:
        say(note)
    return result


def now_utc() -> str:
    """The time as the stamps of results have it."""
    return datetime.now(timezone.utc).strftime(TIME_FORM)


def _jobs(
    captures: list[Path], template: Job, store: Store | None, strip: StripLayout | None, *, send: bool
) -> Iterator[Job]:
    known = frozenset() if store is None else frozenset(store.known())
    by_serial: dict[str, set[str]] = {}
    for key, serial in ({} if store is None else store.known()).items():
        by_serial.setdefault(serial, set()).add(key)
    for folder in captures:
        job = replace(template, folder=str(folder))
        try:
            serial, _ = template.naming.of_name(folder)
        except (InputError, OSError):
            serial = ""
        # A job takes only the keys that can be its own: there may be millions.
        names = [serial] if strip is None else [place_serial(serial, place.name) for place in strip.places()]
        own = frozenset[str]().union(*(by_serial.get(name, ()) for name in names))
        job = replace(job, known=own if serial else known)
        yield with_content(job) if send else job


def _run(
    jobs: Iterator[Job], used: tuple[int, int], scheduler: str | None
) -> Generator[tuple[Outcome, ...], None, None]:
    if scheduler is not None:
        yield from run_on_cluster(jobs, scheduler)
        return
    processes, threads = used
    with thread_environment(threads):
        yield from run_local(jobs, processes)


def _count(batch: Batch, outcome: Outcome, *, is_new: bool) -> None:
    if outcome.result is not None and is_new:
        batch.verdicts[outcome.result.verdict] += 1
    elif outcome.reason:
        batch.failures.append((outcome.folder, outcome.reason))
    else:
        batch.known += 1
