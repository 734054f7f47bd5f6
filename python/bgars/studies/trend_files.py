"""Results of a process in the order of time."""

from __future__ import annotations

import glob
from pathlib import Path
from typing import TYPE_CHECKING

from bgars.errors import InputError
from bgars.io.given_paths import need_path
from bgars.io.result_file import RESULT_NAME, parse_result, read_result
from bgars.records.scalar_checks import check_progress
from bgars.store import is_store, open_store
from bgars.studies.alike import check_alike
from bgars.studies.study_folder import natural, subfolders

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from os import PathLike

    from bgars.records.part_result import PartResult

__all__ = ["read_results"]


def read_results(
    paths: Iterable[str | PathLike[str]], *, where: str = "", progress: Callable[[float], object] | None = None
) -> tuple[tuple[tuple[str, PartResult], ...], tuple[str, ...]]:
    """Read many results and put them into the order of time.

    Parameters
    ----------
    paths : iterable of path
        Results: ``result.json`` files, folders that hold one, folders of such folders, stores, or patterns of these.
    where : str
        Condition on the table ``parts`` of a store, such as ``"lot = 'L7'"``.
    progress : callable, optional
        Called with the fraction done.

    Returns
    -------
    results : tuple of (str, PartResult)
        Each with its path, by ``inspected_utc`` where all have one, else by the natural order of the paths.
    warnings : tuple of str

    Raises
    ------
    InputError
        No results, the same file twice, or results that do not belong together.
    FileFormatError
        A file that is no result.
    """
    check_progress(progress)
    given = [place for path in paths for place in expanded(Path(path))]
    stored = [each for path in given if is_store(path) for each in _of_store(path, where)]
    files = [file for path in given if not is_store(path) for file in _files(path)]
    if where and not any(map(is_store, given)):
        msg = f"where: goes with a store, got {where!r} without one"
        raise InputError(msg)
    if not files and not stored:
        msg = "results: must be at least one result, got none"
        raise InputError(msg)
    real = [file.resolve() for file in files]
    twice = next((file for file in files if real.count(file.resolve()) > 1), None)
    if twice is not None:
        msg = f"{twice}: is given more than once"
        raise InputError(msg)
    results = [(name, result) for name, result in stored]
    for done, file in enumerate(files):
        if progress is not None:
            progress(done / len(files))
        results.append((str(file), read_result(file)))
    if progress is not None:
        progress(1.0)
    warnings = list(check_alike(results))
    if not files and len(given) == 1:
        return tuple(results), tuple(warnings)  # a store knows the order, whatever its clocks did
    unstamped = [name for name, result in results if not result.inspected_utc]
    if unstamped:
        warnings.append(
            f"{len(unstamped)} results have no time (first: {unstamped[0]}): taken in the order of their names"
        )
        results.sort(key=lambda each: natural(each[0]))
    else:
        results.sort(key=lambda each: (each[1].inspected_utc, natural(each[0])))
    return tuple(results), tuple(warnings)


def expanded(path: Path) -> list[Path]:
    """What a pattern stands for, where the shell does not expand it; a path that is there is itself.

    Raises
    ------
    InputError
        Nothing matches.
    """
    if path.exists() or not set("*?[") & set(str(path)):
        return [path]
    found = [Path(name) for name in sorted(glob.glob(str(path)), key=natural)]  # noqa: PTH207 - absolute patterns, too
    if not found:
        msg = f"{path}: nothing matches this pattern"
        raise InputError(msg)
    return found


def _of_store(path: Path, where: str) -> list[tuple[str, PartResult]]:
    """The results of a store in the order in which they came."""
    chosen = f"where {where}" if where else ""
    sql = f"select part_key, serial, round from parts {chosen} order by sequence"
    store = open_store(path)
    wanted = store.query(sql).to_pylist()
    texts = store.query("select part_key, result_json from results").to_pylist()
    by_key = {row["part_key"]: row["result_json"] for row in texts}
    found = []
    for row in wanted:
        name = f"{path}: {row['serial']}" + (f", round {row['round']}" if row["round"] > 1 else "")
        found.append((name, parse_result(by_key[row["part_key"]].encode(), path / RESULT_NAME)))
    if not found:
        msg = f"{path}: has no parts{f' where {where}' if where else ''}"
        raise InputError(msg)
    return found


def _files(path: Path) -> list[Path]:
    need_path(path)
    if path.is_file():
        return [path]
    if (path / RESULT_NAME).is_file():
        return [path / RESULT_NAME]
    found = [place / RESULT_NAME for place in subfolders(path) if (place / RESULT_NAME).is_file()]
    if not found:
        msg = f"{path}: holds no {RESULT_NAME}, nor do the folders in it"
        raise InputError(msg)
    return found
