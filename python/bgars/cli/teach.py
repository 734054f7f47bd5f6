"""The command ``bgars teach``: a part recipe from golden parts."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import bgars
from bgars.cli.console import print_json, say, stage_progress, warn
from bgars.cli.options import StationOption
from bgars.cli.station_output import need_different
from bgars.errors import InputError
from bgars.files.counted import counted
from bgars.inspection.judge import OWN_PITCH
from bgars.io.atomic import atomic_file
from bgars.records.same_images import refuse_seen
from bgars.station.teach import compact_names, teach_text
from bgars.station.teach import teach as learn

__all__ = ["register"]

PART_AGAIN = "every part must have images of its own"


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("teach")(teach)


def teach(
    golden: Annotated[
        list[Path],
        typer.Argument(metavar="GOLDEN", help="Capture folders of parts that are good.", show_default=False),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="PART.toml", help="Part recipe to write.", show_default=False)
    ],
    name: Annotated[str, typer.Option(help="Name of the part; the file's name by default.", show_default=False)] = "",
    station: StationOption = None,
    accept_doubts: Annotated[bool, typer.Option("--accept-doubts", help="Learn although a ball is in doubt.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing recipe.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of text.")] = False,
) -> None:
    """Write a part recipe from golden parts: layout, empty places, nominal sizes, and limits by a rule the file states.

    The limits are what these parts keep with a margin; limits from a drawing are better. Exit code 2 where the parts
    differ, or one is in doubt: a ball unlike its fellows, or a missing one.
    """
    _check_place(output, force=force)
    need_different(golden, PART_AGAIN)
    results = []
    seen: dict[str, str] = {}
    with stage_progress() as report:
        for index, folder in enumerate(golden):
            capture = bgars.read_capture(folder, station=station)
            refuse_seen(capture, seen, PART_AGAIN)
            results.append(bgars.inspect(capture))
            _need_separate_balls(folder, results[-1])
            for words in results[-1].warnings:
                if words != OWN_PITCH:
                    warn(f"{folder}: {words}")
            report("golden", (index + 1) / len(golden))
    taught = learn(results, name or output.stem, accept_doubts=accept_doubts)
    with atomic_file(output) as place:
        place.write_text(teach_text(taught), encoding="utf-8")
        recipe = bgars.read_part_recipe(place)
    if as_json:
        print_json({**recipe.to_dict(), "file": str(output), "parts": taught.parts})
        return
    empty = ", ".join(compact_names(taught.depopulated, taught.rows, taught.cols))
    say(
        f"{taught.name}: {taught.rows} x {taught.cols} places, {len(taught.depopulated)} of them empty"
        f"{f' ({empty})' if empty else ''}, pitch {taught.pitch_um:.1f} um,"
    )
    say(f"balls of {taught.diameter_um:.1f} um, {taught.height_um:.1f} um high, from {counted(taught.parts, 'part')}.")
    for words in taught.doubts:
        say(f"Accepted although in doubt: {words}")
    say(f"Written: {output}. Check its limits before you use it.")


def _need_separate_balls(folder: Path, result: bgars.PartResult) -> None:
    """Raise InputError where balls are bridged: that is no layout of a good part."""
    bridged = [ball.name for ball in result.balls if ball.present and ball.kind == "bridged"]
    if bridged:
        msg = f"{folder}: bridged balls: {', '.join(bridged)}; a golden part has none"
        raise InputError(msg)


def _check_place(output: Path, *, force: bool) -> None:
    """Raise InputError where writing would replace a file that is not to be replaced: before long work."""
    if not output.exists():
        return
    if output.is_dir():
        msg = f"{output}: is a folder; name a file, such as {output / 'part.toml'}"
        raise InputError(msg)
    if not force:
        msg = f"{output}: exists; --force replaces it"
        raise InputError(msg)
    try:
        bgars.read_part_recipe(output)
    except bgars.BgarsError as error:
        # Recipes bear no mark of bgars, as people write them: what cannot be read as one may be anything.
        msg = f"{output}: exists and is not a part recipe, which is all that --force replaces; name another file"
        raise InputError(msg) from error
