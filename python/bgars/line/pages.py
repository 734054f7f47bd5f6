"""Pages of a store, on demand: one of a part, one of a lot."""

from __future__ import annotations

import hashlib
import re
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bgars.errors import BgarsError, InputError
from bgars.io.capture import read_capture
from bgars.io.provenance import capture_files, checksums
from bgars.io.result_file import RESULT_NAME, parse_result
from bgars.pipelines.strip import part_of_strip
from bgars.report.html.page import write_page
from bgars.report.html.source import PageSource, source_of

if TYPE_CHECKING:
    from bgars.records.part_result import PartResult
    from bgars.store import Store

__all__ = ["page_name", "write_part_page"]

RESERVED = re.compile(r"\Aindex\Z|\.round\d+\Z", re.IGNORECASE)
"""The overview of a lot, and a part's earlier rounds, have pages of these names."""
UNFIT = r"[^\w.+-]"
LONGEST = 60
"""Characters of a serial number in the name of its page: file systems allow 255 bytes."""


def write_part_page(
    store: Store, serial: str, page: Path | None = None, *, round_: int | None = None, recipe: str | None = None
) -> tuple[PageSource, Path]:
    """Write the page of a part; plotly.js lies beside the pages, once.

    Parameters
    ----------
    store : Store
    serial : str
    page : Path, optional
        ``pages/SERIAL.html`` in the store by default, or that of :func:`page_name` with round and recipe.
    round_ : int, optional
        Which of its inspections; the last by default.
    recipe : str, optional
        Name of the recipe, which a serial number that was inspected under several needs.

    Returns
    -------
    PageSource
        What is on the page; its warnings say why there is no photograph.
    Path
        The page.

    Raises
    ------
    InputError
        The store has no such part, or has it under several recipes.
    FileFormatError
        The page cannot be written.
    """
    rows = _inspections(store, serial)
    chosen = [
        row for row in rows if round_ in {None, row["round"]} and (recipe is None or recipe.strip() == row["recipe"])
    ]
    if not chosen:
        wanted = ("" if round_ is None else f", round {round_}") + ("" if recipe is None else f", recipe {recipe!r}")
        msg = f"{store.folder}: has no part with the serial number {serial!r}{wanted}"
        raise InputError(msg)
    names = sorted({row["recipe"] for row in chosen})
    if len(names) > 1:
        told = ", ".join(map(repr, names))
        msg = f"{store.folder}: has {serial!r} under {len(names)} recipes: give --recipe-name, one of {told}"
        raise InputError(msg)
    row = chosen[-1]
    if page is None:
        is_one = len({each["recipe"] for each in rows}) == 1
        page = store.folder / "pages" / page_name(serial, round_, "" if is_one else row["recipe"])
        page.parent.mkdir(exist_ok=True)
    result = parse_result(row["result_json"].encode(), store.folder / RESULT_NAME)
    source = _with_photograph(result, Path(row["capture_folder"]))
    write_page(source, page, shared_plotly=True)
    return source, page


def page_name(serial: str, round_: int | None = None, recipe: str = "") -> str:
    """File of a part's page, of no other part: a serial number that cannot be a name gets a checksum.

    `recipe` is that of a serial number that was inspected under several, which gets one, too.

    Examples
    --------
    >>> page_name("SN_1"), page_name("SN1", 2)
    ('SN_1.html', 'SN1.round2.html')
    >>> page_name("SN/1")
    'SN_1-417b55fa.html'
    >>> page_name("SN1", recipe="top side")
    'SN1.top_side-c977884f.html'
    """
    name = re.sub(UNFIT, "_", serial)[:LONGEST] or "_"
    if name != serial or RESERVED.search(name):
        name += f"-{hashlib.sha256(serial.encode()).hexdigest()[:8]}"
    if recipe:
        both = hashlib.sha256(f"{serial}\0{recipe}".encode()).hexdigest()[:8]
        name = f"{name[:LONGEST]}.{re.sub(UNFIT, '_', recipe)[:LONGEST]}-{both}"
    return f"{name}.html" if round_ is None else f"{name}.round{round_}.html"


def _inspections(store: Store, serial: str) -> list[dict[str, Any]]:
    quoted = serial.replace("'", "''")
    rows: list[dict[str, Any]] = store.query(
        "select p.round, p.recipe, p.capture_folder, r.result_json from parts p join results r using (part_key) "
        f"where p.serial = '{quoted}' order by p.round, p.sequence"
    ).to_pylist()
    return rows


def _with_photograph(result: PartResult, folder: Path) -> PageSource:
    """The page's source with the images, where they still lie where they lay, and are the same."""
    if not str(folder) or not folder.is_dir():
        return PageSource(result.to_dict(), warnings=(f"no photograph: {folder} is gone",))
    try:
        capture = read_capture(folder)
        same = Counter(checksums(capture_files(capture))) <= Counter(result.files)
        if not same or len(result.light_directions) != len(capture.images):
            return PageSource(result.to_dict(), warnings=(f"no photograph: {folder} holds other images now",))
        strip = None if result.recipe is None else result.recipe.strip
        if strip is not None and result.identity.position:
            capture = part_of_strip(capture, strip, strip.place(result.identity.position))
        return source_of(result, capture)
    except (BgarsError, OSError) as error:
        return PageSource(result.to_dict(), warnings=(f"no photograph: {error}",))
