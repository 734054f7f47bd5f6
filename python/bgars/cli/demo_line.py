"""The command ``bgars demo line``."""

from __future__ import annotations

import threading
from pathlib import Path

from bgars.cli.console import activation, open_page, print_json, say, shown_path, stage_progress
from bgars.errors import InputError
from bgars.line.demo import LIGHTS, PARTS, RECIPE, RIG, defects_of, drop_part, serial_of
from bgars.line.inbox import Inbox
from bgars.line.inbox_lock import watched
from bgars.line.lot_page import write_lot_page
from bgars.line.naming import Naming
from bgars.line.pages import write_part_page
from bgars.line.watch import Watch
from bgars.records.part_identity import PartIdentity
from bgars.store import open_store

__all__ = ["demo_line"]

LOT = "DEMO"


def demo_line(output: Path, *, parts: int | None = None, opens: bool = True, as_json: bool = False) -> None:
    """Simulate a station, inspect what it drops, and write the page of the lot, and of parts that do not pass."""
    parts = PARTS if parts is None else parts
    if output.exists() and any(output.iterdir()):
        msg = f"{output}: must be a new or an empty folder: the demo makes an inbox and a store in it"
        raise InputError(msg)
    inbox, store_folder = output / "inbox", output / "store"
    inbox.mkdir(parents=True)
    recipe, rig = output / "part.toml", output / "rig" / "capture.toml"
    rig.parent.mkdir()
    recipe.write_text(RECIPE, encoding="utf-8")
    rig.write_text(RIG, encoding="utf-8")
    store = open_store(store_folder, create=True)
    with stage_progress() as report, watched(inbox):
        watching = Watch(
            Inbox(inbox, count=LIGHTS, trigger="", settle_s=0.2),
            store,
            recipe,
            rig,
            inbox / "_done",
            inbox / "_failed",
            naming=Naming(common=PartIdentity(lot=LOT)),
            poll_s=0.05,
            say=lambda _line: report("parts", (watching.parts + 1) / parts),
        )
        station = threading.Thread(target=_station, args=(inbox, parts), daemon=True)
        station.start()
        watching.run(most=parts)
        station.join()
    page = store_folder / "pages" / "index.html"
    page.parent.mkdir(exist_ok=True)
    for serial in store.query("select serial from parts where verdict <> 'pass' order by serial")["serial"].to_pylist():
        write_part_page(store, serial)
    facts = write_lot_page(store, page, lot=LOT)
    put_in = [serial_of(number) for number in range(parts) if defects_of(number, parts)]
    found = [row["serial"] for row in facts["last"] if row["verdict"] == "fail"][::-1]
    if as_json:
        print_json({"page": str(page), "verdicts": facts["verdicts"], "defects_put_in": put_in, "failed": found})
        return
    say(f"{parts} parts dropped into {shown_path(inbox)}, with a defect put into {', '.join(put_in)}.")
    told = ", ".join(f"{count} {verdict}" for verdict, count in facts["verdicts"].items())
    say(f"Verdicts: {told}; failed: {', '.join(found) or 'none'}.")
    say()
    verb = "Opened" if opens and open_page(page) else "Open"
    facts_of_page = "yield, defects and where they are, drift; rows of failed parts link to their pages"
    say(f"{verb} {shown_path(page)}: {facts_of_page}.")
    shown = shown_path(store_folder)
    say(
        f"Next: {activation()}bgars query {shown} \"select serial, verdict, reason from parts where verdict <> 'pass'\""
    )


def _station(inbox: Path, parts: int) -> None:
    for number in range(parts):
        drop_part(inbox, number, parts)
