"""Measure every open scene and photograph with truth, and rewrite the tables of docs/accuracy.md."""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass
from pathlib import Path

import bgars
from bgars.light_files import read_filenames
from bgars.normals import METHODS

PAGE = Path(__file__).parent / "accuracy.md"
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
            cells.append(
                f"**{errors.mean_deg:.2f}** / {errors.median_deg:.2f} / {errors.p95_deg:.1f} ({errors.invalid})"
            )
        rmse = " / ".join(
            "-" if result.ball_height_rmse_um is None else f"{result.ball_height_rmse_um:.1f}" for result in results
        )
        name = case.shown.split("/", 1)[1] + (f", {case.images.removesuffix('.txt')}" if case.images else "")
        lines.append(f"| {name} | {' | '.join(cells)} |{'' if photographs else f' {rmse} |'} `{case.command}` |")
        sys.stderr.write(f"{name}\n")
    return lines


def main() -> None:
    """Rewrite the part of the page between the marks."""
    scenes, photographs = cases(Path(os.environ["BGARS_DATA"]))
    page = PAGE.read_text(encoding="utf-8")
    head, rest = page.split(START)
    tail = rest.split(END)[1]
    body = "\n".join(
        ["", "### Rendered scenes", "", *table(scenes), "", "### Photographs", "", *table(photographs), ""]
    )
    PAGE.write_text(f"{head}{START}\n{body}\n{END}{tail}", encoding="utf-8")


if __name__ == "__main__":
    main()
