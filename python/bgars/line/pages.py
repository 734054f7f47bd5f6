"""Pages of a store, on demand: one of a part, one of a lot."""

from __future__ import annotations

import hashlib
import re
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

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
LONGEST = 60
"""Characters of a serial number in the name of its page: file systems allow 255 bytes."""


def write_part_page(store: Store, serial: str, page: Path | None = None, *, round_: int | None = None) -> PageSource:
    """Write the page of a part; plotly.js lies beside the pages, once.

    Parameters
    ----------
    store : Store
    serial : str
    page : Path, optional
        ``pages/SERIAL.html`` in the store by default.
    round_ : int, optional
        Which of its inspections; the last by default.

    Returns
    -------
    PageSource
        What is on the page; its warnings say why there is no photograph.

    Raises
    ------
    InputError
        The store has no such part.
    FileFormatError
        The page cannot be written.
    """
    source = _source(store, serial, round_)
    if page is None:
        page = store.folder / "pages" / page_name(serial, round_)
        page.parent.mkdir(exist_ok=True)
    write_page(source, page, shared_plotly=True)
    return source


def page_name(serial: str, round_: int | None = None) -> str:
    """File of a part's page, of no other part: a serial number that cannot be a name gets a checksum.

    Examples
    --------
    >>> page_name("SN_1"), page_name("SN1", 2)
    ('SN_1.html', 'SN1.round2.html')
    >>> page_name("SN/1")
    'SN_1-417b55fa.html'
    """
    name = re.sub(r"[^\w.+-]", "_", serial)[:LONGEST] or "_"
    if name != serial or RESERVED.search(name):
        name += f"-{hashlib.sha256(serial.encode()).hexdigest()[:8]}"
    return f"{name}.html" if round_ is None else f"{name}.round{round_}.html"


def _source(store: Store, serial: str, round_: int | None) -> PageSource:
    quoted = serial.replace("'", "''")
    rows = store.query(
        "select p.round, p.capture_folder, r.result_json from parts p join results r using (part_key) "
        f"where p.serial = '{quoted}' order by p.round, p.sequence"
    ).to_pylist()
    rows = [row for row in rows if round_ is None or row["round"] == round_]
    if not rows:
        wanted = "" if round_ is None else f", round {round_}"
        msg = f"{store.folder}: has no part with the serial number {serial!r}{wanted}"
        raise InputError(msg)
    row = rows[-1]
    result = parse_result(row["result_json"].encode(), store.folder / RESULT_NAME)
    return _with_photograph(result, Path(row["capture_folder"]))


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
