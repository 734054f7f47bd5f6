"""Render parts and write their folders; those that exist are left alone.

python benches/reality/make_scenes.py [--into FOLDER] SEED|FIRST-LAST ...
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

from draw import draw
from llvm import start_mitsuba
from write import write_scene

SCENES = Path(__file__).parent / "scenes"


def seeds_of(texts: list[str]) -> list[int]:
    """Read seeds and ranges of seeds (both ends included)."""
    seeds: list[int] = []
    for text in texts:
        first, _, last = text.partition("-")
        seeds += range(int(first), int(last or first) + 1)
    return seeds


def main() -> None:
    """Render what is missing."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("seeds", nargs="+", metavar="SEED|FIRST-LAST")
    parser.add_argument("--into", type=Path, default=SCENES, metavar="FOLDER")
    options = parser.parse_args()
    missing = [seed for seed in seeds_of(options.seeds) if not (options.into / str(seed)).exists()]
    if not missing:
        return
    try:
        mitsuba = start_mitsuba()
    except RuntimeError as error:
        sys.exit(str(error))
    from render import render  # noqa: PLC0415 - needs optional installs

    for seed in missing:
        start, setup = time.monotonic(), draw(seed)
        write_scene(setup, render(mitsuba, setup), options.into / str(seed))
        what = ", ".join(setup.deviations) or "no deviations"
        sys.stderr.write(f"{seed}: {what}; {time.monotonic() - start:.0f} s\n")


if __name__ == "__main__":
    main()
