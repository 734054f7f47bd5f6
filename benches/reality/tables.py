"""Judged scenes as Markdown."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median

import numpy as np
from deviations import DEVIATIONS
from figures import Coverage, criteria, summarise
from records import SceneRecord


def page_lines(records: Sequence[SceneRecord]) -> list[str]:
    """Three tables: what is wanted, by deviation, what was refused."""
    figures = summarise(records)
    scenes = f"{figures.scenes} scenes ({records[0].scene} to {records[-1].scene})"
    normals = f"Normals of the default method, mean angle on the balls of a scene: median {figures.normals_deg[0]:.2f}"
    return [
        f"{scenes}, {figures.balls} balls in those that have a result.",
        "",
        *criteria_lines(records),
        "",
        *([f"{normals} degrees, worst {figures.normals_deg[1]:.1f}.", ""] if figures.normals_deg[0] >= 0 else []),
        *deviation_lines(records),
        "",
        *refusal_lines(records),
    ]


def criteria_lines(records: Sequence[SceneRecord]) -> list[str]:
    """The table of what is wanted and what was measured."""
    rows = [
        f"| {row.name} | {row.wanted} | {row.measured if row.met else f'**{row.measured}**'} |".replace("nan", "-")
        for row in criteria(summarise(records))
    ]
    return ["| over all scenes (bold: falls short) | wanted | measured |", "| --- | ---: | ---: |", *rows]


def deviation_lines(records: Sequence[SceneRecord]) -> list[str]:
    """One line a deviation; a scene with several counts in each of their lines."""
    lines = [
        "| deviation | what it is | scenes | refused | found (%) | undecided (%) | good balls failed "
        "| error of tops (px): median, 95 % "
        "| top (% within u / 2u) | x, y | diameter | coplanarity |",
        "| --- | --- |" + " ---: |" * 10,
    ]
    groups = [("none", "-", [record for record in records if not record.deviations])]
    groups += [
        (name.replace("_", " "), deviation.meaning, [record for record in records if name in record.deviations])
        for name, deviation in DEVIATIONS.items()
    ]
    return lines + [_deviation_row(name, meaning, group) for name, meaning, group in groups if group]


def _deviation_row(name: str, meaning: str, records: Sequence[SceneRecord]) -> str:
    figures = summarise(records)
    x, y = figures.coverage["x"], figures.coverage["y"]
    across = Coverage((x.within_1 + y.within_1) / 2, (x.within_2 + y.within_2) / 2)
    shares = (figures.coverage["top"], across, figures.coverage["diameter"], figures.coverage["coplanarity"])
    cells = [
        name,
        meaning,
        str(figures.scenes),
        str(len(figures.refused) + len(figures.crashed)),
        f"{figures.found:.1f}",
        f"{figures.undecided:.0f}",
        str(figures.wrong_fails),
        f"{figures.top_error_px[0]:.3f}, {figures.top_error_px[1]:.2f}",
        *(f"{one:.0f} / {two:.0f}" for one, two in shares),
    ]
    return f"| {' | '.join('-' if 'nan' in cell else cell for cell in cells)} |"


def refusal_lines(records: Sequence[SceneRecord]) -> list[str]:
    """Why captures have no result."""
    rows = [
        f"| {record.scene} | {', '.join(record.deviations)} | {(record.refused or record.crashed or '').strip()} |"
        for record in records
        if not record.judged
    ]
    head = ["| refused | deviations | reason |", "| --- | --- | --- |"]
    return head + rows if rows else ["No capture was refused."]


def progress_line(record: SceneRecord) -> str:
    """One scene in a line of text."""
    what = ", ".join(record.deviations).replace("_", " ") or "no deviations"
    if not record.judged:
        return f"{record.scene} ({what}): {record.refused or record.crashed}"
    figures = summarise([record])
    tops = [ball.readings["top"] for ball in record.balls if "top" in ball.readings]
    top = "no top"
    if tops:
        u_um = median(reading.u_um or np.nan for reading in tops)
        top = f"top {median(reading.error_um for reading in tops):+.1f} um (u {u_um:.2f})"
    found = sum(ball.present for ball in record.balls)
    wrong = f"wrong passes {figures.wrong_passes}, wrong fails {figures.wrong_fails}"
    said = f"part {record.verdict}, {wrong}, undecided {figures.undecided:.0f} %"
    return f"{record.scene} ({what}): {found} of {figures.balls} found, {top}; {said}"
