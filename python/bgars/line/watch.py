"""Parts as they come into a folder: each inspected once, none lost, whatever happens in between."""

from __future__ import annotations

import shutil
import time
from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import datetime, timezone
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bgars.errors import BgarsError, FileFormatError, InputError
from bgars.files.encodable import encodable
from bgars.io.part_recipe import read_part_recipe
from bgars.io.recipe import RECIPE_NAME, read_recipe
from bgars.io.station_file import read_station
from bgars.line.batch import now_utc, store_outcome
from bgars.line.inbox import HIDDEN, Inbox, Waiting
from bgars.line.job import Job, Outcome, run_job
from bgars.line.naming import Naming
from bgars.line.notify import Notifier, failure_message, message
from bgars.normals.methods import DEFAULT_METHOD, Method
from bgars.records.result_text import error_line
from bgars.version import __version__

if TYPE_CHECKING:
    from collections.abc import Callable

    from bgars.records.part_result import PartResult
    from bgars.store import Store

__all__ = ["Watch", "need_outside"]

DONE, FAILED = "done", "failed"
LONGEST_PAUSE_S = 30.0
"""Between two tries to write a result where the disk is full or away."""
CLOCK_SLACK_S = 2.0


@dataclass
class Watch:
    """What is watched, and how; :meth:`step` looks once, :meth:`run` until it is stopped.

    Attributes
    ----------
    inbox : Inbox
    store : Store
    recipe : Path or None
    rig : Path or None
        A capture.toml (or a folder with one and the files that it names) for parts that come without one.
    done, failed : Path
        Where parts go.
    patience_s : float
        How long an incomplete part, or one that cannot be read, may stay as it is before it is moved to `failed`.
    """

    inbox: Inbox
    store: Store
    recipe: Path | None = None
    rig: Path | None = None
    done: Path = field(default_factory=Path)
    failed: Path = field(default_factory=Path)
    method: Method = DEFAULT_METHOD
    naming: Naming = field(default_factory=Naming)
    notifier: Notifier = field(default_factory=Notifier)
    patience_s: float = 60.0
    poll_s: float = 0.2
    threads: int | None = None
    say: Callable[[str], object] = print
    is_stopping: bool = False
    parts: int = 0
    _pause_s: float = 0.0
    _tries: int = 0
    _name: str = ""
    _problem: str = ""
    _rig_file: Path = field(default_factory=Path)
    _stations: set[str] = field(default_factory=set)
    _loose_told: bool = False
    _refused: dict[str, tuple[object, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Look at everything that can be wrong before the first part."""
        if self.recipe is not None:
            self._name = read_part_recipe(self.recipe).name
        if self.rig is not None:
            self._rig_file = self.rig / RECIPE_NAME if self.rig.is_dir() else self.rig
            self._stations = _station(self._rig_file)
        need_outside(self.inbox.folder, self.done, self.failed)
        for place in (self.done, self.failed):
            try:
                place.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                msg = f"{place}: cannot be made ({error.strerror})"
                raise FileFormatError(msg) from error
            if place.stat().st_dev != self.inbox.folder.stat().st_dev:
                msg = f"{place}: must be on the drive of {self.inbox.folder}: parts are renamed into it, never copied"
                raise InputError(msg)
        self._warn_of_clock()

    def run(self, *, most: int | None = None) -> None:
        """Watch until :attr:`is_stopping`, or so many parts were taken; the part at hand is always finished."""
        while not self.is_stopping and (most is None or self.parts < most):
            if not self.step():
                end = time.monotonic() + (self._pause_s or self.poll_s)
                while not self.is_stopping and (left := end - time.monotonic()) > 0:
                    time.sleep(min(left, self.poll_s))

    def step(self) -> bool:
        """Look once and take every part that is complete; return whether there was one."""
        try:
            waiting = self.inbox.look()
        except OSError as error:
            self._problem_once(f"{self.inbox.folder}: cannot be read ({error.strerror or error}); tried again")
            return False
        self._tell_loose()
        taken, self._pause_s = 0, 0.0
        for part in waiting:
            if self.is_stopping or self._pause_s:
                break
            if self.inbox.is_complete(part):
                if not self._waits(part) and self.inbox.is_unchanged(part):
                    taken += self._take(part)
            elif time.monotonic() - part.since_s > self.patience_s:
                reason = f"incomplete: {self.inbox.missing(part)}, and nothing new for {self.patience_s:g} s"
                taken += self._reject(part, (Outcome(str(part.folder), self._serial(part.folder), reason=reason),))
        return taken > 0

    def _tell_loose(self) -> None:
        """Say once what images wait for that lie in the inbox beside the folders of the parts."""
        stuck = self.inbox.loose(self.patience_s)
        if stuck and not self._loose_told:
            self.say(f"{self.inbox.folder}: {stuck}")
        self._loose_told = bool(stuck)

    def _take(self, part: Waiting) -> bool:
        """Inspect a part where it lies, keep its result, tell it, and only then move the part."""
        with suppress(OSError):  # what fails here fails in the inspection, with words
            self._add_rig(part.folder)
        job = Job(
            str(part.folder),
            "" if self.recipe is None else str(self.recipe),
            self.method,
            self.naming,
            threads=self.threads,
        )
        outcomes = run_job(job)
        if all(outcome.result is None for outcome in outcomes):
            if (away := self._away(part.folder)) is not None:
                self._problem_once(f"{away}; {part.folder.name} stays in the inbox, tried again")
                self._back_off()
                return False
            now = time.monotonic()
            seen, since = self._refused.setdefault(part.folder.name, (part.signature, now))
            if seen != part.signature:  # it goes on changing: half-written before
                self._refused[part.folder.name] = (part.signature, now)
            elif now - since >= self.patience_s or (self.inbox.trigger and all(each.is_input for each in outcomes)):
                return self._reject(part, outcomes)
            return False
        with suppress(BgarsError, OSError):
            self._stations |= _station(part.folder / RECIPE_NAME)
        place = self._free(self.done, part.folder.name)
        kept = self._keep(part, outcomes, place)
        if kept is None:
            return False
        for outcome, new in zip(outcomes, kept, strict=True):
            if outcome.result is None:
                self._tell_failure(outcome, place)
                continue
            result = new or replace(self.store.numbered(outcome.result), inspected_utc=now_utc())
            if new is None:
                self.say(f"{part.folder.name}: the store had it; reported and moved again")
            self._tell(outcome, message(result, place), result.summary_line())
        return self._move(part, place)

    def _away(self, folder: Path) -> str | None:
        """Which file of the line, not of the part, cannot be read now: recipe, rig, or a station that could be read."""
        try:
            if self.recipe is not None:
                read_part_recipe(self.recipe)
            if self.rig is not None and not (folder / RECIPE_NAME).exists():
                read_recipe(self._rig_file)
        except (BgarsError, OSError) as error:
            return " ".join(str(error).split())
        try:
            stations = _station(folder / RECIPE_NAME) & self._stations
        except (BgarsError, OSError):  # the part's own
            return None
        try:
            for station in stations:
                read_station(folder / station)
        except (BgarsError, OSError) as error:
            return " ".join(str(error).split())
        return None

    def _reject(self, part: Waiting, outcomes: tuple[Outcome, ...]) -> bool:
        """Keep why a part could not be inspected, and move it to the failed ones."""
        place = self._free(self.failed, part.folder.name)
        if self._keep(part, outcomes, place) is None:
            return False
        for outcome in outcomes:
            self._tell_failure(outcome, place)
        return self._move(part, place)

    def _keep(self, part: Waiting, outcomes: tuple[Outcome, ...], place: Path) -> list[PartResult | None] | None:
        """Bring what became of a part, or of those of a strip, to the disk; None: it cannot be written now."""
        lot = self.naming.common.lot
        try:
            kept = [
                store_outcome(outcome, self.store, recipe=self._name, lot=lot, moved_to=place, say=self.say)
                for outcome in outcomes
            ]
        except BgarsError as error:
            self._problem_once(f"{error}; {part.folder.name} stays in the inbox, tried again")
            self._back_off()
            return None
        self._tries, self._problem = 0, ""
        return kept

    def _tell(self, outcome: Outcome, values: dict[str, Any], line: str) -> None:
        for problem in self.notifier.send(values, line):
            self.say(f"{outcome.serial or Path(outcome.folder).name}: {problem}")
        self.say(f"{line} seconds={outcome.seconds:.2f}")

    def _tell_failure(self, outcome: Outcome, place: Path) -> None:
        capture, now = encodable(Path(outcome.folder).name), now_utc()
        told = {"serial": outcome.serial, "reason": outcome.reason, "part": self._name or capture}
        values = failure_message(
            folder=Path(encodable(str(place))), identity=self.naming.common, inspected_utc=now, **told
        )
        self._tell(outcome, values, error_line(time=now, capture=capture, version=__version__, **told))

    def _move(self, part: Waiting, place: Path) -> bool:
        """Rename a part out of the inbox; where that fails it stays, and the store knows it when it is met again."""
        try:
            place.parent.mkdir(parents=True, exist_ok=True)
            part.folder.rename(place)
        except OSError as error:
            self._problem_once(f"{part.folder}: cannot be moved to {place} ({error.strerror}); tried again")
            self._refused[part.folder.name] = (part.signature, time.monotonic())
            self._back_off()
            return False
        self._refused.pop(part.folder.name, None)
        self.parts += 1
        return True

    def _waits(self, part: Waiting) -> bool:
        """Whether a part that could not be read just now is to be left alone for a while."""
        seen = self._refused.get(part.folder.name)
        return seen is not None and seen[0] == part.signature and time.monotonic() - seen[1] < self.patience_s

    def _free(self, folder: Path, name: str) -> Path:
        """A place by day that nothing lies at: a part that comes again under its name overwrites nothing."""
        day = folder / datetime.now(timezone.utc).strftime("%Y-%m-%d")
        place, number = day / name, 2
        while place.exists():
            place, number = day / f"{name}.{number}", number + 1
        return place

    def _add_rig(self, folder: Path) -> None:
        """Give a part that came without a description that of the rig, whole or not at all."""
        if self.rig is None or (folder / RECIPE_NAME).exists():
            return
        source = self.rig if self.rig.is_dir() else self.rig.parent
        files = [path for path in source.iterdir() if path.is_file()] if self.rig.is_dir() else [self.rig]
        for path in sorted(files, key=lambda path: path.name == RECIPE_NAME):  # the description last
            name = RECIPE_NAME if path == self.rig else path.name
            temporary = folder / f".{name}.partial"
            shutil.copyfile(path, temporary)
            temporary.replace(folder / name)

    def _serial(self, folder: Path) -> str:
        try:
            return self.naming.of_name(folder)[0]
        except (BgarsError, OSError):
            return encodable(folder.name)

    def _problem_once(self, text: str) -> None:
        """Say what is wrong when it begins, and not at every look."""
        if text != self._problem:
            self._problem = text
            self.say(text)

    def _back_off(self) -> None:
        """Wait longer after every try that fails."""
        self._pause_s = min(LONGEST_PAUSE_S, 2.0**self._tries)
        self._tries = min(self._tries + 1, 8)

    def _warn_of_clock(self) -> None:
        last_ns = self.store.last_sequence()
        behind_s = last_ns / 1e9 - time.time()
        if behind_s > CLOCK_SLACK_S:
            self.say(
                f"clock: it is {behind_s:.0f} s before the last part of {self.store.folder}; times of inspection "
                "follow the clock, the order of parts does not"
            )


def _station(description: Path) -> set[str]:
    """The station that a capture.toml names, as it is written there."""
    named = read_recipe(description).station
    return set() if named is None else {named}


def need_outside(inbox: Path, *places: Path) -> None:
    """Raise InputError where a folder of the watch lies in the inbox: there it would be taken for a part, and moved.

    Folders whose names begin with a dot or underscore are no parts.
    """
    root = inbox.resolve()
    for place in places:
        path = place.resolve()
        if path == root or (root in path.parents and not path.relative_to(root).parts[0].startswith(HIDDEN)):
            msg = f"{place}: would be taken for a part, as every folder in {inbox}; name another, such as {inbox}/_name"
            raise InputError(msg)
