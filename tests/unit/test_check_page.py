"""The page of a check explains what is on it, and nothing else."""

from __future__ import annotations

import bgars
from bgars.records.findings import Finding, Findings
from bgars.report.html.check_page import check_page


def test_the_line_toward_the_lamp_is_explained_where_it_is_drawn() -> None:
    capture = bgars.read_capture(bgars.sample_capture())
    finding = Finding(kind="duplicate", severity="error", message="the same", advice="look", image=0)
    assert "orange line" in check_page(capture, Findings.of([finding]))
    empty = check_page(capture, Findings.of([]))
    assert "No faults found" in empty
    assert "orange line" not in empty
