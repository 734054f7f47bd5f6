"""Results of a process in the order of time."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from bgars.errors import InputError
from bgars.io.given_paths import need_path
from bgars.io.result_file import RESULT_NAME, read_result
from bgars.studies.alike import check_alike
from bgars.studies.study_folder import natural, subfolders

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from os import PathLike

    from bgars.part_result import PartResult

__all__ = ["read_results"]


def read_results(
    paths: Iterable[str | PathLike[str]], *, progress: Callable[[float], object] | None = None
) -> tuple[tuple[tuple[str, PartResult], ...], tuple[str, ...]]:
    """Read many results and put them into the order of time.

    Parameters
    ----------
    paths : iterable of path
        Results: ``result.json`` files, folders that hold one, or folders of such folders.
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
    files = [file for path in paths for file in _files(Path(path))]
    if not files:
        msg = "results: must be at least one result, got none"
        raise InputError(msg)
    real = [file.resolve() for file in files]
    twice = next((file for file in files if real.count(file.resolve()) > 1), None)
    if twice is not None:
        msg = f"{twice}: is given more than once"
        raise InputError(msg)
    results = []
    for done, file in enumerate(files):
        if progress is not None:
            progress(done / len(files))
        results.append((str(file), read_result(file)))
    if progress is not None:
        progress(1.0)
    warnings = list(check_alike(results))
    unstamped = [name for name, result in results if not result.inspected_utc]
    if unstamped:
        warnings.append(
            f"{len(unstamped)} results have no time (first: {unstamped[0]}): taken in the order of their names"
        )
        results.sort(key=lambda each: natural(each[0]))
    else:
        results.sort(key=lambda each: (each[1].inspected_utc, natural(each[0])))
    return tuple(results), tuple(warnings)


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
