"""What mkdocs does not do alone: pages that are made (API reference, notebooks, changes), links that leave docs/."""

from __future__ import annotations

import re
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from api_pages import api_pages
from mkdocs.structure.files import File
from notebook_pages import notebook_pages

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.files import Files
    from mkdocs.structure.pages import Page

ROOT = Path(__file__).parents[2]
OUTSIDE = re.compile(r"\]\(\.\./([^)]+)\)")
"""A link of docs/ to a file of the repository that is not on the site."""
NAMED_PAGE = re.compile(r"\bdocs/(\w+)\.md\b")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that no file of docs/ holds."""
    made: dict[str, str | bytes] = {**api_pages(), "changelog.md": _changes()}
    with tempfile.TemporaryDirectory() as folder:
        made |= notebook_pages(Path(folder))
    for path, content in made.items():
        files.append(File.generated(config, path, content=content))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:  # noqa: ARG001
    """Point links that leave docs/ at the repository."""
    return OUTSIDE.sub(rf"]({config.extra['repository']}/blob/main/\1)", markdown)


def _changes() -> str:
    """CHANGELOG.md, with the pages it names as links."""
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    return NAMED_PAGE.sub(r"[\1](\1.md)", text)
