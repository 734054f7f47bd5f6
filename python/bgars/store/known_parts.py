"""What a store knows of its parts: keys, serial numbers and rounds, read once from each of its files."""

from __future__ import annotations

import json
import os
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bgars.io.parquet import need_pyarrow
from bgars.store.keys import images_key
from bgars.store.repair import damage, need_columns

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["KnownParts"]

READ = ("part_key", "serial", "sequence", "inspected_utc", "round", "images_sha256", "lot")
SETTLED_NS = 10_000_000_000
"""Age of a folder's time from which it tells changes: file systems count it in steps, and clocks differ."""


class KnownParts:
    """Parts of a store, as far as its files were read.

    Attributes
    ----------
    serials : dict of str
        Serial number by key.
    last_sequence : int
        Largest number in the order of parts.
    """

    def __init__(self, folder: Path) -> None:
        self.serials: dict[str, str] = {}
        self.last_sequence = 0
        self._folder = folder
        # There may be millions of parts: numbers stand for names, and only rounds that are not the first are kept.
        self._last_round: dict[int, int] = {}
        self._last_lot: dict[int, str] = {}
        self._later: dict[str, int] = {}
        self._round_of_images: dict[int, int] = {}
        self._without_images: list[tuple[str, str]] = []
        self._times_ns: dict[str, int] = {}
        self._read: set[int] = set()

    def look(self) -> None:
        """Read the files that came since the last look, from whatever process.

        Raises
        ------
        FileFormatError
            A file is damaged.
        """
        rows = []
        for path, recipe in self._new_files():
            of_file = _rows(path, recipe)
            if any(row["images_sha256"] is None for row in of_file):
                self._without_images.append((path, recipe))
            rows += of_file
        # A part of an earlier bgars has no round; then its place in time tells it, as in the view.
        for row in sorted(rows, key=lambda row: (row["inspected_utc"], row["sequence"])):
            self._add(row)

    def add(self, path: Path, row: dict[str, Any]) -> None:
        """Take in a part that this process wrote."""
        self._read.add(hash(str(path)))
        self._add({**row, "recipe": path.parent.name})

    def round_of(self, key: str, serial: str, recipe: str, images: str) -> int | None:
        """Return the round of a part: that of its images, else the next of its serial number; None without one.

        Parameters
        ----------
        key, serial, recipe : str
            The recipe as the folder that it has in the store.
        images : str
            Key of its images alone; "" = not known.
        """
        if not serial:
            return None
        if key in self.serials:
            return self._later.get(key, 1)
        last = self._last_round.get(hash((serial, recipe)), 0)
        if last and images:
            self._read_images()
            return self._round_of_images.get(hash((serial, recipe, images)), last + 1)
        return last + 1

    def last_lot(self, serial: str, recipe: str) -> str:
        """Return the lot that a serial number came in last; "" where it is not known."""
        return self._last_lot.get(hash((serial, recipe)), "")

    def _read_images(self) -> None:
        """Take from the whole results, when it is needed first, what files of an earlier bgars have no column for."""
        while self._without_images:
            path, recipe = self._without_images.pop()
            for row in _rows(path, recipe, ("part_key", "serial", "images_sha256", "result_json")):
                if row["images_sha256"] is None and row["serial"]:
                    result = json.loads(row["result_json"])
                    files = [(file["name"], file["sha256"]) for file in result["files"]]
                    images = images_key(files, len(result["light_directions"]))
                    number = self._later.get(row["part_key"], 1)
                    self._round_of_images.setdefault(hash((row["serial"], recipe, images)), number)

    def _add(self, row: dict[str, Any]) -> None:
        key, serial = row["part_key"], row["serial"]
        self.last_sequence = max(self.last_sequence, row["sequence"])
        if key in self.serials:  # compaction wrote it again
            return
        images = row["images_sha256"] or ""
        number = row["round"] or self.round_of(key, serial, row["recipe"], images)
        self.serials[key] = serial
        if number is None:
            return
        place = hash((serial, row["recipe"]))
        self._last_round[place] = max(self._last_round.get(place, 0), number)
        if row["lot"]:
            self._last_lot[place] = sys.intern(row["lot"])
        if images:
            self._round_of_images.setdefault(hash((serial, row["recipe"], images)), number)
        if number > 1:
            self._later[key] = number

    def _new_files(self) -> Iterator[tuple[str, str]]:
        """Files that were not read yet, and the folder of their recipe."""
        for day in _folders(self._folder / "parts"):
            for place in _folders(Path(day.path)):
                try:
                    changed_ns = place.stat().st_mtime_ns
                    if self._times_ns.get(place.path) == changed_ns:
                        continue
                    settled = time.time_ns() - changed_ns > SETTLED_NS
                    with os.scandir(place.path) as entries:
                        names = [entry.path for entry in entries if entry.name.endswith(".parquet")]
                except FileNotFoundError:
                    continue
                for path in names:
                    if hash(path) not in self._read:
                        self._read.add(hash(path))
                        yield path, place.name
                if settled:
                    self._times_ns[place.path] = changed_ns


def _folders(folder: Path) -> list[os.DirEntry[str]]:
    try:
        with os.scandir(folder) as entries:
            return sorted((entry for entry in entries if entry.is_dir()), key=lambda entry: entry.name)
    except FileNotFoundError:
        return []


def _rows(path: str, recipe: str, columns: tuple[str, ...] = READ) -> list[dict[str, Any]]:
    _, parquet = need_pyarrow()
    try:
        with parquet.ParquetFile(path) as file:
            need_columns(file.schema_arrow.names)
            # Files of an earlier bgars have no rounds, or no checksum of the images.
            there = [name for name in columns if name in file.schema_arrow.names]
            rows: list[dict[str, Any]] = file.read(there).to_pylist()
    except FileNotFoundError:  # gone into a compacted file, which is read, or a second copy of it
        return []
    except (OSError, ValueError) as error:
        raise damage(Path(path), error) from error
    return [{"round": None, "images_sha256": None, **row, "recipe": recipe} for row in rows]
