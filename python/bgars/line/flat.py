"""Cameras whose software writes all images into one folder: the files of a part become its folder."""

from __future__ import annotations

import re
import time
from pathlib import Path

from bgars.errors import InputError

__all__ = ["HIDDEN", "FlatFiles"]

GATHERING = ".gathering-"
HIDDEN = (".", "_")
"""How the names of folders begin that are no parts."""
NAMES = re.compile(r"\{(\w*)\}")


class FlatFiles:
    """Files whose names hold the serial number, such as ``SN42_light3.png``.

    Parameters
    ----------
    folder : Path
        The inbox.
    pattern : str
        With ``{serial}``, and ``{image}`` for what differs between the images of a part: ``{serial}_{image}.png``;
        ``{number}`` in its place takes only digits, where serial numbers contain what stands between the two.
    count : int
        Images of a part.
    settle_s : float
        How long a file must not change.

    Raises
    ------
    InputError
        A pattern without ``{serial}`` and ``{image}`` or ``{number}``.

    Attributes
    ----------
    refused : dict of str
        Files that belong to no part for certain, and why.
    """

    def __init__(self, folder: Path, pattern: str, *, count: int, settle_s: float) -> None:
        if sorted(NAMES.findall(pattern)) not in (["image", "serial"], ["number", "serial"]):
            msg = f"--files: must hold {{serial}} and {{image}} (or {{number}}) once each, got {pattern!r}"
            raise InputError(msg)
        self.folder, self.count, self.settle_s = folder, count, settle_s
        self._shortest, self._longest = _expression(pattern, "+?"), _expression(pattern, "+")
        self.refused: dict[str, str] = {}
        self._since: dict[str, tuple[tuple[int, int], float]] = {}

    def gather(self) -> list[str]:
        """Move the files of complete parts into a folder each; return their serial numbers.

        The folder gets its name when it holds all files: killed in between, the next look goes on.
        """
        ready: dict[str, list[Path]] = {}
        now = time.monotonic()
        seen = {}
        self.refused = {}
        for path in sorted(path for path in self.folder.iterdir() if path.is_file()):
            serial, problem = self._serial(path.name)
            if problem:
                self.refused[path.name] = problem
            if not serial:
                continue
            try:
                stat = path.stat()
            except FileNotFoundError:
                continue
            state = (stat.st_size, stat.st_mtime_ns)
            earlier = self._since.get(path.name)
            seen[path.name] = earlier if earlier is not None and earlier[0] == state else (state, now)
            if now - seen[path.name][1] >= self.settle_s:
                ready.setdefault(serial, []).append(path)
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

    def _serial(self, name: str) -> tuple[str, str]:
        """The serial number of a file, or why it has none for certain; "" twice: the name does not follow."""
        short, long = self._shortest.fullmatch(name), self._longest.fullmatch(name)
        if short is None or long is None:
            return "", ""
        serial = short["serial"]
        if serial != long["serial"]:
            both = f"serial number {serial} or {long['serial']}"
            return "", f"fits --files in more than one way ({both}); use {{number}}, or write what lies between"
        if serial.startswith(HIDDEN):
            return "", f"serial number {serial}: begins with {serial[0]}, as folders that are no parts"
        return serial, ""


def _expression(pattern: str, many: str) -> re.Pattern[str]:
    """A pattern whose names are as short, or as long, as they can be."""
    forms = {"serial": ".", "image": ".", "number": "[0-9]"}
    pieces = enumerate(NAMES.split(pattern))
    return re.compile("".join(f"(?P<{each}>{forms[each]}{many})" if at % 2 else re.escape(each) for at, each in pieces))
