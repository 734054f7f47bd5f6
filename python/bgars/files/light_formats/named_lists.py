"""Which image, and which number, a light has in JSON or MATLAB: in its own entry, or in a list beside the lights."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from bgars.errors import FileFormatError
from bgars.files.image_endings import are_image_names
from bgars.files.light_formats.headed import INDICES, NAMES, SORTED
from bgars.files.safe_files import shown

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from bgars.files.light_formats.table import LightTable

__all__ = ["names_in", "order_of", "with_lists"]

LISTS_OF_FILES = ("filenames", "file_names", "files", "images", "image_names")
"""Whatever they hold: names without an ending, too, are found."""
SHOWN = 6


def names_in(entries: Sequence[Any]) -> tuple[str, ...]:
    """Image of each light, where every entry has it: under one key that holds images, or under a usual one.

    Examples
    --------
    >>> names_in([{"Foto": "b.png", "name": "left"}, {"Foto": "a.png", "name": "right"}])
    ('b.png', 'a.png')
    """
    dicts = [entry for entry in entries if isinstance(entry, dict)]
    if not dicts or len(dicts) != len(entries):
        return ()
    columns = {key: [entry.get(key) for entry in dicts] for key in dicts[0]}
    holding = [column for column in columns.values() if are_image_names(column)]
    called = [column for key in NAMES if (column := columns.get(key)) and all(isinstance(name, str) for name in column)]
    both = [column for column in called if column in holding]
    return tuple(str(name) for name in next(iter((*both, *holding, *called)), []))


def order_of(entries: Sequence[Any]) -> tuple[list[int], tuple[str, ...]]:
    """Places of entries by their numbers, where these count from 0 or 1, else as they stand; and what is to be said.

    Examples
    --------
    >>> order_of([{"id": 2, "z": 0.5}, {"id": 1, "z": 0.6}])
    ([1, 0], ('lights sorted by their numbers',))
    """
    places = list(range(len(entries)))
    dicts = [entry for entry in entries if isinstance(entry, dict)]
    key = next((key for key in dicts[0] if str(key).lower() in INDICES), None) if dicts else None
    numbers = [entry.get(key) for entry in dicts]
    if key is None or len(dicts) != len(entries):
        return places, ()
    whole = [number for number in numbers if isinstance(number, int) and not isinstance(number, bool)]
    if sorted(whole) not in (places, [place + 1 for place in places]):
        some = shown(", ".join(str(number) for number in numbers[:SHOWN]))
        return places, (f"{key} is not used ({some}, ...): lights taken in the order of the file",)
    order = sorted(places, key=whole.__getitem__)
    return order, (SORTED,) if order != places else ()


def with_lists(table: LightTable, others: Mapping[str, Any], path: Path) -> LightTable:
    """A table with the files that a list beside its lights names; other lists of as many values are told.

    Raises
    ------
    FileFormatError
        A list of image files of another length.
    """
    count = len(table.vectors)
    lists = {key: _strings(value) for key, value in others.items() if isinstance(value, list | tuple)}
    files = {key: names for key, names in lists.items() if _are_files(key, names)}
    used = next(iter(files), None) if not table.files else None
    if used is not None and len(files[used]) != count:
        msg = f"{path}: {used} names {len(files[used])} images, but there are {count} lights"
        raise FileFormatError(msg)
    left = [shown(key) for key, value in others.items() if key != used and _has_length(value, count)]
    notes = table.notes
    if left:
        notes = (*notes, f"lists of {count} values that are not used: {', '.join(left[:SHOWN])}")
    return replace(table, files=files[used] if used is not None else table.files, notes=notes)


def _are_files(key: str, names: tuple[str, ...]) -> bool:
    return are_image_names(names) or (key.lower() in LISTS_OF_FILES and bool(names))


def _strings(values: Sequence[Any]) -> tuple[str, ...]:
    """Strings of a list, or the images that its entries name; none where it holds anything else."""
    if values and all(isinstance(value, str) for value in values):
        return tuple(values)
    return names_in(values)


def _has_length(value: Any, count: int) -> bool:  # noqa: ANN401 - whatever a file held
    return isinstance(value, list | tuple) and len(value) == count
