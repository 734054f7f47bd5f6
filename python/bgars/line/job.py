"""One capture, inspected in whatever process has time: what goes in, and what comes out."""

from __future__ import annotations

import os
import tempfile
import time
from dataclasses import dataclass, field, replace
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING

from bgars.errors import BgarsError, InputError
from bgars.files.encodable import encodable, is_encodable
from bgars.io.capture import read_capture
from bgars.io.part_recipe import read_part_recipe
from bgars.io.provenance import capture_files, checksums
from bgars.line.naming import Naming, with_capture
from bgars.normals.methods import DEFAULT_METHOD, Method
from bgars.pipelines.check import check, refuse_wrong_geometry, told_by
from bgars.pipelines.inspect import inspected
from bgars.pipelines.strip import inspect_place, places_of_strip
from bgars.store.keys import key_of, part_key
from bgars.version import __version__

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from bgars.records.capture import Capture
    from bgars.records.findings import Findings
    from bgars.records.part_identity import PartIdentity
    from bgars.records.part_recipe import PartRecipe
    from bgars.records.part_result import PartResult

__all__ = ["Job", "Outcome", "place_serial", "run_job", "with_content"]


@dataclass(frozen=True)
class Job:
    """A capture to inspect; it travels between processes and machines.

    Attributes
    ----------
    folder : str
        Of the capture.
    recipe : str
        File of the part recipe; "" = none.
    method : str
    naming : Naming
    known : frozenset of str
        Keys that are in the store: what has one of them is not inspected again.
    threads : int or None
    content : tuple of (str, float, bytes)
        Name, time of writing and bytes of the folder's files where the worker does not see it, and the recipe under
        ``RECIPE``; empty = it does.
    """

    folder: str
    recipe: str = ""
    method: Method = DEFAULT_METHOD
    naming: Naming = field(default_factory=Naming)
    known: frozenset[str] = frozenset()
    threads: int | None = None
    content: tuple[tuple[str, float, bytes], ...] = field(default=(), repr=False)


@dataclass(frozen=True)
class Outcome:
    """What became of a part.

    Attributes
    ----------
    folder, serial : str
    result : PartResult or None
        Not stamped yet.
    reason : str
        Why there is none; "" where the part is known.
    is_known : bool
        The store has it.
    seconds : float
    is_input : bool
        The capture is at fault, and not the machine: to try again at once is no use.
    """

    folder: str
    serial: str = ""
    result: PartResult | None = None
    reason: str = ""
    is_known: bool = False
    seconds: float = 0.0
    is_input: bool = True


RECIPE = "/recipe.toml"
"""Name of the recipe in a job's content: no file of a folder has it."""


def with_content(job: Job) -> Job:
    """Return the job with the files themselves, for a worker that does not see the folder.

    Raises
    ------
    OSError
        A file cannot be read.
    """
    files = [
        (path.name, path.stat().st_mtime, path.read_bytes())
        for path in sorted(Path(job.folder).iterdir())
        if path.is_file()
    ]
    if job.recipe:
        files.append((RECIPE, 0.0, Path(job.recipe).read_bytes()))
    return replace(job, content=tuple(files))


def run_job(job: Job) -> tuple[Outcome, ...]:
    """Inspect a capture; every failure is an outcome. A strip has an outcome a part, any other capture one."""
    started = time.perf_counter()
    try:
        if job.content:
            with tempfile.TemporaryDirectory(prefix="bgars-job-") as place:
                return _inspected(job, *_unpacked(job, Path(place)), started)
        return _inspected(job, Path(job.folder), job.recipe, started)
    except Exception as error:
        return (_failed(job, _serial(job), error, started),)


def place_serial(serial: str, place: str) -> str:
    """Serial number of a part of a strip, made of that of the strip.

    Examples
    --------
    >>> place_serial("STRIP7", "R1C2")
    'STRIP7-R1C2'
    """
    return f"{serial}-{place}" if serial else ""


def _failed(job: Job, serial: str, error: Exception, started: float) -> Outcome:
    is_told = isinstance(error, BgarsError | OSError)
    told = str(error) if is_told else f"unexpected {type(error).__name__}: {error}"
    reason = " ".join(encodable(told).split())
    seconds = time.perf_counter() - started
    return Outcome(job.folder, serial, reason=reason, seconds=seconds, is_input=isinstance(error, BgarsError))


def _inspected(job: Job, folder: Path, recipe_file: str, started: float) -> tuple[Outcome, ...]:
    serial, identity = job.naming.of_name(Path(job.folder), side=folder)
    recipe = read_part_recipe(recipe_file) if recipe_file else None
    capture = read_capture(folder, threads=job.threads)
    _need_text(capture_files(capture))
    serial = job.naming.of_capture(folder, capture, serial)
    digests = [digest for _, digest in checksums((*capture_files(capture), *([Path(recipe_file)] if recipe else [])))]
    identity = with_capture(identity, capture)
    told = cache(lambda: _tell(capture, check(capture)))  # at most once, and not where the store has all
    if recipe is None or recipe.strip is None:
        return (_part(job, capture, recipe, "", serial, identity, digests, told, started),)
    places = places_of_strip(capture, recipe)
    carrier = replace(identity, substrate=identity.substrate or serial)
    outcomes = []
    for place in places:
        name, own = place_serial(serial, place.name), replace(carrier, position=place.name)
        try:
            outcomes.append(_part(job, capture, recipe, place.name, name, own, digests, told, started))
        except Exception as error:
            outcomes.append(_failed(job, name, error, started))
        started = time.perf_counter()
    return tuple(outcomes)


def _need_text(files: Iterable[Path]) -> None:
    """Raise InputError for a file whose name is no text: results are UTF-8, and name their files."""
    for path in files:
        if not is_encodable(path.name):
            msg = f"{path}: its name must be UTF-8"
            raise InputError(msg)


def _tell(capture: Capture, findings: Findings) -> tuple[str, ...]:
    """What the check of a capture says, for its results; wrong geometry is refused."""
    refuse_wrong_geometry(findings, capture.name, way_out="'bgars check' shows it")
    return told_by(findings)


def _part(
    job: Job,
    capture: Capture,
    recipe: PartRecipe | None,
    place: str,
    serial: str,
    identity: PartIdentity,
    digests: list[str],
    told: Callable[[], tuple[str, ...]],
    started: float,
) -> Outcome:
    """Inspect a part, or that at a place of a strip, unless the store has it."""
    key = key_of(digests, serial=serial, method=job.method, version=__version__)
    if key in job.known:
        return Outcome(job.folder, serial, is_known=True, seconds=time.perf_counter() - started)
    if recipe is not None and place:
        found = told()
        result = inspect_place(capture, recipe, place, method=job.method, check=False, threads=job.threads)
        result = replace(result, warnings=(*found, *result.warnings))
    else:
        tell = partial(_tell, capture)
        result = inspected(capture, recipe, tell=tell, method=job.method, threads=job.threads)
    if recipe is not None and job.content:  # as it is where the folder is seen
        given = Path(job.recipe)
        files = tuple(f._replace(name=given.name) if f.name == Path(RECIPE).name else f for f in result.files)
        result = replace(result, recipe=replace(recipe, file=given), files=files)
    result = replace(result, serial=serial, identity=identity)
    if part_key(result) != key:
        msg = f"{job.folder}: its files changed while they were read"
        return Outcome(job.folder, serial, reason=msg, seconds=time.perf_counter() - started, is_input=False)
    return Outcome(job.folder, serial, result, seconds=time.perf_counter() - started)


def _unpacked(job: Job, place: Path) -> tuple[Path, str]:
    """Write the files that came with a job; return the folder, of its own name, and the recipe."""
    folder = place / "capture" / Path(job.folder).name
    folder.mkdir(parents=True)
    recipe = ""
    for name, written, content in job.content:
        path = place / Path(RECIPE).name if name == RECIPE else folder / Path(name).name
        path.write_bytes(content)
        os.utime(path, (written, written))
        recipe = str(path) if name == RECIPE else recipe
    return folder, recipe


def _serial(job: Job) -> str:
    """The serial number as far as the name tells it; a failure is kept under it."""
    try:
        return job.naming.of_name(Path(job.folder))[0]
    except (BgarsError, OSError):
        return ""
