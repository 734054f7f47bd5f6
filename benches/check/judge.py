"""Judge `bgars check` on captures with one fault each, and on good ones; the figures of docs/captures.md."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import bgars
import faults
import good_captures
from bgars.checks.run import check_capture

__all__ = ["judged", "main"]


def judged(which: str, *, each: int) -> list[dict[str, Any]]:
    """Check a hundred good captures, and `each` captures with every fault; one row a capture.

    Parameters
    ----------
    which : {"chosen", "judged"}
        Captures that thresholds were chosen on, or others.
    each : int
        Captures a fault.
    """
    good = list(good_captures.captures(which))
    rows: list[dict[str, Any]] = []
    for name, capture in good:
        told = check_capture(capture).told
        rows.append({"fault": "", "capture": name, "kinds": [finding.kind for finding in told]})
        if told:
            print("FALSE ALARM", name, [str(finding)[:160] for finding in told], flush=True)
    for index, fault in enumerate(faults.FAULTS):
        able = [pair for pair in good if faults.shown(fault, pair[0])]
        for turn in range(each):
            # Spread over the kinds of captures, other ones for every fault.
            name, capture = able[(turn * len(able) // each + 7 * index) % len(able)]
            told = check_capture(faults.spoil(fault, capture, 100 * index + turn)).told
            kinds = [finding.kind for finding in told]
            right = bool(kinds) and kinds[0] in faults.causes(fault)
            rows.append({"fault": fault, "capture": name, "kinds": kinds, "right": right})
            if not right:
                words = [str(finding)[:110] for finding in told]
                print("WRONG" if kinds else "MISSED", fault, "|", name, words, flush=True)
    rows += _as_rendered(which)
    return rows


def _as_rendered(which: str) -> list[dict[str, Any]]:
    """Rendered parts whose camera was wrong on purpose; of several faults, any may be told first."""
    rows: list[dict[str, Any]] = []
    for folder in good_captures.rendered(which):
        wrong = good_captures.deviations(folder) & set(good_captures.FAULTY)
        if not wrong:
            continue
        told = check_capture(bgars.read_capture(folder)).told
        kinds = [finding.kind for finding in told]
        right = bool(kinds) and kinds[0] in {good_captures.FAULTY[each] for each in wrong}
        name = f"rendered part {folder.name}"
        rows.append(
            {"fault": "as rendered: " + ", ".join(sorted(wrong)), "capture": name, "kinds": kinds, "right": right}
        )
        if not right:
            print("AS RENDERED", sorted(wrong), "|", name, [str(finding)[:110] for finding in told], flush=True)
    return rows


def main() -> None:
    """Print what is missed, the shares, and write the rows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("which", choices=[good_captures.CHOSEN_ON, good_captures.JUDGED_ON])
    parser.add_argument("--each", type=int, default=4, help="captures a fault")
    parser.add_argument("--out", type=Path, help="write the rows as JSON")
    options = parser.parse_args()
    rows = judged(options.which, each=options.each)
    faulty = [row for row in rows if row["fault"] in faults.FAULTS]
    silent = [row for row in rows if not row["fault"]]
    found, named = sum(bool(row["kinds"]) for row in faulty), sum(row["right"] for row in faulty)
    print(f"{found} of {len(faulty)} found ({found / len(faulty):.0%}), {named} named ({named / len(faulty):.0%})")
    print(f"{sum(bool(row['kinds']) for row in silent)} false alarms on {len(silent)} good captures")
    if options.out:
        options.out.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
