"""The page of a check: a picture for each finding, and what to do."""

from __future__ import annotations

from importlib.metadata import version
from typing import TYPE_CHECKING

from jinja2 import Environment, PackageLoader, StrictUndefined

from bgars.report.figures.check_pictures import finding_pictures

if TYPE_CHECKING:
    from bgars.records.capture import Capture
    from bgars.records.findings import Findings

__all__ = ["check_page"]


def check_page(capture: Capture, findings: Findings) -> str:
    """Return the page as HTML text: one file, no script, no network, every text escaped.

    Parameters
    ----------
    capture : Capture
    findings : Findings
        Of this capture.
    """
    environment = Environment(
        loader=PackageLoader("bgars.report.html", "template"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("check.html.j2").render(
        name=capture.name,
        findings=[(finding, finding_pictures(capture, finding)) for finding in findings],
        version=version("bgars"),
    )
