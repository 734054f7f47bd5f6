"""``bgars inspect`` of a capture that shows a strip of parts."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING

from bgars.cli.console import print_json, say, say_files, utc_now
from bgars.cli.inspect_files import NAMES, STRIP_FILES, Wanted, write_result
from bgars.errors import BgarsError
from bgars.io.atomic import atomic_folder
from bgars.line.job import place_serial
from bgars.line.strip_page import PlaceRow, place_row, strip_csv, write_strip_page
from bgars.pipelines.strip import inspect_place, part_of_strip, places_of_strip

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from bgars.normals.methods import Method
    from bgars.records.capture import Capture
    from bgars.records.part_identity import PartIdentity
    from bgars.records.part_recipe import PartRecipe
    from bgars.records.strip_layout import StripLayout

__all__ = ["inspect_strip", "tell_strip"]


def inspect_strip(
    capture: Capture,
    recipe: PartRecipe,
    strip: StripLayout,
    output: Path,
    overview: Path,
    wanted: Wanted,
    method: Method,
    serial: str,
    identity: PartIdentity,
    told: tuple[str, ...],
    report: Callable[[str, float], object],
) -> list[PlaceRow]:
    """Inspect every part of a strip into ``output/PLACE``, and write the overview; return a row per part.

    A part that cannot be inspected is a row of verdict "error" and does not stop the others. `told`: what the check of
    the capture found.
    """
    places = places_of_strip(capture, recipe)
    carrier = replace(identity, substrate=identity.substrate or serial)
    rows = []
    for place in places:
        own = place_serial(serial, place.name)
        try:
            result = inspect_place(
                capture, recipe, place.name, method=method, surface=wanted.page, check=False, progress=report
            )
        except BgarsError as error:
            reason = " ".join(str(error).split())
            rows.append(PlaceRow(place.name, own, "error", reason, 0, None, None, None, None, utc_now()))
            continue
        result = replace(result, serial=own, identity=replace(carrier, position=place.name), inspected_utc=utc_now())
        result = replace(result, warnings=(*told, *result.warnings))
        with atomic_folder(output / place.name, NAMES) as folder:
            write_result(result, part_of_strip(capture, strip, place), folder, wanted)
        rows.append(place_row(result, f"{place.name}/report.html" if wanted.page else ""))
    name = serial or capture.name
    facts = [f"recipe {recipe.name}", identity.lot and f"lot {identity.lot}", identity.station, rows[-1].inspected_utc]
    write_strip_page(overview / "strip.html", f"Strip {name}", facts, strip, rows)
    (overview / "parts.csv").write_text(strip_csv(name, rows), encoding="utf-8")
    return rows


def tell_strip(rows: list[PlaceRow], output: Path, *, as_json: bool, log_line: bool) -> None:
    """Print the parts of a strip."""
    if as_json:
        print_json({"parts": [row._asdict() for row in rows], "output": list(STRIP_FILES)})
        return
    if log_line:
        for row in rows:
            say(f"place={row.place} serial={row.serial or 'null'} verdict={row.verdict}")
        return
    counts = Counter(row.verdict for row in rows)
    say(f"{len(rows)} parts: {', '.join(f'{count} {verdict}' for verdict, count in counts.items())}")
    for row in rows:
        say(f"  {row.place:8}{row.verdict:11}{row.reason}".rstrip())
    say()
    say_files(output, STRIP_FILES)
    say(f"Each part has a folder of its own: {output / rows[0].place}, ...")
