"""Which parts in an inbox are complete, told by looking: network drives send no events, and clocks are set."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass
from pathlib import Path

from bgars.errors import InputError
from bgars.line.flat import HIDDEN, FlatFiles
from bgars.line.folders import IMAGES

__all__ = ["HIDDEN", "Inbox", "Waiting"]

Signature = tuple[tuple[str, int, int], ...]
LOOSE_S = 2.0
"""How long images may lie beside the folders: software that makes a folder and moves them into it takes less."""


@dataclass
class Waiting:
    """A part that lies in the inbox.

    Attributes
    ----------
    folder : Path
    signature : tuple
        Name, size and time of each of its files: what must not change.
    since_s : float
        Since when it has not changed, by a clock that nobody sets.
    first_s : float
        When it was seen first.
    """

    folder: Path
    signature: Signature
    since_s: float
    first_s: float

    @property
    def images(self) -> int:
        """Image files; masks and dark frames count, too."""
        return sum(Path(name).suffix.lower() in IMAGES for name, _, _ in self.signature)


class Inbox:
    """An inbox whose folders are parts.

    Parameters
    ----------
    folder : Path
    count : int or None
        Images of a complete part; None: it is complete when nothing changes.
    trigger : str
        Name of a file that the camera's software writes last; "" = there is none.
    settle_s : float
        How long nothing may change, where there is no trigger.
    files : str
        Pattern of files that lie in the inbox itself, see :class:`bgars.line.flat.FlatFiles`; "" = parts are folders.

    Raises
    ------
    InputError
        A pattern without its names, or without a count; a trigger that is a path.
    """

    def __init__(self, folder: Path, *, count: int | None, trigger: str, settle_s: float, files: str = "") -> None:
        self.folder = folder
        self.count = count
        self.trigger = trigger
        self.settle_s = settle_s
        if files and count is None:
            msg = "--files: goes with --count, which tells when a part is complete"
            raise InputError(msg)
        if trigger != Path(trigger).name or trigger in {".", ".."}:
            msg = f"--trigger: must be the name of a file in the folder of a part, got {trigger!r}"
            raise InputError(msg)
        self.flat = FlatFiles(folder, files, count=count, settle_s=settle_s) if files and count else None
        self._waiting: dict[str, Waiting] = {}
        self._loose_s: dict[str, float] = {}

    def look(self) -> list[Waiting]:
        """Return the parts that lie there, oldest first by when they were seen; entries that vanish are skipped.

        Raises
        ------
        OSError
            The inbox itself cannot be read, such as on a network drive that is away.
        """
        if self.flat is not None:
            self.flat.gather()
        now = time.monotonic()
        found: dict[str, Waiting] = {}
        with os.scandir(self.folder) as entries:
            shown = [entry for entry in entries if not entry.name.startswith(HIDDEN)]
        folders = [entry for entry in shown if _is_folder(entry)]
        images = {entry.name for entry in shown if Path(entry.name).suffix.lower() in IMAGES}
        images -= {entry.name for entry in folders}
        images |= set() if self.flat is None else self.flat.refused.keys()
        self._loose_s = {name: self._loose_s.get(name, now) for name in images}
        for entry in sorted(folders, key=lambda entry: entry.name):
            signature = _signature(Path(entry.path))
            if signature is None:
                continue
            earlier = self._waiting.get(entry.name)
            if earlier is not None and earlier.signature == signature:
                found[entry.name] = earlier
            else:
                first = now if earlier is None else earlier.first_s
                found[entry.name] = Waiting(Path(entry.path), signature, now, first)
        self._waiting = found
        return sorted(found.values(), key=lambda part: part.first_s)

    def loose(self, patience_s: float) -> str:
        """What images wait for that have lain in the inbox itself for a while, in words; "" = there are none.

        With a pattern of files they may be waiting for others of their part, as long as `patience_s`.
        """
        refused = {} if self.flat is None else self.flat.refused
        soon_s, now = max(self.settle_s, LOOSE_S), time.monotonic()
        lain_s = {name: now - since_s for name, since_s in sorted(self._loose_s.items())}
        names = [name for name in lain_s if name in refused and lain_s[name] >= soon_s]
        if names:
            images = f"{len(names)} images" if len(names) > 1 else "1 image"
            return f"{images} not taken, such as {names[0]}: {refused[names[0]]}"
        least_s = soon_s if self.flat is None else patience_s
        names = [name for name in lain_s if lain_s[name] >= least_s]
        if not names:
            return ""
        images = f"{len(names)} images" if len(names) > 1 else "1 image"
        told = f"{images} not in the folder of a part, such as {names[0]}"
        if self.flat is None:
            return f"{told}: waiting for a folder, or give --files '{{serial}}_{{image}}.png' and --count"
        return f"{told}: waiting for --count {self.count} images of one serial number whose names follow --files"

    def is_complete(self, part: Waiting) -> bool:
        """Whether a part can be taken."""
        if self.count is not None and part.images < self.count:
            return False
        if self.trigger:
            return any(name == self.trigger for name, _, _ in part.signature)
        return part.images > 0 and time.monotonic() - part.since_s >= self.settle_s

    def is_unchanged(self, part: Waiting) -> bool:
        """Whether a part is as it was when it was looked at."""
        return _signature(part.folder) == part.signature

    def missing(self, part: Waiting) -> str:
        """What a part waits for, in words."""
        if self.count is not None and part.images < self.count:
            return f"{part.images} of {self.count} images"
        if self.trigger and not any(name == self.trigger for name, _, _ in part.signature):
            return f"no {self.trigger}"
        return "no images" if not part.images else "still changing"


def _is_folder(entry: os.DirEntry[str]) -> bool:
    try:
        return entry.is_dir()
    except OSError:
        return False


def _signature(folder: Path) -> Signature | None:
    """Name, size and time of each file; None where the folder or a file vanishes meanwhile."""
    try:
        with os.scandir(folder) as entries:
            stats = [(entry.name, entry.stat()) for entry in entries]
    except OSError:
        return None
    return tuple(sorted((name, stat.st_size, stat.st_mtime_ns) for name, stat in stats))
