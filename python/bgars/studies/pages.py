"""The pages of the studies: one file each, no script, no network, every text escaped."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING

from jinja2 import Environment, PackageLoader, StrictUndefined

from bgars.report.html.units import with_micro
from bgars.studies.characteristics import TITLES
from bgars.studies.gauge import ACCEPTABLE_PERCENT, UNACCEPTABLE_PERCENT
from bgars.studies.grr_figures import deviation_figure, linearity_figure, share_figure
from bgars.studies.spc_figures import trend_figure
from bgars.studies.svg import data_uri

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bgars.studies.gauge_rr import GaugeStudy
    from bgars.studies.query_chart import QueryChart
    from bgars.studies.trend import ProcessTrend

__all__ = ["chart_page", "grr_page", "spc_page"]

UNKNOWN = "–"  # noqa: RUF001 - a dash of the width of a digit
SMALL_CHANCE = 0.001


def grr_page(found: GaugeStudy) -> str:
    """Return the page of a gauge study as HTML text."""
    first = found.study.runs[0].result
    titles = [TITLES[each.characteristic] for each in found.figures]
    judged = [at for at, each in enumerate(found.figures) if each.tolerance is not None] or range(len(found.figures))
    known = [
        (each, figures, title)
        for each, figures, title in zip(found.accuracies, found.figures, titles, strict=True)
        if each.references or math.isfinite(each.cg)
    ]
    return (
        _environment()
        .get_template("grr.html")
        .render(
            found=found,
            study=found.study,
            part=found.name,
            pixel_pitch_um=first.pixel_pitch_um,
            recipe="" if first.recipe is None else first.recipe.name,
            version=first.version,
            method=first.method,
            acceptable=f"{ACCEPTABLE_PERCENT:g}",
            unacceptable=f"{UNACCEPTABLE_PERCENT:g}",
            rows=list(zip(found.figures, titles, strict=True)),
            shares=data_uri(partial(share_figure, [found.figures[at] for at in judged], [titles[at] for at in judged])),
            accuracies=[(each, title) for each, _, title in known],
            lines=[
                (data_uri(partial(linearity_figure, each, figures, title)), title)
                for each, figures, title in known
                if each.references > 1
            ],
            sections=[
                (each, title, data_uri(partial(deviation_figure, readings, each, found.study.placements)))
                for readings, each, title in zip(found.readings, found.figures, titles, strict=True)
            ],
        )
    )


def spc_page(found: ProcessTrend) -> str:
    """Return the page of a process trend as HTML text."""
    labels = part_labels(found)
    return (
        _environment()
        .get_template("spc.html")
        .render(
            found=found,
            labels=labels,
            sections=[(trend, data_uri(partial(trend_figure, trend, labels))) for trend in found.trends],
        )
    )


def chart_page(charts: Sequence[QueryChart], store: str, sql: str) -> str:
    """Return the page of charts of a question as HTML text."""
    sections = [(each, data_uri(partial(trend_figure, each, each.labels))) for each in charts]
    return _environment().get_template("chart.html").render(sections=sections, store=store, sql=sql)


def part_labels(found: ProcessTrend) -> tuple[str, ...]:
    r"""Serial number and time of each part, two lines; nothing where neither is known.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> part_labels(SimpleNamespace(serials=("SN1",), times=("2026-01-31T12:00:00Z",)))
    ('SN1\n01-31 12:00',)
    """
    if not any(found.serials) and not any(found.times):
        return ()
    return tuple(
        f"{serial}\n{time[5:16].replace('T', ' ')}".strip()
        for serial, time in zip(found.serials, found.times, strict=True)
    )


def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("bgars.studies"), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    environment.filters |= {
        "number": _number,
        "micro": with_micro,
        "title": lambda name: TITLES.get(name, name),
        "chance": _chance,
        "percent": lambda value: _told(value, ".1f", " %"),
        "fixed": lambda value: _told(value, ".2f"),
    }
    return environment


def _told(value: float | None, form: str, unit: str = "") -> str:
    return UNKNOWN if value is None or not math.isfinite(value) else format(value, form) + unit


def _number(value: float | None, digits: int = 3) -> str:
    """So many digits, and no powers of ten for lengths that a person writes out."""
    if value is not None and abs(value) >= 10.0 ** (digits - 1):
        return _told(value, ".0f")
    return _told(value, f".{digits}g")


def _chance(value: float | None) -> str:
    """A p-value."""
    return "< 0.001" if value is not None and value < SMALL_CHANCE else _told(value, ".3f")
