"""Write "A gallery of bad captures" of docs/captures.md: table, figures and pictures (`make check-faults`)."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import imageio.v3 as iio
import numpy as np

DOCS = Path(__file__).parent
sys.path.insert(0, str(DOCS.parent / "benches" / "check"))

import faults  # noqa: E402
import good_captures  # noqa: E402
import judge  # noqa: E402
from bgars.checks.run import check_capture  # noqa: E402
from bgars.report.figures.check_pictures import small_image  # noqa: E402

TITLE = "## A gallery of bad captures"
PICTURES = DOCS / "images" / "captures"
SHOWN = ("y down", "rows of the next light", "overexposed", "ambient light", "uneven lamp", "moved")
EACH = 4
SIDE_PX = 220


def main() -> None:
    """Judge, draw, write the section; the rest of the page stays."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=Path, help="rows of an earlier run of benches/check/judge.py judged")
    options = parser.parse_args()
    if options.rows is None:
        rows = judge.judged(good_captures.JUDGED_ON, each=EACH)
    else:
        rows = json.loads(options.rows.read_text(encoding="utf-8"))
    section = "\n".join([TITLE, "", *_figures(rows), "", *_table(rows), "", *_gallery(), ""])
    page = DOCS / "captures.md"
    text = page.read_text(encoding="utf-8") if page.exists() else "# Captures\n"
    before, _, rest = text.partition(TITLE)
    after = rest.partition("\n## ")[2]
    joined = before.rstrip() + "\n\n" + section + ("\n## " + after if after else "")
    page.write_text(joined.rstrip() + "\n", encoding="utf-8")


def _figures(rows: list[dict[str, Any]]) -> list[str]:
    faulty = [row for row in rows if row["fault"] in faults.FAULTS]
    good = [row for row in rows if not row["fault"]]
    found, named = sum(bool(row["kinds"]) for row in faulty), sum(row["right"] for row in faulty)
    alarms = sum(bool(row["kinds"]) for row in good)
    return [
        "`bgars check FOLDER` looks for these faults before anything is measured; `reconstruct`, `normals` and "
        "`inspect` do the",
        "same, print the findings, and stop (exit code 2) where every normal would be wrong, unless `--force` is "
        "given.",
        "Exit code of `bgars check`: 0 without an error, 1 with one, 2 where the capture cannot be read.",
        "",
        f"Of {len(faulty)} captures with one fault each, {found} are found ({100 * found / len(faulty):.1f} %), and "
        f"for {named} ({100 * named / len(faulty):.1f} %) the right cause",
        f"is named first; {alarms} of {len(good)} good captures get a warning or an error.",
        "The captures are simulated arrays, under rings and lights anywhere on a dome, and reliefs (seeds from 90000:",
        f"none was used when the thresholds were chosen) and rendered parts (seeds {_seeds(rows)}), each also turned",
        "(`make check-faults`). Three faults need",
        "cast shadows to show, and are only put there: ambient light, a veil, and a half turn of the table.",
        "The rates hold for surfaces like these, under 6 to 20 lights: matt reliefs with texture, and shiny balls on a",
        "board. A smooth part without texture, or a single ball, tells less, such as of an image that is shifted.",
    ]


def _seeds(rows: list[dict[str, Any]]) -> str:
    """Names of the rendered parts among the captures."""
    names = {
        row["capture"].split(",")[0].removeprefix("rendered part ") for row in rows if "rendered" in row["capture"]
    }
    return ", ".join(sorted(names, key=lambda name: (len(name), name)))


def _table(rows: list[dict[str, Any]]) -> list[str]:
    lines = ["| fault | kind | found | right cause | captures |", "|---|---|---|---|---|"]
    for name, (kind, _) in faults.FAULTS.items():
        own = [row for row in rows if row["fault"] == name]
        found, right = sum(bool(row["kinds"]) for row in own), sum(row["right"] for row in own)
        lines.append(f"| {name} | `{kind}` | {found} | {right} | {len(own)} |")
    return lines


def _gallery() -> list[str]:
    """Pictures of some faults, and what is said of each."""
    PICTURES.mkdir(parents=True, exist_ok=True)
    capture = good_captures.array(1006)
    lines: list[str] = []
    for index, name in enumerate(SHOWN):
        spoilt = faults.spoil(name, capture, 40 + index)
        told = check_capture(spoilt).told
        image = told[0].image if told and told[0].image is not None else 0
        step = max(1, max(spoilt.mask.shape) // SIDE_PX)
        pair = [small_image(spoilt, each)[::step, ::step] for each in (image, (image + 2) % len(spoilt.images))]
        shown = np.concatenate(pair, axis=1)
        grey = np.clip(shown / max(float(np.percentile(shown, 99)), 1e-6), 0, 1) ** (1 / 2.2)
        file = PICTURES / f"{name.replace(' ', '-')}.png"
        iio.imwrite(file, (255 * grey).astype(np.uint8))
        words = f"{told[0].message}; {told[0].advice}" if told else "nothing"
        lines += [f"**{name}**: {words}.", "", f"![{name}](images/captures/{file.name})", ""]
    return lines


if __name__ == "__main__":
    main()
