"""Which part it is stands in every record, on every page and on every picture."""

from __future__ import annotations

import json
from pathlib import Path

import bgars
import pytest
from bgars.cli.app import app
from bgars.report.identity import identity_facts, identity_line
from line_captures import copy_capture
from stored_parts import part
from typer.testing import CliRunner


def test_the_words_of_a_part_are_those_of_its_result() -> None:
    values = part(1).to_dict()
    facts = dict(identity_facts(values))
    assert facts["serial number"] == "SN0001"
    assert (facts["lot"], facts["station"], facts["operator"]) == ("L1", "S1", "ada")
    assert (facts["recipe"], facts["bgars"]) == ("p.toml", bgars.__version__)
    assert identity_line(values).startswith("serial number SN0001 · lot L1")
    assert bgars.PartIdentity().known() == {}


def test_an_identity_is_one_printable_line() -> None:
    for bad in ("two\nlines", "x" * 201, 7):
        with pytest.raises(bgars.InputError, match="lot: must be one printable line"):
            bgars.PartIdentity(lot=bad)


def test_a_result_of_version_3_is_read_without_identity(tmp_path: Path) -> None:
    values = part(0).to_dict() | {"format_version": 3}
    del values["identity"]
    path = tmp_path / "result.json"
    path.write_text(json.dumps(values))
    assert bgars.read_result(path).identity == bgars.PartIdentity()
    path.write_text(part(0).to_json())
    assert bgars.read_result(path).identity == part(0).identity


def test_one_inspection_takes_its_identity_from_side_file_and_options(tmp_path: Path) -> None:
    folder = copy_capture(tmp_path / "part")
    with (folder / "capture.toml").open("a") as file:
        file.write('\n[part]\nserial = "SN5"\nlot = "L2"\n')
    out = tmp_path / "out"
    CliRunner().invoke(
        app, ["inspect", str(folder), "-o", str(out), "--lot", "other", "--station-name", "S9", "--parquet"]
    )
    result = bgars.read_result(out)
    assert (result.serial, result.identity.lot, result.identity.station) == ("SN5", "L2", "S9")
    assert result.identity.captured_utc
    page = (out / "report.html").read_text(encoding="utf-8")
    header = page[page.index("<header") : page.index("</header>")]
    for words in ("SN5", "L2", "S9"):
        assert words in header
    parquet = pytest.importorskip("pyarrow.parquet")
    assert parquet.read_table(out / "balls.parquet")["part_lot"][0].as_py() == "L2"


def test_pictures_say_which_part_they_show(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from bgars.report.figures import style as part_style  # noqa: PLC0415

    capture = bgars.read_capture(bgars.sample_capture())
    result = bgars.inspect(capture)
    said: list[str] = []
    monkeypatch.setattr(part_style, "save", lambda figure, _: said.append(figure.texts[-1].get_text()))
    bgars.write_part_pictures(result, capture, tmp_path)
    assert len(said) == 4
    assert all("capture one_ball" in line for line in said)


def test_the_demo_of_a_line_finds_the_defects_that_were_put_in(tmp_path: Path) -> None:
    run = CliRunner().invoke(app, ["demo", "line", "-o", str(tmp_path / "demo"), "--parts", "4", "--json"])
    told = json.loads(run.output)
    assert told["defects_put_in"] == ["SN0002", "SN0003", "SN0004"]
    assert told["failed"] == told["defects_put_in"]
    assert (tmp_path / "demo" / "store" / "pages" / "SN0003.html").is_file()
    assert 'href="SN0003.html"' in Path(told["page"]).read_text(encoding="utf-8")
