"""The page on captures lists what the code reads."""

from __future__ import annotations

from pathlib import Path

import bgars
import pytest
from bgars.files.light_formats import LIGHT_FORMATS
from bgars.io.image_formats import IMAGE_FORMATS
from bgars.io.recipe import CaptureRecipe
from bgars.io.strict_toml import checked
from bgars.io.toml_text import read_values

PAGE = Path(__file__).parents[2] / "docs" / "captures.md"


def rows() -> dict[str, str]:
    lines = PAGE.read_text(encoding="utf-8").splitlines()
    return {line.split("|")[1].strip(): line for line in lines if line.startswith("|")}


@pytest.mark.parametrize("kind", [*LIGHT_FORMATS, *IMAGE_FORMATS], ids=lambda kind: kind.name)
def test_every_format_has_its_row(kind: object) -> None:
    row = rows()[kind.name]  # type: ignore[attr-defined]
    for suffix in kind.suffixes:  # type: ignore[attr-defined]
        assert f"`{suffix}`" in row


def test_the_recipe_of_the_page_is_valid(tmp_path: Path) -> None:
    text = PAGE.read_text(encoding="utf-8")
    block = text[text.index("```toml") + 8 :].partition("```")[0]
    path = tmp_path / "capture.toml"
    path.write_text("\n".join(line.strip() for line in block.splitlines()), encoding="utf-8")
    recipe = checked(CaptureRecipe, read_values(path), path)
    assert recipe.lights is not None
    assert len(bgars.LightRig.from_angles(recipe.lights.angles_deg)) == 8  # type: ignore[arg-type]
