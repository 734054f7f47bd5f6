"""What an experiment is given, and what it returns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure

__all__ = ["Experiment", "Outcome", "Picture", "Row", "Run"]

Row = dict[str, "str | float"]


@dataclass(frozen=True)
class Run:
    """How an experiment is run.

    Attributes
    ----------
    radius_px : int
        Radius of the hemisphere.
    report : callable
        Called with the fraction done.
    """

    radius_px: int
    report: Callable[[float], object]


@dataclass(frozen=True)
class Picture:
    """A figure, the stem of its file name, and the words under it."""

    stem: str
    figure: Figure
    caption: str


@dataclass(frozen=True)
class Outcome:
    """Result of an experiment.

    Attributes
    ----------
    pictures : tuple of Picture
        In the order of the page.
    columns : tuple of str
        Of the CSV.
    rows : list of dict
        Of the CSV, column to value.
    table : list of str
        Lines of the short Markdown table.
    about : str
        What was done.
    agrees, differs : tuple of str
        Sentences: where the paper's claims hold, and where they do not.
    holds, limit : str
        The same in one line each, for the top of the page; may be empty.
    """

    pictures: tuple[Picture, ...]
    columns: tuple[str, ...]
    rows: list[Row]
    table: list[str]
    about: str
    agrees: tuple[str, ...] = ()
    differs: tuple[str, ...] = ()
    holds: str = ""
    limit: str = ""


@dataclass(frozen=True)
class Experiment:
    """An experiment by its name.

    Attributes
    ----------
    name : str
        On the command line, and stem of its files.
    title : str
        Heading of its section.
    summary : str
        One line for ``python -m experiments --help``.
    run : callable
        Takes a :class:`Run`, returns an :class:`Outcome`.
    """

    name: str
    title: str
    summary: str
    run: Callable[[Run], Outcome]
