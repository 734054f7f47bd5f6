"""The demo of a line ends with the page of its lot, which opens where somebody sits."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest
from bgars.cli import console, demo_line
from bgars.cli.app import app
from typer.testing import CliRunner


@pytest.mark.parametrize(
    ("missing", "is_open"), [("nothing", True), ("terminal", False), ("display", False), ("somebody", False)]
)
def test_a_page_is_opened_only_where_somebody_sits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, missing: str, *, is_open: bool
) -> None:
    asked: list[str] = []
    monkeypatch.setattr("webbrowser.open", lambda url: asked.append(url) or True)
    here = SimpleNamespace(platform="linux", stdout=SimpleNamespace(isatty=lambda: missing != "terminal"))
    monkeypatch.setattr(console, "sys", here)
    monkeypatch.setenv("CI", "true" if missing == "somebody" else "")
    monkeypatch.setenv("DISPLAY", "" if missing == "display" else ":0")
    monkeypatch.setenv("WAYLAND_DISPLAY", "")
    assert console.open_page(tmp_path / "index.html") == is_open
    assert asked == ([(tmp_path / "index.html").as_uri()] if is_open else [])


@pytest.mark.parametrize("options", [[], ["--no-open"]])
def test_the_demo_opens_the_page_of_the_lot(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: list[str]
) -> None:
    asked: list[Path] = []
    monkeypatch.setattr(demo_line, "open_page", lambda page: asked.append(page) or True)
    monkeypatch.setattr(demo_line.Watch, "run", lambda *_, **__: None)  # of the line test_identity.py runs all
    monkeypatch.setattr(demo_line, "drop_part", lambda *_: None)
    monkeypatch.setattr(demo_line, "write_lot_page", lambda *_, **__: {"last": [], "verdicts": {}})
    run = CliRunner().invoke(app, ["demo", "line", "-o", str(tmp_path / "demo"), "--parts", "4", *options])
    page = tmp_path / "demo" / "store" / "pages" / "index.html"
    assert asked == ([] if options else [page])
    assert f"{'Open' if options else 'Opened'} {page}: yield" in run.output
