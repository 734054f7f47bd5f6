"""The registry of constants is whole, and its page is the generated one."""

import importlib
import runpy
from pathlib import Path
from typing import Any

import pytest

DOCS = Path(__file__).parents[2] / "docs"


@pytest.fixture(scope="module")
def made() -> dict[str, Any]:
    return runpy.run_path(str(DOCS / "make_constants.py"))


def test_the_registry_has_exactly_the_constants_that_exist(made: dict[str, Any]) -> None:
    assert made["mismatch"]() == []
    lines = (DOCS / "constants.tsv").read_text(encoding="utf-8").splitlines()
    assert len(lines) == 1 + len(made["constants"]()) == 1 + len(made["registry"]())


def test_every_constant_has_a_meaning_or_is_numerics(made: dict[str, Any]) -> None:
    kinds = made["registry"]()
    without = [
        f"{constant.module}.{constant.name}"
        for constant in made["constants"]()
        if not constant.meaning and kinds[constant.module, constant.name].kind != "numerics"
    ]
    assert without == []


def test_every_constant_that_is_no_numerics_says_what_chose_it(made: dict[str, Any]) -> None:
    silent = [name for name, entry in made["registry"]().items() if entry.kind != "numerics" and not entry.chosen_by]
    assert silent == []


def test_every_constant_is_used(made: dict[str, Any]) -> None:
    assert made["unused"]() == []


def test_tests_that_move_exist(made: dict[str, Any]) -> None:
    for name, entry in made["registry"]().items():
        if entry.test:
            file, test = entry.test.split()[0].split("::")
            assert f"def {test}(" in (Path(__file__).parent / Path(file).name).read_text(encoding="utf-8"), name


def test_the_page_is_the_generated_one(made: dict[str, Any]) -> None:
    page = (DOCS / "constants.md").read_text(encoding="utf-8")
    assert page == made["page_text"](), "run `make constants`"


def test_a_moved_constant_moves_what_is_derived_from_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(DOCS.parent / "benches"))
    module = tmp_path / "module.py"
    module.write_text(
        "A, B = 2.0, 3\nDOUBLE = 2 * A\n\ndef f(a: float = A) -> float:\n    return a\n", encoding="utf-8"
    )
    loader = importlib.import_module("move_constants").MovedLoader("module", str(module))
    loader.constant, loader.factor = "A", 1.5
    namespace: dict[str, Any] = {}
    exec(loader.get_code("module"), namespace)
    assert (namespace["A"], namespace["B"], namespace["DOUBLE"], namespace["f"]()) == (3.0, 3, 6.0, 3.0)
    loader.constant = "C"
    with pytest.raises(ImportError, match="module has no constant C"):
        loader.get_code("module")
