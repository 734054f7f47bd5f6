"""Experiments as a page of Markdown."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

from experiments.setting import DIFFUSE

if TYPE_CHECKING:
    from collections.abc import Mapping

    from experiments.outcome import Experiment, Outcome

__all__ = ["page_of_all", "section"]

WIDTH = 140
SCENE = (
    "A hemisphere of R = {radius_px} px on a dark board, 8 distant lights on a ring at 45 deg, 8-bit images without "
    "noise, I_d = 0.5, I_s = 1, h = 40 (Beckmann, Cook-Torrance masking), point sampled, unless a section says "
    "otherwise. *Naive* is `lambertian`, plain least squares; *the filter* is `specular-filter`, the paper's, taken "
    "literally; `reflectance` looks for the ball in the images and fits its material on it."
)
MEASURES = (
    "* **Angular error:** mean over the hemisphere pixels whose true n_z is above 0.3; a pixel without a solution "
    "counts as (0, 0, 1). The CSV files also have median and 95th percentile, and the mean over n_z > 0.1.",
    "* **Height RMSE:** the estimated normals are integrated over the whole silhouette of the hemisphere by the "
    "default integrator (pixels without a solution as (0, 0, 1) again); root mean square difference to the true height "
    "over all those pixels, the mean difference removed.",
    "* **Measured:** percentage of the pixels of n_z > 0.3 whose own values determine the normal "
    "(`measured_percent_nz03` of the CSV files). `reflectance` draws the others to the sphere of the ball's circle.",
)
LIMITS = (
    "* **One scene.** A single sphere, ideal lights and camera, one reflection: these numbers compare methods under "
    "the paper's conditions and say little about a real part.",
    "* **A sphere favours `reflectance`.** It assumes spheres unless the images show another shape, and here they are "
    "spheres: where little is measured, its small errors are those of the circle it found.",
    "* **The exposure is fixed.** Grey level 255 means I = 1 in every image, as in the paper's sweeps; at I_d = "
    "{least:g} the diffuse light is {levels:.1f} grey levels, and 8 bits lose most of it.",
    "* **Only the equations of the paper were available,** not its images or data: a figure agrees if it shows the "
    "same effect.",
)


def section(experiment: Experiment, outcome: Outcome, folder: str, level: int) -> list[str]:
    """Lines of one experiment.

    Parameters
    ----------
    experiment : Experiment
        For its heading.
    outcome : Outcome
        Its result.
    folder : str
        Way from the page to the files: empty, or ending in a slash.
    level : int
        Of the heading.
    """
    lines = [f"{'#' * level} {experiment.title}", ""]
    for picture in outcome.pictures:
        lines += [f"![{picture.caption}]({folder}{picture.stem}.png)", "", f"*{picture.caption}*", ""]
    lines += [paragraph(outcome), "", *outcome.table, ""]
    csv = f"[{experiment.name}.csv]({folder}{experiment.name}.csv)"
    lines += [f"Every column: {csv}. Command: `python -m experiments {experiment.name} -o OUT`."]
    return wrapped(lines)


def paragraph(outcome: Outcome) -> str:
    """What was done, what agrees, what does not."""
    parts = [outcome.about]
    if outcome.agrees:
        parts.append(f"**Agrees:** {joined(outcome.agrees)}")
    if outcome.differs:
        parts.append(f"**Does not:** {joined(outcome.differs)}")
    return " ".join(parts)


def joined(sentences: tuple[str, ...]) -> str:
    """Sentences that begin small, as one."""
    return "; ".join(sentence.removesuffix(".") for sentence in sentences) + "."


def page_of_all(
    outcomes: Mapping[str, tuple[Experiment, Outcome]], folder: str, *, radius_px: int, command: str
) -> list[str]:
    """Lines of the page of every experiment: limits, verdicts, then a section each."""
    results = [outcome for _, outcome in outcomes.values()]
    lines = ["# Experiments: the paper's figures, reproduced", ""]
    lines += [f"Written by `{command}`: every result here was measured by that run, in words, too. Limits first.", ""]
    limits = [line.format(least=DIFFUSE[0], levels=255.0 * DIFFUSE[0]) for line in LIMITS]
    lines += [*limits, "", "## Where the paper's claims do not hold", ""]
    lines += [f"* {outcome.limit}" for outcome in results if outcome.limit]
    lines += ["", "## Where they hold", ""]
    lines += [f"* {outcome.holds}" for outcome in results if outcome.holds]
    lines += ["", "## Scene and measures", "", SCENE.format(radius_px=radius_px), "", *MEASURES, ""]
    for experiment, outcome in outcomes.values():
        lines += [*section(experiment, outcome, folder, 2), ""]
    return wrapped(lines[:-1])


def wrapped(lines: list[str]) -> list[str]:
    """Break long text, but no table, picture or heading."""
    short: list[str] = []
    for line in lines:
        if line.startswith(("|", "!", "#")):
            short.append(line)
            continue
        indent = "  " if line.startswith("* ") else ""
        broken = textwrap.wrap(line, WIDTH, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)
        short += broken or [""]
    return short
