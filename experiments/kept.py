"""Which lights the specular filter keeps, and what that costs: the reasons behind its errors."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from bgars.pipelines.evaluate import angular_error_deg
from bgars.pipelines.normals import estimate_normals

from experiments.measure import FILTER, NAIVE
from experiments.outcome import Experiment, Outcome, Picture
from experiments.setting import DIFFUSE, Setting
from experiments.style import OKABE_ITO, new_figure, panels, tidy
from experiments.words import listed, row_table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from experiments.outcome import Row, Run

__all__ = ["KEPT"]

COLUMNS = (
    "i_d",
    "i_s",
    "kept_shadow_percent",
    "kept_highlight_percent",
    "dropped_diffuse_percent",
    "too_few_lit_percent",
    "naive_deg",
    "filter_deg",
    "without_highlights_deg",
    "without_shadows_deg",
    "with_diffuse_deg",
    "with_diffuse_without_shadows_deg",
)
SHARES = (
    ("kept_shadow_percent", "an attached shadow is kept"),
    ("kept_highlight_percent", "a highlight is kept"),
    ("dropped_diffuse_percent", "a diffuse light is dropped"),
    ("too_few_lit_percent", "fewer than 3 kept lights are lit"),
)
ERRORS = (
    ("naive_deg", "least squares"),
    ("filter_deg", "specular filter"),
    ("without_highlights_deg", "less its highlights"),
    ("without_shadows_deg", "less its shadows"),
    ("with_diffuse_deg", "plus the diffuse lights"),
    ("with_diffuse_without_shadows_deg", "plus diffuse, less shadows"),
)
LOBE_LEVELS = 1.0
"""A light is a highlight where the lobe adds more than this: quantisation alone adds 1 at most."""
HATCHES = ("", "//", "..", "xx", "--", "\\\\")
MIN_LIGHTS = 3
SINGULAR = 1e-3
"""Lights are taken as coplanar below this 27 det / tr^3, which is 1 for lights in all directions alike."""


def run(how: Run) -> Outcome:
    """Shares of pixels and mean errors over I_d, with a lobe and without."""
    settings = [Setting(i_d=i_d, i_s=i_s) for i_s in (1.0, 0.0) for i_d in DIFFUSE]
    rows: list[Row] = []
    for index, setting in enumerate(settings):
        rows.append(judge(setting, how.radius_px))
        how.report((index + 1) / len(settings))
    shiny = [row for row in rows if row["i_s"] == 1.0]
    matte = [row for row in rows if row["i_s"] == 0.0]
    harmed = [float(row["i_d"]) for row in matte if float(row["filter_deg"]) > float(row["naive_deg"])]
    first, last, bare = shiny[0], shiny[-1], matte[-1]
    return Outcome(
        pictures=(
            Picture(
                "kept",
                draw(rows),
                "Left: share of pixels (n_z > 0.3) at which the filter keeps or drops what it should not. Right: mean "
                "errors of least squares, of the filter, and of the filter's choice of lights corrected by the truth.",
            ),
        ),
        columns=COLUMNS,
        rows=rows,
        table=row_table(
            {"I_d, I_s": "{i_d:g}, {i_s:g}"}
            | {f"{label} (%)": f"{{{name}:.1f}}" for name, label in SHARES}
            | {f"{label} (deg)": f"{{{name}:.2f}}" for name, label in ERRORS},
            rows,
        ),
        about=(
            "The truth says of each light of each pixel whether it is in attached shadow, and the same scene without a "
            f"lobe whether it is a highlight (over {LOBE_LEVELS:g} grey level above it). One pixel can be in several "
            "classes. The last four errors correct the filter's own choice of lights by that truth and solve again, "
            "where at least 3 lights that are not coplanar are left (elsewhere the filter's normal stays): no method, "
            "but it shows what each mistake costs."
        ),
        agrees=(
            f"with little diffuse light (I_d = {first['i_d']:g}) highlights are what has to go: {_corrected(first)}.",
        ),
        differs=(
            f"at I_d = {last['i_d']:g} it drops a diffuse light at {last['dropped_diffuse_percent']:.0f} % of the "
            f"pixels, keeps an attached shadow at {last['kept_shadow_percent']:.0f} %, is left with fewer than 3 lit "
            f"lights at {last['too_few_lit_percent']:.0f} %: {_corrected(last)}.",
            f"without any lobe (I_s = 0, I_d = {bare['i_d']:g}) it drops a diffuse light at "
            f"{bare['dropped_diffuse_percent']:.0f} % all the same: gaps between diffuse values alone exceed the "
            "threshold" + (f"; it is worse than least squares at I_d = {listed(harmed)} there." if harmed else "."),
        ),
        limit=(
            f"Why: at I_d = {last['i_d']:g} the filter takes diffuse light for highlights at "
            f"{last['dropped_diffuse_percent']:.0f} % of the pixels and counts attached shadows as data at "
            f"{last['kept_shadow_percent']:.0f} % ({last['filter_deg']:.1f} deg; {last['with_diffuse_deg']:.1f} with "
            f"the diffuse lights back, {last['with_diffuse_without_shadows_deg']:.1f} without the shadows, too); at "
            f"I_d = {first['i_d']:g} it keeps a highlight at "
            f"{first['kept_highlight_percent']:.0f} %."
        ),
    )


def _corrected(row: Row) -> str:
    """What each correction of the filter's choice would bring."""
    return (
        f"{row['filter_deg']:.1f} deg as it is, {row['without_highlights_deg']:.1f} less the highlights it keeps, "
        f"{row['without_shadows_deg']:.1f} less the shadows, {row['with_diffuse_deg']:.1f} plus the diffuse lights it "
        f"drops, {row['with_diffuse_without_shadows_deg']:.1f} with the last two together"
    )


def judge(setting: Setting, radius_px: int) -> Row:
    """Shares and errors of one capture over n_z > 0.3."""
    capture, truth = setting.photograph(radius_px)
    matte, _ = replace(setting, i_s=0.0).photograph(radius_px)
    field = estimate_normals(capture, method=FILTER, keep_sets=True)
    if field.kept_sets is None:
        raise AssertionError
    judged = truth.mask & (truth.normals[..., 2] > 0.3)  # noqa: PLR2004
    kept = np.moveaxis(field.kept_sets, 2, 0)[:, judged]
    lit = truth.lit[:, judged]
    lobe = capture.images[:, judged].astype(np.float64) - matte.images[:, judged] > LOBE_LEVELS
    diffuse = lit & ~lobe
    true = truth.normals[judged]
    filtered = field.normals[judged]
    values = capture.images[:, judged].astype(np.float64)

    def error_deg(use: NDArray[np.bool_]) -> float:
        normals = solved(values, use, capture.rig.directions, filtered.astype(np.float64))
        return float(angular_error_deg(normals.astype(np.float32), true).mean())

    def percent(pixels: Any) -> float:  # noqa: ANN401 - what numpy's any() returns
        return 100.0 * float(pixels.mean())

    naive = estimate_normals(capture, method=NAIVE).normals[judged]
    return {
        "i_d": setting.i_d,
        "i_s": setting.i_s,
        "kept_shadow_percent": percent((kept & ~lit).any(axis=0)),
        "kept_highlight_percent": percent((kept & lobe).any(axis=0)),
        "dropped_diffuse_percent": percent((~kept & diffuse).any(axis=0)),
        "too_few_lit_percent": percent((kept & lit).sum(axis=0) < MIN_LIGHTS),
        "naive_deg": float(angular_error_deg(naive, true).mean()),
        "filter_deg": float(angular_error_deg(filtered, true).mean()),
        "without_highlights_deg": error_deg(kept & ~lobe),
        "without_shadows_deg": error_deg(kept & lit),
        "with_diffuse_deg": error_deg(kept | diffuse),
        "with_diffuse_without_shadows_deg": error_deg((kept & lit) | diffuse),
    }


def solved(
    values: NDArray[np.float64],
    use: NDArray[np.bool_],
    directions: NDArray[np.float64],
    otherwise: NDArray[np.float64],
) -> NDArray[np.float64]:
    """(N, 3) normals by least squares over chosen lights (Woodham 1980); `otherwise` where they are too few.

    Parameters
    ----------
    values : (L, N) float64
        Grey levels.
    use : (L, N) bool
        Lights of each pixel.
    directions : (L, 3) float64
        Unit vectors to the lights.
    otherwise : (N, 3) float64
        Taken where fewer than 3 lights, or only coplanar ones, are chosen, or where the solution faces away.
    """
    weights = use.astype(np.float64)
    gram = np.einsum("kn,ki,kj->nij", weights, directions, directions)
    right = np.einsum("kn,kn,ki->ni", weights, values, directions)
    spread = 27.0 * np.linalg.det(gram) / np.maximum(np.trace(gram, axis1=1, axis2=2), 1e-12) ** 3
    enough = (use.sum(axis=0) >= MIN_LIGHTS) & (spread > SINGULAR)
    found = np.linalg.solve(np.where(enough[:, None, None], gram, np.eye(3)), right[..., None])[..., 0]
    length = np.linalg.norm(found, axis=1, keepdims=True)
    good = enough & (found[:, 2] > 0)
    normals: NDArray[np.float64] = np.where(good[:, None], found / np.maximum(length, 1e-12), otherwise)
    return normals


def draw(rows: list[Row]) -> Figure:
    """Shares and errors as groups of bars over I_d."""
    figure = new_figure(12.5, 6.8)
    grid = panels(figure, 2, 2, sharex=True, sharey="col", width_ratios=(1.0, 1.35))
    for (left, right), i_s in zip(grid, (1.0, 0.0), strict=True):
        own = [row for row in rows if row["i_s"] == i_s]
        for axes, names, label in ((left, SHARES, "pixels (%)"), (right, ERRORS, "mean error (deg)")):
            bars(axes, own, names)
            axes.set_title(f"I_s = {i_s:g}")
            axes.set_ylabel(label)
    for axes in grid[-1]:
        axes.set_xlabel("I_d")
    for axes in grid[0]:
        axes.margins(y=0.4)
        axes.legend(loc="upper center", ncols=2 if axes is grid[0][0] else 3, fontsize=8)
    return figure


def bars(axes: Axes, rows: list[Row], names: tuple[tuple[str, str], ...]) -> None:
    """A group of bars a row; hatched, too, for those who tell no colours apart."""
    place = np.arange(len(rows))
    width = 0.84 / len(names)
    for index, (name, label) in enumerate(names):
        axes.bar(
            place + width * (index - 0.5 * (len(names) - 1)),
            [float(row[name]) for row in rows],
            width=0.92 * width,
            color=OKABE_ITO[index],
            hatch=HATCHES[index],
            edgecolor="white",
            linewidth=0.4,
            label=label,
        )
    axes.set_xticks(place, [f"{row['i_d']:g}" for row in rows])
    tidy(axes)


KEPT = Experiment(
    "kept", "Which lights the filter keeps", "what the filter keeps and drops, and what shadows cost it", run
)
