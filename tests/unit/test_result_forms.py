"""A result for other machines: a line for logs, Parquet, IPC-CFX."""

from __future__ import annotations

import json
import math
import re
import sys
from dataclasses import fields, replace
from pathlib import Path

import bgars
import pytest
from bgars.records.keys import keys_of
from cfx_names import ENUMERATIONS, MESSAGE_NAME, PROPERTIES, SUGGESTED_CATEGORIES, VERSION
from judged_parts import LIMITS, RECIPE, judged

KEYS = [
    *("time", "part", "serial", "capture", "verdict", "balls", "balls_pass", "balls_fail", "balls_undecided"),
    *("balls_missing", "bridges", "pitch_um", "seating_coplanarity_um", "u_seating_coplanarity_um"),
    *(
        "regression_coplanarity_um",
        "u_regression_coplanarity_um",
        "warpage_um",
        "reason",
        "warnings",
        "version",
        "round",
    ),
]
PAIR = re.compile(r'(\w+)=("(?:[^"\\]|\\.)*"|\S+)(?: |$)')


def parsed(line: str) -> dict[str, str]:
    assert "".join(match.group(0) for match in PAIR.finditer(line)) == line
    return {key: json.loads(value) if value.startswith('"') else value for key, value in PAIR.findall(line)}


def test_the_log_line_has_always_the_same_keys_and_one_line() -> None:
    good, bad = judged(), judged(None, defects={"B2": bgars.Defect.missing()})
    nasty = 'a "b" = c\nd\u2028\x85e\\'
    for result in (good, bad, replace(good, name=nasty, serial=nasty), replace(good, warpage_um=math.nan)):
        values = parsed(result.summary_line())
        assert list(values) == KEYS
        assert len(result.summary_line().splitlines()) == 1
        assert values["part"] == result.name
        assert values["verdict"] == result.verdict
    values = parsed(bad.summary_line())
    assert values["balls_missing"] == "1"
    assert float(values["seating_coplanarity_um"]) == pytest.approx(bad.seating_coplanarity_um, abs=1e-3)
    assert parsed(replace(good, warpage_um=math.nan).summary_line())["warpage_um"] == "null"


def test_the_log_lines_keys_are_documented() -> None:
    page = (Path(__file__).parents[2] / "docs" / "result.md").read_text(encoding="utf-8")
    row = next(line for line in page.splitlines() if line.startswith("`time part"))
    assert row.split("`")[1].split() == KEYS


def test_parquet_holds_every_reading_with_its_unit(tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    result = judged(defects={"B2": bgars.Defect.missing()})
    bgars.write_parquet(result, tmp_path / "balls.parquet")
    table = parquet.read_table(tmp_path / "balls.parquet")
    assert table.schema.metadata[b"format"] == b"bgars-result-balls"
    assert table.schema.metadata[b"format_version"] == b"5"
    for name in table.column_names:
        about = table.schema.field(name).metadata
        assert about[b"unit"] == (b"um" if name.endswith("_um") else b""), name
        assert len(about[b"description"]) > 10
    for row, ball in zip(table.to_pylist(), result.balls, strict=True):
        assert row["part_serial"] == "SN-1"
        for entry in fields(ball):
            if entry.name == "budget":
                continue
            value = getattr(ball, entry.name)
            known = not (isinstance(value, float) and math.isnan(value))
            assert row[entry.name] == ((list(value) if isinstance(value, tuple) else value) if known else None)
    assert set(keys_of(bgars.BallResult)) - {"budget"} <= set(table.column_names)
    empty = replace(result, balls=())
    bgars.write_parquet(empty, tmp_path / "none.parquet")
    assert parquet.read_table(tmp_path / "none.parquet").schema.equals(table.schema)


def test_without_pyarrow_the_message_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(bgars.InputError, match=r"pip install 'bgars\[parquet\]'"):
        bgars.write_parquet(judged(), tmp_path / "balls.parquet")
    assert list(tmp_path.iterdir()) == []


def names(*classes: str) -> set[str]:
    return {name for each in classes for name in PROPERTIES[each].split()}


CASES = {
    "pass": judged,
    "missing": lambda: judged(defects={"B2": bgars.Defect.missing()}),
    "bridge": lambda: judged(bridges=(bgars.Bridge("A1", "A2", radius_um=80.0),)),
    "outside": lambda: judged(defects={"B2": bgars.Defect.size(0.8), "A1": bgars.Defect.offset(200.0, 0.0)}),
    "undecided": lambda: judged(replace(RECIPE, limits=replace(LIMITS, true_position_um=2.5))),
    "no recipe": lambda: judged(None),
}


@pytest.mark.parametrize("name", list(CASES))
def test_cfx_uses_the_published_names_only(name: str) -> None:
    result = CASES[name]()
    message = bgars.to_cfx(result)
    json.dumps(message, allow_nan=False)
    assert set(message) == names("CFXEnvelope")
    assert (message["MessageName"], message["Version"]) == (MESSAGE_NAME, VERSION)
    body = message["MessageBody"]
    assert set(body) - {"$type"} <= names("UnitsInspected")
    assert body["$type"] == f"{MESSAGE_NAME}, CFX"
    assert body["InspectionMethod"] in ENUMERATIONS["InspectionMethod"]
    assert set(body["SamplingInformation"]) == names("SamplingInformation")
    (unit,) = body["InspectedUnits"]
    assert set(unit) == names("InspectedUnit")
    identifiers = [message["UniqueID"], body["TransactionId"]]
    for inspection in unit["Inspections"]:
        assert set(inspection) == names("Inspection")
        assert inspection["Result"] in ENUMERATIONS["TestResult"]
        assert inspection["Verification"] in ENUMERATIONS["VerificationResult"]
        identifiers.append(inspection["UniqueIdentifier"])
        for measurement in inspection["Measurements"]:
            assert set(measurement) - {"$type"} == names("Measurement", "NumericMeasurement")
            assert set(measurement["MeasuredValue"]) == names("NumericValue")
            assert measurement["Result"] in ENUMERATIONS["TestResult"]
            identifiers.append(measurement["UniqueIdentifier"])
        for defect in inspection["DefectsFound"]:
            assert set(defect) == names("Defect")
            assert defect["DefectCategory"] in SUGGESTED_CATEGORIES
            identifiers.append(defect["UniqueIdentifier"])
    assert len(set(identifiers)) == len(identifiers)
    assert bgars.to_cfx(result) == message


@pytest.mark.parametrize("name", list(CASES))
def test_cfx_says_what_the_result_says(name: str) -> None:
    result = CASES[name]()
    words = {"pass": "Passed", "fail": "Failed", "undecided": "Error"}
    (unit,) = bgars.to_cfx(result)["MessageBody"]["InspectedUnits"]
    assert unit["UnitIdentifier"] == "SN-1"
    assert unit["OverallResult"] == words[result.verdict]
    assert unit["TotalInspectionCount"] == len(unit["Inspections"]) == len(result.balls) + 1
    for ball, inspection in zip(result.balls, unit["Inspections"][:-1], strict=True):
        assert inspection["InspectionName"] == f"ball {ball.name}"
        assert inspection["Result"] == words[ball.verdict]
        assert bool(inspection["DefectsFound"]) == (ball.verdict == "fail")
        values = {row["MeasurementName"]: row for row in inspection["Measurements"]}
        assert ("top" in values) == math.isfinite(ball.top_um)
        if math.isfinite(ball.top_um):
            value = values["top"]["MeasuredValue"]
            assert (value["Value"], value["ValueUnits"]) == (round(ball.top_um, 6), "µm")
            limits = (value["MinimumAcceptableValue"], value["MaximumAcceptableValue"])
            assert limits == ((None, None) if result.recipe is None else (result.recipe.limits.height_um))
            within = 460.0 < ball.top_um < 540.0
            assert values["top"]["Result"] == ("Skipped" if result.recipe is None else "Passed" if within else "Failed")
    codes = {row["DefectCode"] for each in unit["Inspections"] for row in each["DefectsFound"]}
    assert result.verdict == {"pass": "pass", "undecided": "undecided", "no recipe": "undecided"}.get(name, "fail")
    expected = {"missing": "BALL_MISSING", "bridge": "BALL_BRIDGED", "outside": "BALL_DIAMETER"}
    assert (expected[name] in codes) if name in expected else (codes == set())


def test_cfx_without_a_time_or_with_a_wrong_transaction_is_refused() -> None:
    with pytest.raises(bgars.InputError, match=r"result\.inspected_utc"):
        bgars.to_cfx(replace(judged(), inspected_utc=""))
    with pytest.raises(bgars.InputError, match="transaction_id: must be a UUID, got 'x'"):
        bgars.to_cfx(judged(), transaction_id="x")
    wanted = "2c24590d-39c5-4039-96a5-91900cecedfa"
    assert bgars.to_cfx(judged(), transaction_id=wanted)["MessageBody"]["TransactionId"] == wanted
