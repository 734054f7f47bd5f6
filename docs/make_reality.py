"""Judge bgars on rendered parts that deviate from its model; rewrite a part of docs/accuracy.md.

``make reality``, or ``python docs/make_reality.py [FOLDER] [--workers N] [--keep FOLDER]``; ``make reality-scenes``
renders the scenes.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "benches" / "reality"))
from judge import SCENES, judge_aloud, scenes_in  # noqa: E402
from tables import page_lines  # noqa: E402

PAGE = ROOT / "docs" / "accuracy.md"
START, END = "<!-- reality: make reality -->", "<!-- end of reality -->"


def page_with(lines: Sequence[str], page: str) -> str:
    """Put lines between the marks of a page.

    Raises
    ------
    ValueError
        Where the page does not have each mark once.
    """
    head, start, rest = page.partition(START)
    _, end, tail = rest.partition(END)
    if not start or not end:
        msg = f"the page must hold {START} and, after it, {END}"
        raise ValueError(msg)
    return f"{head}{start}\n\n" + "\n".join(lines) + f"\n\n{end}{tail}"


def main() -> None:
    """Judge a folder of scenes and rewrite the part of the page between the marks."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?", default=SCENES)
    parser.add_argument("--workers", type=int, default=1, metavar="N", help="processes")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="keep a record of each scene, to go on from there")
    parser.add_argument("--page", type=Path, default=PAGE)
    options = parser.parse_args()
    page = options.page.read_text(encoding="utf-8")
    page_with([], page)
    try:
        scenes = scenes_in(options.folder)
    except FileNotFoundError as error:
        sys.exit(str(error))
    lines = page_lines(judge_aloud(scenes, workers=options.workers, keep=options.keep))
    options.page.write_text(page_with(lines, page), encoding="utf-8")


if __name__ == "__main__":
    main()
