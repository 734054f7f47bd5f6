"""Judge `bgars check` on captures with one fault each, and on good ones."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import faults
import good_captures
from bgars.check.run import check_capture


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("which", choices=[good_captures.CHOSEN_ON, good_captures.JUDGED_ON])
    parser.add_argument("--out", type=Path)
    parser.add_argument("--only", help="faults whose name holds this")
    parser.add_argument("--few", type=int, default=1, help="every so many good captures only")
    parser.add_argument("--each", type=int, default=4, help="captures a fault")
    options = parser.parse_args()
    import os
    import pickle

    good = (
        pickle.load(open(os.environ["GOOD"], "rb"))
        if "GOOD" in os.environ
        else list(good_captures.captures(options.which))
    )
    rows: list[dict[str, object]] = []
    for name, capture in good[:: options.few]:
        if options.only:
            break
        told = [finding for finding in check_capture(capture).findings if finding.severity != "note"]
        rows.append({"fault": "", "capture": name, "kinds": [each.kind for each in told]})
        if told:
            print("FALSE ALARM", name, [str(each)[:160] for each in told], flush=True)
    for index, (fault, _) in enumerate(faults.FAULTS.items()):
        if options.only and options.only not in fault:
            continue
        for turn in range(options.each):
            # Spread over the kinds of captures, other ones for every fault.
            able = [each for each in good if faults.shown(fault, each[0])]
            name, capture = able[(turn * len(able) // options.each + 7 * index) % len(able)]
            spoilt = faults.spoil(fault, capture, 100 * index + turn)
            told = [each for each in check_capture(spoilt).findings if each.severity != "note"]
            kinds = [each.kind for each in told]
            right = bool(kinds) and kinds[0] in faults.causes(fault)
            rows.append({"fault": fault, "capture": name, "kinds": kinds, "right": right})
            if not right:
                print(
                    "MISSED" if not kinds else "WRONG", fault, "|", name, [str(each)[:110] for each in told], flush=True
                )
    faulty = [row for row in rows if row["fault"]]
    silent = [row for row in rows if not row["fault"]]
    if faulty:
        found = sum(bool(row["kinds"]) for row in faulty)
        named = sum(bool(row["right"]) for row in faulty)
        print(f"{found} of {len(faulty)} found ({found / len(faulty):.0%}), {named} named ({named / len(faulty):.0%})")
    if silent:
        alarms = sum(bool(row["kinds"]) for row in silent)
        print(f"{alarms} false alarms on {len(silent)} good captures")
    if options.out:
        options.out.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
