"""One capture, inspected in whatever process has time: what goes in, and what comes out."""

from __future__ import annotations

import os
import tempfile
import time
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

from bgars.errors import BgarsError
from bgars.io.capture import read_capture
from bgars.io.part_recipe import read_part_recipe
from bgars.io.provenance import capture_files, checksums
from bgars.line.naming import Naming, last_written_utc
from bgars.normals.methods import DEFAULT_METHOD, Method
from bgars.pipelines.check import check, refuse_wrong_geometry, told_by
from bgars.pipelines.inspect import inspect
from bgars.store.keys import key_of, part_key

if TYPE_CHECKING:
    from bgars.records.part_result import PartResult

__all__ = ["Job", "Outcome", "run_job", "with_content"]


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
    """What became of a job.

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


def run_job(job: Job) -> Outcome:
    """Inspect a capture; every failure is an outcome."""
    started = time.perf_counter()
    serial = ""
    try:
        if job.content:
            with tempfile.TemporaryDirectory(prefix="bgars-job-") as place:
                return _inspected(job, *_unpacked(job, Path(place)), started)
        return _inspected(job, Path(job.folder), job.recipe, started)
    except (BgarsError, OSError) as error:
        reason, is_input = str(error), isinstance(error, BgarsError)
    except Exception as error:
        reason, is_input = f"unexpected {type(error).__name__}: {error}", False
    serial = _serial(job)
    seconds = time.perf_counter() - started
    return Outcome(job.folder, serial, reason=" ".join(reason.split()), seconds=seconds, is_input=is_input)


def _inspected(job: Job, folder: Path, recipe_file: str, started: float) -> Outcome:
    serial, identity = job.naming.of_name(Path(job.folder), side=folder)
    recipe = read_part_recipe(recipe_file) if recipe_file else None
    capture = read_capture(folder, threads=job.threads)
    serial = job.naming.of_capture(folder, capture, serial)
    digests = [digest for _, digest in checksums((*capture_files(capture), *([Path(recipe_file)] if recipe else [])))]
    key = key_of(digests, serial=serial, method=job.method, version=version("bgars"))
    if key in job.known:
        return Outcome(job.folder, serial, is_known=True, seconds=time.perf_counter() - started)
    findings = check(capture)
    refuse_wrong_geometry(findings, capture.name, way_out="'bgars check' shows it")
    result = inspect(capture, recipe, method=job.method, threads=job.threads, check=False)
    result = replace(result, warnings=(*told_by(findings), *result.warnings))
    identity = replace(identity, captured_utc=last_written_utc(capture))
    if recipe is not None and job.content:  # as it is where the folder is seen
        given = Path(job.recipe)
        recipe = replace(recipe, file=given)
        files = tuple(f._replace(name=given.name) if f.name == Path(RECIPE).name else f for f in result.files)
        result = replace(result, recipe=recipe, files=files)
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
