"""Run experiments and leave their files, all or none."""

from __future__ import annotations

import csv
import os
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bgars.errors import InputError
from bgars.io.atomic import atomic_file, atomic_folder
from bgars.io.own_files import is_own, need_new_or_own

from experiments.outcome import Outcome, Run
from experiments.page import page_of_all, section
from experiments.registry import ALL, chosen
from experiments.style import figure_style, save

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["DEFAULT_RADIUS_PX", "MAX_RADIUS_PX", "MIN_RADIUS_PX", "write_experiments"]

DEFAULT_RADIUS_PX = 90
MIN_RADIUS_PX, MAX_RADIUS_PX = 10, 500
PAGE = "experiments.md"
DECIMALS = 4


def write_experiments(
    name: str,
    output: str | os.PathLike[str],
    *,
    radius_px: int = DEFAULT_RADIUS_PX,
    page: str | os.PathLike[str] | None = None,
    progress: Callable[[str, float], object] | None = None,
) -> dict[str, Any]:
    """Run an experiment, or all, and write figures, tables and a page of Markdown.

    Parameters
    ----------
    name : str
        Of the experiment, or "all".
    output : path
        Folder for ``*.png`` and ``*.csv``; made if missing.
    radius_px : int
        Radius of the hemisphere, 10 to 500; the paper-like 90 by default.
    page : path, optional
        The page instead of ``NAME.md`` (``experiments.md`` for all) in `output`; it links the files where they are.
    progress : callable, optional
        Called with (experiment, fraction done).

    Returns
    -------
    dict
        ``radius_px``, ``page``, ``files``, and for each of ``experiments`` its title, sentences and rows.

    Raises
    ------
    InputError
        An unknown name, a radius out of range, a file in the way that no experiment wrote.
    FileFormatError
        The output cannot be written; nothing is left behind.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_experiments("fig3", folder, radius_px=12)["files"]
    ['fig3.png', 'fig3.csv', 'fig3.md']
    """
    experiments = chosen(name)
    if not MIN_RADIUS_PX <= radius_px <= MAX_RADIUS_PX:
        msg = f"radius_px: must lie in [{MIN_RADIUS_PX}, {MAX_RADIUS_PX}], got {radius_px}"
        raise InputError(msg)
    output = Path(output)
    own_page = PAGE if name == ALL else f"{name}.md"
    command = _command(output, page, radius_px)
    if page is not None and Path(page).absolute().parent == output.absolute():
        own_page, page = Path(page).name, None
    way = "" if page is None else _way(Path(page).absolute().parent, output.absolute())
    need_new_or_own(output / own_page if page is None else page)
    files: list[str] = []
    outcomes = {}
    with ExitStack() as opened:
        # Both places are tried before the work, so that none is lost.
        folder = opened.enter_context(atomic_folder(output))
        page_file = folder / own_page if page is None else opened.enter_context(atomic_file(page))
        opened.enter_context(figure_style())
        for experiment in experiments:
            outcome = experiment.run(Run(radius_px, _reporter(progress, experiment.name)))
            outcomes[experiment.name] = (experiment, outcome)
            _need_own_or_new(outcome, output, experiment.name)
            for picture in outcome.pictures:
                save(picture.figure, folder / f"{picture.stem}.png")
                files.append(f"{picture.stem}.png")
            write_csv(outcome, folder / f"{experiment.name}.csv")
            files.append(f"{experiment.name}.csv")
        if name == ALL:
            lines = page_of_all(outcomes, way, radius_px=radius_px, command=command)
        else:
            lines = section(*outcomes[name], way, 1)
        page_file.write_text("\n".join(lines) + "\n", encoding="utf-8")
        if page is None:
            files.append(own_page)
    return {
        "radius_px": radius_px,
        "page": str(output / own_page if page is None else page),
        "files": files,
        "experiments": {
            experiment.name: {
                "title": experiment.title,
                "agrees": list(outcome.agrees),
                "differs": list(outcome.differs),
                "columns": list(outcome.columns),
                "rows": outcome.rows,
            }
            for experiment, outcome in outcomes.values()
        },
    }


def _need_own_or_new(outcome: Outcome, folder: Path, name: str) -> None:
    """Raise InputError where files of others are in the way; a table of an earlier run vouches for its pictures."""
    table = folder / f"{name}.csv"
    is_earlier = False
    if table.is_file():
        with table.open("rb") as file:
            is_earlier = file.readline().decode("utf-8", "replace").rstrip() == ",".join(outcome.columns)
    pictures = [folder / f"{picture.stem}.png" for picture in outcome.pictures]
    foreign = [] if is_earlier else [path for path in (table, *pictures) if path.exists() and not is_own(path)]
    if foreign:
        msg = f"{foreign[0]}: exists, and no experiment wrote it; move it away, or name another folder"
        raise InputError(msg)


def write_csv(outcome: Outcome, path: Path) -> None:
    """Write the rows, numbers to four decimals at most."""
    with path.open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(outcome.columns)
        table.writerows([_cell(row[column]) for column in outcome.columns] for row in outcome.rows)


def _cell(value: str | float) -> str:
    if isinstance(value, str):
        return value
    text = f"{value:.{DECIMALS}f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def _reporter(progress: Callable[[str, float], object] | None, name: str) -> Callable[[float], object]:
    return (lambda _fraction: None) if progress is None else (lambda fraction: progress(name, fraction))


def _way(start: Path, goal: Path) -> str:
    way = Path(os.path.relpath(goal, start)).as_posix()
    return "" if way == "." else f"{way}/"


def _command(output: Path, page: str | os.PathLike[str] | None, radius_px: int) -> str:
    """The command that writes this page again."""
    parts = ["python -m experiments all", f"-o {output.as_posix() if not output.is_absolute() else 'OUT'}"]
    if page is not None:
        parts.append(f"--page {Path(page).as_posix() if not Path(page).is_absolute() else 'PAGE'}")
    if radius_px != DEFAULT_RADIUS_PX:
        parts.append(f"--radius-px {radius_px}")
    return " ".join(parts)
