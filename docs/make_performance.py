"""Measure bgars against its peers, or read what was measured; rewrite tables and plot of docs/performance.md.

Groups that are not in a given file keep the tables that they have.

python docs/make_performance.py [--json measured.json]
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.ticker import FuncFormatter, NullFormatter

ROOT = Path(__file__).parents[1]
PEERS = ROOT / "benches" / "peers"
sys.path.insert(0, str(PEERS))
from table import group_lines, machine_line, of_kind  # noqa: E402

PAGE = ROOT / "docs" / "performance.md"
PLOT = ROOT / "docs" / "images" / "scaling.png"
START, END = "<!-- tables: make performance -->", "<!-- end of tables -->"
COMMAND = "python benches/peers/compare.py"
TITLES = {
    "normals": "Normals: published filter, 8 lights of 8 bit; other pixel types and numbers of lights",
    "glossy": "Normals of glossy balls: 8 lights of 8 bit, I_d 0.25",
    "integrate": "Integration to a relative residual of 1e-6",
    "bilateral": "Bilateral integration, the same inner tolerance on both sides",
    "read": "Files to normals",
    "write": "Height map to mesh file",
}
COLORS = {"rectangle": "#1b6ca8", "disc with holes": "#c8553d"}
LINES = {1: ("o", "--"), 2: ("s", "-")}
NOT_SHOWN = "roofline"
"""Its operations and bytes are counted by hand from kernels, and kernels change."""


def measure() -> dict[str, Any]:
    """Run all comparisons: long, and best on a machine that does nothing else."""
    with tempfile.TemporaryDirectory() as folder:
        record = Path(folder) / "measured.json"
        subprocess.run([sys.executable, str(PEERS / "compare.py"), "--json", str(record)], check=True)
        return dict(json.loads(record.read_text(encoding="utf-8")))


def page_rows(rows: list[dict[str, Any]], group: str) -> tuple[list[dict[str, Any]], int]:
    """The rows of a group that the page shows, and how many figures are left out because they keep their limits."""
    own = [row for row in rows if row["group"] == group and row["kind"] != NOT_SHOWN]
    shown = [row for row in own if row["kind"] != "check" or row["met"] is False]
    return shown, sum(row["kind"] == "check" and row["met"] is True for row in own)


def section_lines(record: dict[str, Any], group: str) -> list[str]:
    """The section of a group; nothing for one that was not measured."""
    shown, kept = page_rows(record["rows"], group)
    tables = group_lines(shown, group)
    if not tables:
        return []
    if kept:
        tables += [f"Not shown: {kept} figures (angles, iterations, residuals, bytes) that keep their limits.", ""]
    option = " --quick" if record["quick"] else ""
    lines = [f"## {TITLES[group]}", "", machine_line(record["machine"]), ""]
    lines += [f"`{COMMAND}{option} --only {group}`", "", *tables]
    if of_kind(record["rows"], "point", group):
        lines += ["![Seconds a megapixel against megapixels](images/scaling.png)", ""]
    return lines


def page_text(record: dict[str, Any], before: str) -> str:
    """Everything between the marks of the page; a group not measured keeps the section it had `before`."""
    lines = ["**Quick run: small sizes only, to see that the tools work.**", ""] if record["quick"] else []
    kept = {section.partition("\n")[0]: section for section in re.split(r"(?m)^(?=## )", before)}
    sections = {group: section_lines(record, group) for group in TITLES}
    texts = ["\n".join(section) or kept.get(f"## {TITLES[group]}", "") for group, section in sections.items()]
    return "\n".join(lines + [f"{text.strip()}\n" for text in texts if text])


def draw(points: list[dict[str, Any]], path: Path) -> None:
    """Seconds a megapixel against megapixels: level where the cost is linear."""
    figure, axes = plt.subplots(figsize=(8.0, 4.5), layout="constrained")
    for shape, color in COLORS.items():
        for threads, (marker, style) in LINES.items():
            chosen = sorted(
                (point for point in points if (point["shape"], point["threads"]) == (shape, threads)),
                key=lambda point: point["megapixels"],
            )
            axes.plot(
                [point["megapixels"] for point in chosen],
                [point["seconds"] / point["megapixels"] for point in chosen],
                color=color,
                marker=marker,
                linestyle=style,
                label=f"{shape}, {threads} thread{'s' if threads > 1 else ''}",
            )
    sizes = sorted({point["megapixels"] for point in points})
    axes.set_xscale("log", base=2)
    axes.set_xticks(sizes)
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.2g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel("image size (megapixels, holes included)", fontsize=12)
    axes.set_ylabel("integration time (s / megapixel)", fontsize=12)
    axes.tick_params(labelsize=11)
    axes.grid(visible=True, alpha=0.3)
    axes.legend(fontsize=11)
    path.parent.mkdir(exist_ok=True)
    figure.savefig(path, dpi=150)
    plt.close(figure)


def rewrite(page: Path, record: dict[str, Any]) -> None:
    """Put what was measured between the marks of a page."""
    head, rest = page.read_text(encoding="utf-8").split(START)
    before, tail = rest.split(END)
    page.write_text(f"{head}{START}\n\n{page_text(record, before)}\n{END}{tail}", encoding="utf-8")


def main() -> None:
    """Rewrite page and plot."""
    parser = argparse.ArgumentParser(description="rewrite docs/performance.md")
    parser.add_argument(
        "--json", type=Path, help="what compare.py --json wrote; without it, everything is measured now"
    )
    given = parser.parse_args().json
    record = measure() if given is None else json.loads(given.read_text(encoding="utf-8"))
    points = of_kind(record["rows"], "point")
    if points:
        draw(points, PLOT)
    rewrite(PAGE, record)


if __name__ == "__main__":
    main()
