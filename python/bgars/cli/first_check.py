"""What every command says of a capture before any number."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bgars.cli.console import error_console
from bgars.pipelines.check import check, refuse_wrong_geometry

if TYPE_CHECKING:
    from bgars.records.capture import Capture
    from bgars.records.findings import Finding, Findings

__all__ = ["check_first", "tell_first", "warn"]

WAY_OUT = "'bgars check' shows it; --force continues nevertheless"


def check_first(capture: Capture, *, force: bool) -> Findings:
    """Check a capture, print warnings and errors, stop where every number would be wrong.

    Raises
    ------
    InputError
        Errors of geometry without `force`.
    """
    return tell_first(capture, check(capture), force=force)


def tell_first(capture: Capture, findings: Findings, *, force: bool) -> Findings:
    """Print what the check of a capture found, and return it; raise as :func:`check_first` does."""
    if not force:
        refuse_wrong_geometry(findings, capture.name, way_out=WAY_OUT)
    for finding in findings.told:
        warn(finding)
    return findings


def warn(finding: Finding) -> None:
    """Print a finding on the error stream: one line."""
    console = error_console()
    style = "bold red" if finding.severity == "error" else "yellow"
    console.print(f"{finding.severity}:", style=style, end=" ")
    console.print(f"{finding.kind}: {finding.message}; {finding.advice}", markup=False)
