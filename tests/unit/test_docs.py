"""What people read holds together: links between pages lead somewhere, every page is on the site, notebooks run."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import bgars
import pytest
from bgars.normals import methods

ROOT = Path(__file__).parents[2]
SITE = ROOT / "docs" / "site"
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/*.md"), ROOT / "benches" / "README.md"])
NOTEBOOKS = sorted((ROOT / "examples" / "notebooks").glob("*.py"))
LINK = re.compile(r"\]\(([^)\s]+)\)")
MADE = ("changelog.md", "api/", "notebooks/")
"""Pages that docs/site makes."""


def prose(page: Path) -> str:
    """Text of a page without its code blocks."""
    return re.sub(r"(?ms)^ *```.*?^ *```", "", page.read_text(encoding="utf-8"))


def anchors(page: Path) -> set[str]:
    """Names of a page's headings, as GitHub and mkdocs make them."""
    headings = re.findall(r"(?m)^#+ (.*)", prose(page))
    return {re.sub(r"[^\w\- ]", "", heading).strip().lower().replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_lead_somewhere(page: Path) -> None:
    dead = []
    for link in LINK.findall(re.sub(r"`[^`\n]*`\B", "", prose(page))):
        path, _, anchor = link.partition("#")
        if "://" in link or link.startswith("mailto:") or (page.parent == ROOT / "docs" and path.startswith(MADE)):
            continue
        target = page.parent / path if path else page
        if not target.exists() or (anchor and anchor not in anchors(target)):
            dead.append(link)
    assert not dead


def test_what_is_looked_for_is_where_contributing_says() -> None:
    page = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    rows = re.findall(r"(?m)^\| [^|]+ \| `([^`]+)` \| `(\w+)` \|$", page)
    assert len(rows) > 10
    for file, name in rows:
        code = (ROOT / file).read_text(encoding="utf-8")
        assert re.search(rf"(?m)^ *(pub(\([a-z]+\))? )?(def|class|fn|struct) {name}\b", code), f"{file}: no {name}"


def test_every_page_is_in_the_navigation() -> None:
    listed = re.findall(r"[\w/]+\.md", (ROOT / "mkdocs.yml").read_text(encoding="utf-8"))
    there = {path.name for path in ROOT.glob("docs/*.md")}
    assert {name for name in listed if not name.startswith(MADE)} == there
    assert len(listed) == len(set(listed))
    notebooks = {f"notebooks/{path.stem}.md" for path in NOTEBOOKS} | {"notebooks/index.md"}
    assert {name for name in listed if name.startswith("notebooks/")} == notebooks


def test_every_public_name_is_in_the_reference() -> None:
    api_pages = runpy.run_path(str(SITE / "api_pages.py"))
    pages = api_pages["api_pages"]()
    shown = re.findall(r"(?m)^::: bgars\.(\w+)$", "\n".join(pages.values()))
    assert sorted(shown) == sorted(set(bgars.__all__) - {"__version__"})
    navigation = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    assert {f"      - {page}" for page in pages} <= set(navigation.splitlines())


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_run(notebook: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(methods, "_registered", dict(methods._registered))
    pyplot = pytest.importorskip("matplotlib.pyplot")
    pyplot.switch_backend("agg")
    try:
        runpy.run_path(str(notebook))
        assert pyplot.get_fignums()
    finally:
        pyplot.close("all")
