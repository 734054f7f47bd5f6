"""A store on disk: made, opened, appended to."""

from __future__ import annotations

import json
import math
import time
from dataclasses import replace
from datetime import datetime, timezone
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote

from bgars.errors import FileFormatError, InputError
from bgars.files.encodable import encodable
from bgars.io.parquet import need_pyarrow
from bgars.records.short import facts_table
from bgars.store.append import PARTIAL, append_rows, partition, write_durably
from bgars.store.compact import compact
from bgars.store.export import export
from bgars.store.keys import failure_key, images_key, part_key
from bgars.store.known_parts import KnownParts
from bgars.store.query import query
from bgars.store.repair import repair
from bgars.store.rows import TIME_FORM, result_rows
from bgars.store.schema import FORMAT, FORMAT_VERSION, TABLES

if TYPE_CHECKING:
    from os import PathLike

    from bgars.records.part_result import PartResult

__all__ = ["MARK", "Store", "is_store", "open_store"]

MARK = "store.json"


class Store:
    """Results of many parts in a folder; get one from :func:`open_store`.

    Several processes, on several machines that share the folder, may append at the same time.

    Attributes
    ----------
    folder : Path
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._last_sequence = 0
        self._known: KnownParts | None = None

    def __repr__(self) -> str:
        return f"Store({str(self.folder)!r})"

    def _repr_html_(self) -> str:
        """What the store holds, for notebooks; only names of folders are read, and keys once."""
        places = sorted((self.folder / "parts").glob("day=*/recipe=*"))
        days = sorted({place.parent.name.removeprefix("day=") for place in places})
        facts = {
            "folder": self.folder,
            "parts": f"{len(self.known())} (all inspections)",
            "recipes": ", ".join(sorted({unquote(place.name.removeprefix("recipe=")) for place in places})) or "none",
            "days": " to ".join(dict.fromkeys((days[0], days[-1]))) if days else "none",
        }
        return facts_table("Store", facts)

    def append(self, result: PartResult, *, capture_folder: str = "", seconds: float = math.nan) -> bool:
        """Add a result, durably and whole, unless it is there; with the round of :meth:`numbered`.

        Parameters
        ----------
        result : PartResult
            With ``inspected_utc``.
        capture_folder : str
            Where its images lie, for pages with a photograph.
        seconds : float
            What the inspection took.

        Returns
        -------
        bool
            False: the same inputs, serial, recipe, method and version are in the store.

        Raises
        ------
        FileFormatError
            It cannot be written; nothing was added then.
        InputError
            No time of inspection, or a text that is none.
        """
        key = part_key(result)
        result = self.numbered(result)
        if key in self.known():
            return False
        _raise_version(self.folder / MARK)
        folder = encodable(capture_folder)
        rows = result_rows(result, sequence=self._next_sequence(), capture_folder=folder, seconds=seconds)
        place = partition(result.inspected_utc[:10], result.name if result.recipe is not None else "")
        try:
            append_rows(self.folder, place, f"p-{key[:40]}", rows)
        except UnicodeEncodeError as error:  # half of a pair, which JSON may hold
            msg = f"result: {encodable(result.serial)}: holds characters that are no text ({error})"
            raise InputError(msg) from None
        self._parts().add(self.folder / "parts" / place / f"p-{key[:40]}.parquet", rows["parts"][0])
        return True

    def numbered(self, result: PartResult) -> PartResult:
        """Return a result with its round, unless it states one or has no serial number.

        The first inspection of a serial number under a recipe is round 1; that of other images, such as after rework,
        the next. The same images, such as with a station that was calibrated anew, are the round that they were. What
        any process appended meanwhile counts.
        """
        if result.identity.round is not None or not result.serial:
            return result
        known = self._parts()
        known.look()
        place = partition("", result.name if result.recipe is not None else "").name
        images = images_key(result.files, len(result.light_directions))
        number = known.round_of(part_key(result), result.serial, place, images)
        return replace(result, identity=replace(result.identity, round=number))

    def lot_note(self, result: PartResult) -> str:
        """Say that the serial number of a numbered result came in another lot before; "" = it did not."""
        place = partition("", result.name if result.recipe is not None else "").name
        before, lot = self._parts().last_lot(result.serial, place), result.identity.lot
        if not (result.serial and before and lot) or before == lot or (result.identity.round or 1) == 1:
            return ""
        return (
            f"{result.serial}: was in lot {before}, is in lot {lot} now, and counts as round {result.identity.round} "
            "of one part; if these are two parts, make serial numbers unique among parts of a recipe"
        )

    def append_failure(
        self, capture_folder: str, reason: str, *, serial: str = "", recipe: str = "", version: str = "", lot: str = ""
    ) -> None:
        """Keep why a capture could not be inspected; a later success hides it from queries."""
        now = datetime.now(timezone.utc)
        capture_folder, serial = encodable(capture_folder), encodable(serial)
        key = failure_key(capture_folder, serial=serial, recipe=recipe, version=version)
        row = {
            "part_key": key,
            "sequence": self._next_sequence(),
            "serial": serial,
            "lot": lot,
            "capture_folder": capture_folder,
            "failed_utc": now.replace(tzinfo=None),
            "reason": " ".join(encodable(reason).split()),
            "version": version,
        }
        place = partition(now.strftime(TIME_FORM)[:10], recipe)
        append_rows(self.folder, place, f"f-{key[:40]}", {"failures": [row]})

    def known(self) -> dict[str, str]:
        """Return the keys of all parts with their serial numbers, as of the last append or :meth:`refresh`."""
        return self._parts().serials

    def _parts(self) -> KnownParts:
        if self._known is None:
            self._known = KnownParts(self.folder)
            self._known.look()
        return self._known

    def last_sequence(self) -> int:
        """Return the largest number in the order of parts; 0 for an empty store."""
        return max(self._last_sequence, self._parts().last_sequence)

    def refresh(self) -> None:
        """Forget what is known: the next look sees what other processes appended."""
        self._known = None

    def query(self, sql: str) -> Any:  # noqa: ANN401 - pyarrow has no types
        """Return the answer of DuckDB to a question, as an Arrow table; docs/queries.md has examples.

        Raises
        ------
        InputError
            DuckDB is not installed, or refuses the question.
        """
        return query(self.folder, sql)

    def compact(self) -> dict[str, int]:
        """Join the many small files of each day and recipe; others may append meanwhile."""
        return compact(self.folder)

    def repair(self) -> dict[str, list[str]]:
        """Make damaged files again from the whole results, or set them aside; return their names.

        The keys are ``remade`` and ``set_aside``. Parts whose own file was set aside are not in the store any more, and
        can be inspected again.
        """
        done = repair(self.folder)
        self.refresh()
        return done

    def export(self, url: str) -> dict[str, int]:
        """Copy what is new to a database that SQLAlchemy knows; return how many rows each table got."""
        return export(self.folder, url)

    def _next_sequence(self) -> int:
        """Nanoseconds of the clock, but never less than what this store has seen: clocks are set back."""
        self._last_sequence = max(self._last_sequence, self._parts().last_sequence)
        self._last_sequence = max(time.time_ns(), self._last_sequence + 1)
        return self._last_sequence


def is_store(folder: str | PathLike[str]) -> bool:
    """Whether a folder is a store, of whatever version."""
    return (Path(folder) / MARK).is_file()


def open_store(folder: str | PathLike[str], *, create: bool = False) -> Store:
    """Open a store of results.

    Parameters
    ----------
    folder : path
    create : bool
        Make it where there is nothing, or an empty folder.

    Returns
    -------
    Store

    Raises
    ------
    FileFormatError
        There is none, it was written by a newer bgars, or it cannot be made.
    InputError
        pyarrow is not installed, or a folder to be made holds other files.

    Examples
    --------
    >>> import bgars, tempfile
    >>> store = bgars.open_store(tempfile.mkdtemp(), create=True)
    >>> len(store.known())
    0
    """
    need_pyarrow("store")  # whose DuckDB the next command wants
    folder = Path(folder)
    mark = folder / MARK
    if not mark.is_file():
        if not create:
            msg = f"{folder}: is not a store of bgars: it holds no {MARK}"
            raise FileFormatError(msg)
        if folder.exists() and not _is_free(folder) and not mark.is_file():
            why = "it holds other files" if folder.is_dir() else "it is a file"
            msg = f"{folder}: must be a store, an empty folder, or a new name; {why}"
            raise InputError(msg)
        heading = {"format": FORMAT, "format_version": FORMAT_VERSION, "tables": sorted(TABLES)}
        write_durably(mark, json.dumps(heading, indent=2).encode() + b"\n")
    _check_mark(mark)
    return Store(folder)


def _is_free(folder: Path) -> bool:
    """Whether a store may be made here: nothing is in it but what a process left that was killed while making one."""
    return folder.is_dir() and all(
        path.name.startswith(".") and path.name.endswith(PARTIAL) for path in folder.iterdir()
    )


def _raise_version(mark: Path) -> None:
    """Say that files of this version are in a store: an earlier bgars must not read them as its own."""
    heading = json.loads(mark.read_text(encoding="utf-8"))
    if heading["format_version"] < FORMAT_VERSION:
        write_durably(mark, json.dumps(heading | {"format_version": FORMAT_VERSION}, indent=2).encode() + b"\n")


def _check_mark(mark: Path) -> None:
    try:
        values = json.loads(mark.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        msg = f"{mark}: cannot be read ({error})"
        raise FileFormatError(msg) from error
    version = values.get("format_version") if isinstance(values, dict) and values.get("format") == FORMAT else None
    if not isinstance(version, int) or isinstance(version, bool) or version < 1:
        msg = f"{mark}: is not the mark of a store: format must be {FORMAT!r} with a whole format_version"
        raise FileFormatError(msg)
    if version > FORMAT_VERSION:
        msg = (
            f"{mark}: format_version: this bgars reads stores up to {FORMAT_VERSION}, got {version}: written by a "
            "newer bgars; install that one"
        )
        raise FileFormatError(msg)
