"""The folders of a gauge study: FOLDER/part/placement/repeat, each repeat a finished result or a capture."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from bgars.errors import BgarsError, CalibrationError, FileFormatError, InputError
from bgars.io.capture import read_capture
from bgars.io.given_paths import need_folder
from bgars.io.part_recipe import read_part_recipe
from bgars.io.result_file import RESULT_NAME, read_result
from bgars.normals.methods import DEFAULT_METHOD, Method
from bgars.pipelines.inspect import inspect
from bgars.records.part_recipe import PartRecipe
from bgars.records.scalar_checks import check_progress
from bgars.records.short import Short
from bgars.studies.alike import check_alike

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from os import PathLike

    from bgars.records.part_result import PartResult

__all__ = ["Run", "Study", "natural", "read_study", "subfolders", "write_single_results"]

CAPTURE_SIGNS = ("capture.toml", "light_directions.txt", "*.lp")
LEVELS = ("repeat", "part/repeat", "part/placement/repeat")
ONLY = "1"
"""Name of the part or placement where the folders have none."""
MIN_REPEATS = 2
STAGES = {"find": (0.0, 0.4), "measure": (0.4, 0.95), "judge": (0.95, 1.0)}
"""About where in an inspection each of its stages begins and ends."""


@dataclass(frozen=True)
class Run:
    """One measurement of a part.

    Attributes
    ----------
    part, placement, repeat : str
        Names of its folders.
    path : Path
    result : PartResult
    """

    part: str
    placement: str
    repeat: str
    path: Path
    result: PartResult


@dataclass(frozen=True, repr=False)
class Study(Short):
    """A balanced crossed design: every part in every placement, equally often.

    Attributes
    ----------
    folder : Path
    parts, placements : tuple of str
    repeats : int
    runs : tuple of Run
        Part by part, placement by placement.
    warnings : tuple of str
    inspected : bool
        True where the runs were captures, and their results exist only here.
    """

    folder: Path
    parts: tuple[str, ...]
    placements: tuple[str, ...]
    repeats: int
    runs: tuple[Run, ...]
    warnings: tuple[str, ...]
    inspected: bool = False

    @property
    def recipe(self) -> PartRecipe | None:
        """What all runs were judged by."""
        return self.runs[0].result.recipe


def read_study(
    folder: str | PathLike[str],
    recipe: PartRecipe | str | PathLike[str] | None = None,
    *,
    method: Method = DEFAULT_METHOD,
    progress: Callable[[float], object] | None = None,
) -> Study:
    """Read the results of a gauge study; inspect what is a capture.

    Parameters
    ----------
    folder : path
        ``part/placement/repeat``, ``part/repeat`` (one placement) or ``repeat`` (one part). A repeat is a folder with
        a ``result.json``, else a capture folder. Names sort with their numbers: 2 before 10.
    recipe : PartRecipe or path, optional
        For captures; results bring their own.
    method : str
        Estimator of the normals, for captures.
    progress : callable, optional
        Called with the fraction done, also while a capture is inspected.

    Returns
    -------
    Study

    Raises
    ------
    InputError
        An empty folder, folders of different depth, too few repeats, a design that is not balanced, a recipe given
        for results, or results that do not belong together; the folder is named.
    FileFormatError
        A file that cannot be read.
    CalibrationError
        A capture that cannot be measured: the study fails, no run is left out silently.
    """
    check_progress(progress)
    folder = Path(folder)
    places = _places(folder)
    finished = [path for _, path in places if (path / RESULT_NAME).is_file()]
    if recipe is not None and finished:
        msg = f"{finished[0]}: holds a finished result, which brings its own recipe; give a recipe for captures only"
        raise InputError(msg)
    if finished and len(finished) < len(places):
        first = next(path for _, path in places if path not in finished)
        msg = f"{first}: is a capture, but {finished[0]} is a finished result; a study must hold one kind"
        raise InputError(msg)
    parts, placements, repeats = _design(folder, [names for names, _ in places])
    if recipe is not None and not isinstance(recipe, PartRecipe):
        recipe = read_part_recipe(recipe)
    runs = []
    for done, (names, path) in enumerate(places):

        def report(fraction: float, done: int = done) -> None:
            if progress is not None:
                progress((done + fraction) / len(places))

        report(0.0)
        runs.append(Run(*names, path, read_result(path) if finished else _inspected(path, recipe, method, report)))
    if progress is not None:
        progress(1.0)
    warnings = check_alike([(str(run.path), run.result) for run in runs])
    return Study(folder, parts, placements, repeats, tuple(runs), warnings, inspected=not finished)


def write_single_results(study: Study, folder: Path) -> None:
    """Write the result of every run into folders named as those of the study: :func:`read_study` reads them again.

    Raises
    ------
    FileFormatError
        Nothing can be written there.
    """
    for run in study.runs:
        place = folder / run.path.relative_to(study.folder)
        try:
            place.mkdir(parents=True)
            (place / RESULT_NAME).write_text(run.result.to_json(), encoding="utf-8")
        except OSError as error:
            msg = f"{place}: cannot be written ({error.strerror})"
            raise FileFormatError(msg) from error


def natural(name: str) -> list[tuple[int, int, str]]:
    """A key that sorts names with their numbers.

    Examples
    --------
    >>> sorted(["p10", "p2"], key=natural)
    ['p2', 'p10']
    """
    return [(0, int(bit), "") if bit.isdecimal() else (1, 0, bit) for bit in re.split(r"(\d+)", name) if bit]


def subfolders(folder: Path) -> list[Path]:
    """Folders within a folder, hidden ones left out, in natural order."""
    try:
        inside = [path for path in folder.iterdir() if path.is_dir() and not path.name.startswith(".")]
    except OSError as error:
        msg = f"{folder}: cannot be read ({error.strerror})"
        raise FileFormatError(msg) from error
    return sorted(inside, key=lambda path: natural(path.name))


def _inspected(path: Path, recipe: PartRecipe | None, method: Method, report: Callable[[float], None]) -> PartResult:
    def stage(name: str, fraction: float) -> None:
        first, last = STAGES[name]
        report(first + (last - first) * fraction)

    try:
        return inspect(read_capture(path), recipe, method=method, progress=stage)
    except BgarsError as error:
        if str(path) in str(error):
            raise
        msg = f"{path}: {error}"
        kinds = (InputError, FileFormatError)
        raise next((kind for kind in kinds if isinstance(error, kind)), CalibrationError)(msg) from error


def _is_run(folder: Path) -> bool:
    return (folder / RESULT_NAME).is_file() or any(any(folder.glob(sign)) for sign in CAPTURE_SIGNS)


def _walk(folder: Path, names: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], Path]]:
    inside = subfolders(folder)
    if not inside or len(names) == len(LEVELS):
        msg = (
            f"{folder}: must be a result, a capture, or hold folders of them (up to {LEVELS[-1]}); it is none of these"
        )
        raise InputError(msg)
    for path in inside:
        if _is_run(path):
            yield (*names, path.name), path
        else:
            yield from _walk(path, (*names, path.name))


def _places(folder: Path) -> list[tuple[tuple[str, str, str], Path]]:
    """Part, placement and repeat of every run, and its folder."""
    need_folder(folder)
    if _is_run(folder):
        msg = f"{folder}: is a single run; a study is a folder of runs ({', '.join(LEVELS)})"
        raise InputError(msg)
    found = list(_walk(folder, ()))
    depth = len(found[0][0])
    for names, path in found:
        if len(names) != depth:
            msg = f"{path}: all runs must be equally deep: {found[0][1]} is {LEVELS[depth - 1]}"
            raise InputError(msg)
    return [(_full(names), path) for names, path in found]


def _full(names: tuple[str, ...]) -> tuple[str, str, str]:
    """Part, placement, repeat, from the folders that there are."""
    part = names[0] if len(names) > 1 else ONLY
    placement = names[1] if len(names) == len(LEVELS) else ONLY
    return part, placement, names[-1]


def _design(folder: Path, names: list[tuple[str, str, str]]) -> tuple[tuple[str, ...], tuple[str, ...], int]:
    """Parts, placements, and how often; every cell must be full."""
    counts: dict[str, dict[str, int]] = {}
    for part, placement, _ in names:
        cells = counts.setdefault(part, {})
        cells[placement] = cells.get(placement, 0) + 1
    parts, placements = tuple(counts), tuple(next(iter(counts.values())))
    repeats = counts[parts[0]][placements[0]]
    for part, cells in counts.items():
        if set(cells) != set(placements):
            odd = sorted(set(cells) ^ set(placements), key=natural)
            msg = (
                f"{folder / part}: the design is not crossed: placements must be named alike in all parts; "
                f"{', '.join(odd)} is not in both {parts[0]} and {part}"
            )
            raise InputError(msg)
        for placement, count in cells.items():
            where = folder / "/".join(name for name in (part, placement) if name != ONLY)
            if count < MIN_REPEATS:
                msg = f"{where}: must hold at least {MIN_REPEATS} repeats, got {count}"
                raise InputError(msg)
            if count != repeats:
                msg = f"{where}: the design is not balanced: must hold {repeats} repeats like the first, got {count}"
                raise InputError(msg)
    return parts, placements, repeats
