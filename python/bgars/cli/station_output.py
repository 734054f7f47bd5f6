"""Where ``bgars calibrate`` and ``bgars verify`` keep what they found: a station file and its page."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import bgars
from bgars.cli.console import say, utc_now
from bgars.errors import FileFormatError, InputError
from bgars.io.own_files import need_new_or_own
from bgars.io.recipe import RECIPE_NAME
from bgars.io.station_file import is_station_file, read_station, write_station
from bgars.records.remark import Remark
from bgars.records.station_sections import section_of
from bgars.report.html.station_page import write_station_page
from bgars.station.agreement import agreement

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from pathlib import Path

    from bgars.records.station import Station

__all__ = [
    "existing_station", "keep_part", "need_different", "need_places", "shown_severity", "tell_findings", "write_pages",
]  # fmt: skip


def existing_station(path: Path, *inputs: Path | None) -> Station:
    """Return the station of a file, or a new one where there is no file yet; `inputs` are folders that are read.

    Raises
    ------
    FileFormatError, InputError
        A name that cannot be one of a station, a place among the images that are read, or a file there, or beside it,
        that bgars did not write.
    """
    if path.name == RECIPE_NAME:
        msg = f"{path}: is the name of the description of a capture; name the station file otherwise"
        raise InputError(msg)
    if path.suffix.lower() != ".toml":
        msg = f"{path}: a station file must end in .toml"
        raise InputError(msg)
    if not path.parent.is_dir():
        msg = f"{path}: cannot be written (no such folder)"
        raise FileFormatError(msg)
    for folder in inputs:
        if folder is not None and folder.resolve() == path.parent.resolve():
            msg = f"{path}: is in {folder}, which this command reads; put the station file elsewhere"
            raise InputError(msg)
    need_places(path)
    if not path.exists():
        return bgars.Station(path.stem)
    if not is_station_file(path):
        msg = f"{path}: exists and is not a station file; name another one"
        raise InputError(msg)
    return read_station(path)


def need_places(path: Path) -> None:
    """Raise InputError where a file beside the station would be replaced that bgars did not write."""
    for beside in (path.with_suffix(".html"), path.with_suffix(".balls.svg"), path.with_name(f"{path.stem}.flat.npz")):
        need_new_or_own(beside)


def need_different(folders: Iterable[Path], what: str) -> None:
    """Raise InputError where a folder comes twice: a copy repeats perfectly, and says nothing new."""
    seen: set[Path] = set()
    for folder in folders:
        place = folder.resolve()
        if place in seen:
            msg = f"{folder}: is given twice; {what}"
            raise InputError(msg)
        seen.add(place)


def keep_part(
    output: Path,
    parts: dict[str, Any],
    findings: tuple[Remark, ...],
    name: str | None = None,
    draw: Callable[[], object] | None = None,
) -> tuple[Remark, ...]:
    """Write the station with its new parts, and its page; what was found of the old ones goes.

    Returns the findings and what the station as a whole adds to them. `draw` writes the pictures of the page, once it
    is sure that the parts fit together.

    Raises
    ------
    CalibrationError
        Parts that do not fit together; nothing is written then.
    """
    known = existing_station(output)
    station = replace(known, **parts, calibrated_utc=utc_now(), name=name or known.name)
    findings = (*findings, *agreement(station))
    if known.verified:
        message = (
            f"the comparison with a part of known sizes of {known.verified_utc} was that of the station before, and is "
            "dropped: verify it again"
        )
        findings = (*findings, Remark("note", message, "outdated"))
        station = replace(station, verified=(), verified_utc="")
    if draw is not None:
        draw()
    write_pages(station, [*parts, "verified", "whole"], findings, output)
    return findings


def write_pages(station: Station, parts: Iterable[str], findings: tuple[Remark, ...], output: Path) -> None:
    """Write a station and its page, with new findings in place of those of the same parts."""
    codes, new = {finding.code for finding in findings}, set(parts)
    kept = [one for one in station.findings if one.code not in codes and section_of(one.code) not in new]
    station = replace(station, findings=(*kept, *findings))
    write_station(station, output)
    write_station_page(station, output.with_suffix(".html"))


def shown_severity(finding: Remark) -> str:
    """The word before a message: what a station file keeps as a doubt is a warning to whoever runs the command."""
    return "warning" if finding.severity == "doubt" else finding.severity


def tell_findings(findings: tuple[Remark, ...], output: Path) -> None:
    """Say what was noticed, and where the result is."""
    for finding in findings:
        say(f"{shown_severity(finding)}: {finding.message}")
    say(f"Written: {output}, and its page {output.with_suffix('.html')}")
