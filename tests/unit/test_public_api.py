"""The public names and signatures are those of public_api.txt: a change is meant, and stands in the changelog."""

from __future__ import annotations

import difflib
import sys

import pytest
from public_api import FILE, public_api


@pytest.mark.skipif(sys.version_info >= (3, 14), reason="annotations are written in another way from Python 3.14 on")
def test_nobody_changed_the_public_names_by_accident() -> None:
    stored = FILE.read_text(encoding="utf-8")
    change = difflib.unified_diff(stored.splitlines(), public_api().splitlines(), "public_api.txt", "now", lineterm="")
    text = "\n".join(change)
    assert not text, f"{text}\nIf this is meant: make api, and a line in CHANGELOG.md"
