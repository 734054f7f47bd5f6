"""Measure every open scene and photograph with truth; rewrite the tables of docs/accuracy.md and README.md."""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass
from pathlib import Path

import bgars
from bgars.files.light_files import read_filenames
from bgars.normals.methods import METHODS

PAGE = Path(__file__).parent / "accuracy.md"
README = Path(__file__).parents[1] / "README.md"
IN_README = {
    "scenes/A_one_ball_diffuse": "one ball, weak highlights (A)",
    "scenes/B_one_ball_paper_id050": "one ball, strong highlights (B id050)",
    "scenes/C_grid_4x4_paper": "4 x 4 balls (C)",
    "scenes/C2_grid_4x4_gamma": "4 x 4 balls, gamma and noise (C2)",
    "scenes/E_grid_5x5_metal": "bare metal (E)",
    "real/dil_cat": "photograph, cat, 24 lights",
    "real/dil_bear": "photograph, bear, 24 lights",
}
START, END = "<!-- tables: make accuracy -->", "<!-- end of tables -->"


@dataclass(frozen=True)
class Case:
    """A capture with truth, and the options that pick its images."""

    folder: Path
    shown: str
    images: str | None = None

    @property
    def command(self) -> str:
        """The command that prints this case's numbers."""
        option = f" --images $BGARS_DATA/{self.shown}/{self.images}" if self.images else ""
        return f"bgars evaluate $BGARS_DATA/{self.shown}{option}"

    def evaluate(self) -> list[bgars.Evaluation]:
        """Run every method."""
        names = read_filenames(self.folder / self.images) if self.images else None
        capture = bgars.read_capture(self.folder, images=names)
        truth = bgars.read_truth(self.folder)
        return [bgars.evaluate(capture, method=method, truth=truth) for method in METHODS]


def cases(data: Path) -> tuple[list[Case], list[Case]]:
    """Scenes and photographs, in the order of their names."""
    scenes = []
    for truth in sorted(data.glob("scenes/*/gt.npz")):
        for folder in (truth.parent, truth.parent / "16bit"):
            if folder.is_dir():
                scenes.append(Case(folder, str(folder.relative_to(data))))
    photographs = []
    for truth in sorted(data.glob("real/*/Normal_gt.npy")):
        folder, shown = truth.parent, str(truth.parent.relative_to(data))
        photographs += [Case(folder, shown), Case(folder, shown, "ring8.txt")]
    return scenes, photographs


def readme_rows(chosen: list[Case]) -> list[str]:
    """Rows of the short table: mean errors only."""
    rows = []
    for case in chosen:
        if case.shown in IN_README and case.images is None:
            cells = " | ".join(f"{result.normals.mean_deg:.2f}" for result in case.evaluate())
            rows.append(f"| {IN_README[case.shown]} | {cells} |")
    return rows


def rewrite(page: Path, lines: list[str]) -> None:
    """Put lines between the marks of a page."""
    head, rest = page.read_text(encoding="utf-8").split(START)
    tail = rest.split(END)[1]
    body = "\n".join(lines)
    page.write_text(f"{head}{START}\n\n{body}\n\n{END}{tail}", encoding="utf-8")


def table(chosen: list[Case]) -> list[str]:
    """Rows of a Markdown table: mean / median / 95th percentile of each method, unsolved pixels in brackets."""
    photographs = "real" in chosen[0].shown
    heights = "" if photographs else " ball height RMSE (um), the same methods |"
    lines = [
        f"| capture | {' | '.join(METHODS)} |{heights} command |",
        f"| --- |{' ---: |' * len(METHODS)}{'' if photographs else ' ---: |'} --- |",
    ]
    for case in chosen:
        results = case.evaluate()
        cells = []
        for result in results:
            errors = result.normals
            cell = f"**{errors.mean_deg:.2f}** / {errors.median_deg:.2f} / {errors.p95_deg:.1f} ({errors.invalid})"
            if result is results[-1] and result.measured is not None and result.coverage is not None:
                share, within = 100 * result.measured.pixels / errors.pixels, 100 * result.coverage
                cell += f"; measured {share:.0f} %: {result.measured.mean_deg:.2f}, within u {within:.0f} %"
            cells.append(cell)
        rmse = " / ".join(
            "-" if result.ball_height_rmse_um is None else f"{result.ball_height_rmse_um:.1f}" for result in results
        )
        name = case.shown.split("/", 1)[1] + (f", {case.images.removesuffix('.txt')}" if case.images else "")
        lines.append(f"| {name} | {' | '.join(cells)} |{'' if photographs else f' {rmse} |'} `{case.command}` |")
        sys.stderr.write(f"{name}\n")
    return lines


def main() -> None:
    """Rewrite the parts of both pages between the marks."""
    scenes, photographs = cases(Path(os.environ["BGARS_DATA"]))
    header = [f"| capture | {' | '.join(METHODS)} |", f"| --- |{' ---: |' * len(METHODS)}"]
    rewrite(README, [*header, *readme_rows(scenes + photographs)])
    rewrite(PAGE, ["### Rendered scenes", "", *table(scenes), "", "### Photographs", "", *table(photographs)])


if __name__ == "__main__":
    main()
