"""Cameras whose software writes all images into one folder: the files of a part become its folder."""

from __future__ import annotations

import re
import time
from pathlib import Path

from bgars.errors import InputError

__all__ = ["FlatFiles"]

GATHERING = ".gathering-"
NAMES = re.compile(r"\{(\w*)\}")


class FlatFiles:
    """Files whose names hold the serial number, such as ``SN42_light3.png``.

    Parameters
    ----------
    folder : Path
        The inbox.
    pattern : str
        With ``{serial}``, and ``{image}`` for what differs between the images of a part: ``{serial}_{image}.png``.
    count : int
        Images of a part.
    settle_s : float
        How long a file must not change.

    Raises
    ------
    InputError
        A pattern without ``{serial}`` and ``{image}``.
    """

    def __init__(self, folder: Path, pattern: str, *, count: int, settle_s: float) -> None:
        if sorted(NAMES.findall(pattern)) != ["image", "serial"]:
            msg = f"--files: must hold {{serial}} and {{image}} once each, got {pattern!r}"
            raise InputError(msg)
        pieces = NAMES.split(pattern)
        told = "".join(f"(?P<{piece}>.+?)" if at % 2 else re.escape(piece) for at, piece in enumerate(pieces))
        self.folder, self.count, self.settle_s = folder, count, settle_s
        self._expression = re.compile(told)
        self._since: dict[str, tuple[tuple[int, int], float]] = {}

    def gather(self) -> list[str]:
        """Move the files of complete parts into a folder each; return their serial numbers.

        The folder gets its name when it holds all files: killed in between, the next look goes on.
        """
        ready: dict[str, list[Path]] = {}
        now = time.monotonic()
        seen = {}
        for path in sorted(path for path in self.folder.iterdir() if path.is_file()):
            match = self._expression.fullmatch(path.name)
            if match is None:
                continue
            try:
                stat = path.stat()
            except FileNotFoundError:
                continue
            state = (stat.st_size, stat.st_mtime_ns)
            earlier = self._since.get(path.name)
            seen[path.name] = earlier if earlier is not None and earlier[0] == state else (state, now)
            if now - seen[path.name][1] >= self.settle_s:
                ready.setdefault(match["serial"], []).append(path)
        self._since = seen
        gathered = []
        for serial, files in ready.items():
            place = self.folder / f"{GATHERING}{serial}"
            there = {path.name for path in place.iterdir()} if place.is_dir() else set()
            if len(there | {path.name for path in files}) < self.count or (self.folder / serial).exists():
                continue
            place.mkdir(exist_ok=True)
            for path in files:
                path.replace(place / path.name)
            gathered.append(serial)
        for place in sorted(self.folder.glob(f"{GATHERING}*")):
            target = self.folder / place.name.removeprefix(GATHERING)
            if len(list(place.iterdir())) >= self.count and not target.exists():
                place.replace(target)
        return gathered
