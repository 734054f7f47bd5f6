"""Which part it is stands in every record, on every page and on every picture."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import bgars
import numpy as np
import pytest
from bgars.cli.app import app
from bgars.line.job import Job, run_job
from bgars.line.naming import identity_of
from bgars.report.figure_file import Drawn
from bgars.report.identity import identity_facts, identity_line
from line_captures import copy_capture
from matplotlib.figure import Figure
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


def test_a_result_without_a_round_is_read(tmp_path: Path) -> None:
    values = part(0).to_dict()
    del values["identity"]["round"]
    path = tmp_path / "result.json"
    path.write_text(json.dumps(values))
    assert bgars.read_result(path).identity == part(0).identity
    path.write_text(json.dumps(values | {"identity": values["identity"] | {"round": 0}}))
    with pytest.raises(bgars.FileFormatError, match=r"identity\.round"):
        bgars.read_result(path)
    for bad in (0, -1, True, 1.0, "2"):
        with pytest.raises(bgars.InputError, match="round: must be 1 or more"):
            bgars.PartIdentity(round=bad)


def test_a_part_that_comes_again_has_its_round_in_every_record(tmp_path: Path) -> None:
    store = bgars.open_store(tmp_path / "store", create=True)
    other = bgars.open_store(tmp_path / "store")  # another process
    assert other.known() == {}
    first, again = (replace(part(1), files=(("a.png", f"{n:064d}"),)) for n in range(2))
    assert store.append(first)
    assert not other.append(first), "what another process appended meanwhile is known"
    assert other.numbered(first).identity.round == 1
    assert other.append(again)
    reworked = store.numbered(again)
    assert reworked.identity.round == 2
    assert not store.append(again)
    rows = store.query("select round, result_json from parts join results using (part_key) order by round").to_pylist()
    assert [row["round"] for row in rows] == [1, 2]
    assert [json.loads(row["result_json"])["identity"]["round"] for row in rows] == [1, 2]
    assert dict(identity_facts(reworked.to_dict()))["round"] == "2"
    assert reworked.to_csv().splitlines()[0].endswith(",part_round")
    assert reworked.to_csv().splitlines()[1].endswith(",2")
    assert reworked.summary_line().endswith(" round=2")
    assert part(1).summary_line().endswith(" round=null")
    store.compact()
    store.refresh()
    assert store.numbered(again).identity.round == 2
    assert store.numbered(replace(part(1), files=(("a.png", f"{9:064d}"),))).identity.round == 3


def test_a_round_that_is_stated_counts(tmp_path: Path) -> None:
    store = bgars.open_store(tmp_path / "store", create=True)
    stated = replace(part(1), identity=replace(part(1).identity, round=4))
    store.append(stated)
    store.append(replace(part(1), files=(("a.png", f"{1:064d}"),)))
    assert sorted(store.query("select round from parts")["round"].to_pylist()) == [4, 5]
    assert store.numbered(replace(part(1), serial="")).identity.round is None
    folder = tmp_path / "SN7_r2"
    folder.mkdir()
    serial, identity = bgars.Naming("{serial}_r{round}").of_name(folder)
    assert (serial, identity.round) == ("SN7", 2)
    with pytest.raises(bgars.InputError, match="must follow the pattern"):
        bgars.Naming("{serial}_{round}").of_name(folder)
    (folder / "capture.toml").write_text("[part]\nround = 3\n")
    assert bgars.Naming("{serial}_r{round}").of_name(folder)[1].round == 3


def test_files_of_a_store_without_rounds_are_counted(tmp_path: Path) -> None:
    pyarrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    store = bgars.open_store(tmp_path / "store", create=True)
    for n, stamp in enumerate(("2026-01-02T00:00:00Z", "2026-01-01T00:00:00Z")):
        store.append(replace(part(1), inspected_utc=stamp, files=(("a.png", f"{n:064d}"),)))
    for path in (tmp_path / "store" / "parts").rglob("*.parquet"):
        old: pyarrow.Table = parquet.ParquetFile(path).read()
        parquet.write_table(old.drop_columns(["round"]), path)
    store = bgars.open_store(tmp_path / "store")
    rows = store.query("select round, inspected_utc from parts order by inspected_utc").to_pylist()
    assert [row["round"] for row in rows] == [1, 2]
    store.append(replace(part(1), inspected_utc="2026-01-03T00:00:00Z", files=(("a.png", f"{3:064d}"),)))
    assert sorted(store.query("select round from parts")["round"].to_pylist()) == [1, 2, 3]


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


def test_the_station_is_named_by_its_file_where_nothing_else_names_it(tmp_path: Path) -> None:
    capture = bgars.read_capture(bgars.sample_capture())
    response = bgars.ResponseCurve(np.array([0.0, 1.0]), np.array([0.0, 1.0]), 0.0)
    for file, name in (("st8.toml", "line 8"), ("none.toml", "station")):
        bgars.write_station(bgars.Station(name, response=response), tmp_path / file)
    folder = copy_capture(tmp_path / "SN1")
    described = (folder / "capture.toml").read_text(encoding="utf-8")
    for file, stated, common, expected in (
        ("st8.toml", "", "", "line 8"),
        ("st8.toml", "", "option", "option"),
        ("st8.toml", '[part]\nstation = "stated"\n', "option", "stated"),
        ("none.toml", "", "", ""),  # the name of a station that nobody named
    ):
        (folder / "capture.toml").write_text(f'station = "../{file}"\n{described}\n{stated}', encoding="utf-8")
        naming = bgars.Naming(common=bgars.PartIdentity(station=common))
        (outcome,) = run_job(Job(str(folder), naming=naming))
        assert outcome.result is not None, outcome.reason
        assert outcome.result.identity.station == expected
    _, identity = identity_of(capture, bgars.PartIdentity(), tmp_path / "st8.toml")
    assert identity.station == "line 8"


def test_pictures_say_which_part_they_show(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from bgars.report.figures import part_drawing  # noqa: PLC0415

    capture = bgars.read_capture(bgars.sample_capture())
    result = bgars.inspect(capture)
    said: list[str] = []
    as_it_is = part_drawing.drawn

    def drawn(figure: Figure) -> Drawn:
        said.append(figure.texts[-1].get_text())
        return as_it_is(figure)

    monkeypatch.setattr(part_drawing, "drawn", drawn)
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


@pytest.mark.parametrize("pattern", ["{lot}_{serial}", "{serial}_{position}", "{round}{serial}"])
def test_a_name_that_fits_in_two_ways_names_no_part(tmp_path: Path, pattern: str) -> None:
    with pytest.raises(bgars.InputError, match="in more than one way: serial number"):
        bgars.Naming(pattern).of_name(tmp_path / "12_A_3")
    assert bgars.Naming("{lot}_A_{serial}").of_name(tmp_path / "12_A_3")[0] == "3"
