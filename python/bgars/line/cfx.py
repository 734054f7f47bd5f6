"""A result as an IPC-CFX message ``UnitsInspected``, for a factory's message broker."""

from __future__ import annotations

import math
import uuid
from typing import TYPE_CHECKING, Any, NamedTuple

from bgars.errors import InputError
from bgars.inspection.decision import decide
from bgars.records.keys import DIGITS

if TYPE_CHECKING:
    from bgars.records.ball_result import BallResult, Verdict
    from bgars.records.part_result import PartResult

__all__ = ["CFX_VERSION", "to_cfx"]

CFX_VERSION = "2.1"
MESSAGE = "CFX.Production.TestAndInspection.UnitsInspected"
RESULTS = {"pass": "Passed", "fail": "Failed", "undecided": "Error"}
"""CFX has no "undecided": "could not be completed" is the nearest that is not a pass."""
NOT_JUDGED = "Skipped"
UNVERIFIED = "NotVerifiedYet"
READINGS = {
    "true_position_um": ("true_position_um", "BALL_POSITION", "PinShifted"),
    "diameter_um": ("diameter_um", "BALL_DIAMETER", "SolderDefect"),
    "top_um": ("height_um", "BALL_HEIGHT", "WrongPinHeight"),
    "aspect_ratio": ("aspect_ratio", "BALL_SHAPE", "SolderDefect"),
    "flat_top_depth_um": ("flat_top_depth_um", "BALL_SHAPE", "SolderDefect"),
}
"""Reading of a ball: its limit, and the code and CFX category of a ball that is outside."""
MICROMETRE, RATIO = "µm", ""
NAMESPACE = uuid.uuid5(uuid.NAMESPACE_URL, f"bgars:{MESSAGE}")


class _Reading(NamedTuple):
    """A measured quantity with its limits; None: there is no limit, and no verdict."""

    name: str
    value: float
    unit: str
    lowest: float | None
    highest: float | None
    verdict: Verdict | None


def to_cfx(result: PartResult, *, transaction_id: str | None = None, source: str | None = None) -> dict[str, Any]:
    """Return a result as the envelope of an IPC-CFX 2.1 message ``CFX.Production.TestAndInspection.UnitsInspected``.

    One inspection a ball and one for the part, with its measurements in µm and their limits; what was not measured has
    no measurement. "undecided" becomes ``Error``, a reading without a limit ``Skipped``. Identifiers follow from the
    result (UUID version 5): the same result gives the same message.

    Parameters
    ----------
    result : PartResult
        With ``inspected_utc``; the unit is its ``serial``, else its ``capture``.
    transaction_id : str, optional
        UUID of the work transaction that the line's ``WorkStarted`` named.
    source : str, optional
        CFX handle of the station.

    Returns
    -------
    dict
        Plain Python values, for ``json.dumps``.

    Raises
    ------
    InputError
        No time of inspection, or a transaction that is no UUID.

    References
    ----------
    IPC-2591, Connected Factory Exchange (CFX); names as in its published SDK 2.1.1.
    """
    if not result.inspected_utc:
        msg = "result.inspected_utc: a CFX message needs the time of inspection; bgars inspect stamps it, got none"
        raise InputError(msg)
    identity = _Identity(result)
    unit = {
        "UnitIdentifier": result.serial or result.capture or result.name,
        "UnitPositionNumber": None,
        "OverallResult": RESULTS[result.verdict],
        "Inspections": [*(_ball(ball, result, identity) for ball in result.balls), _part(result, identity)],
        "Verification": UNVERIFIED,
        "TotalInspectionCount": len(result.balls) + 1,
    }
    return {
        "MessageName": MESSAGE,
        "Version": CFX_VERSION,
        "TimeStamp": result.inspected_utc,
        "UniqueID": identity.of("message"),
        "Source": source,
        "Target": None,
        "RequestID": None,
        "MessageBody": {
            "$type": f"{MESSAGE}, CFX",
            "TransactionId": identity.of("transaction") if transaction_id is None else _uuid(transaction_id),
            "InspectionMethod": "AOI",
            "SamplingInformation": {"SamplingMethod": "NoSampling", "LotSize": None, "SampleSize": None},
            "Inspector": None,
            "RecipeName": None if result.recipe is None else result.recipe.name,
            "RecipeRevision": None,
            "InspectedUnits": [unit],
        },
    }


class _Identity:
    """UUIDs that follow from the result: its input files, its part and its time."""

    def __init__(self, result: PartResult) -> None:
        told = [result.inspected_utc, result.serial, result.capture, result.name, result.version]
        told += [digest for _, digest in result.files]
        self.space = uuid.uuid5(NAMESPACE, "\n".join(told))

    def of(self, what: str) -> str:
        return str(uuid.uuid5(self.space, what))


def _uuid(text: str) -> str:
    try:
        return str(uuid.UUID(text))
    except ValueError:
        msg = f"transaction_id: must be a UUID, got {text!r}"
        raise InputError(msg) from None


def _ball(ball: BallResult, result: PartResult, identity: _Identity) -> dict[str, Any]:
    what = f"ball {ball.name}"
    readings = []
    outside: dict[tuple[str, str], list[str]] = {}
    for name, (limit, code, category) in READINGS.items():
        value = getattr(ball, name)
        if not math.isfinite(value):
            continue
        allowed = None if result.recipe is None else result.recipe.limits.range_of(limit)
        unit = MICROMETRE if name.endswith("_um") else RATIO
        verdict: Verdict | None = None
        if allowed is not None:
            verdict, reason = decide(name, value, getattr(ball, f"u_{name}"), allowed)
            if verdict == "fail":
                outside.setdefault((code, category), []).append(reason)
        readings.append(_Reading(name, value, unit, *(allowed or (None, None)), verdict))
    defects = _defects(ball, outside) if ball.verdict == "fail" else {}
    return _inspection(what, ball.verdict, ball.reasons, readings, defects, identity, result.inspected_utc)


def _defects(ball: BallResult, outside: dict[tuple[str, str], list[str]]) -> dict[tuple[str, str], list[str]]:
    """Code and category of each defect of a failed ball, and its description."""
    told = list(ball.reasons)
    if not ball.present:
        return {("BALL_MISSING", "PinMissing"): told}
    if ball.kind == "bridged":
        return {("BALL_BRIDGED", "Short"): told}
    if ball.kind == "extra":
        return {("BALL_EXTRA", "Solderball"): told}
    return outside or {("BALL_DEFECT", "SolderDefect"): told}


def _part(result: PartResult, identity: _Identity) -> dict[str, Any]:
    """The part as a whole: its verdict, its reasons, its own quantities."""
    readings = [
        _Reading(check.name, check.value_um, MICROMETRE, check.lowest_um, check.highest_um, check.verdict)
        for check in result.checks
        if math.isfinite(check.value_um)
    ]
    defects = {
        (check.name.removesuffix("_um").upper(), "SolderDefect"): [check.reason]
        for check in result.checks
        if check.verdict == "fail"
    }
    return _inspection("part", result.verdict, result.reasons, readings, defects, identity, result.inspected_utc)


def _inspection(
    name: str,
    verdict: Verdict,
    reasons: tuple[str, ...],
    readings: list[_Reading],
    defects: dict[tuple[str, str], list[str]],
    identity: _Identity,
    time: str,
) -> dict[str, Any]:
    told = "; ".join(reasons) or None
    return {
        "UniqueIdentifier": identity.of(name),
        "InspectionName": name,
        "InspectionStartTime": None,
        "InspectionEndTime": None,
        "TestProcedure": None,
        "Comments": told,
        "Result": RESULTS[verdict],
        "Verification": UNVERIFIED,
        "VerificationDetail": None,
        "Error": told if verdict == "undecided" else None,
        "DefectsFound": [_defect(name, code, category, told, identity) for (code, category), told in defects.items()],
        "Symptoms": [],
        "Measurements": [
            _measurement(reading, number, identity.of(f"{name} {reading.name}"), time)
            for number, reading in enumerate(readings, 1)
        ],
        "RefNo": None,
    }


def _measurement(reading: _Reading, number: int, unique: str, time: str) -> dict[str, Any]:
    name, value, unit, lowest, highest, verdict = reading
    return {
        "$type": "CFX.Structures.NumericMeasurement, CFX",
        "MeasuredValue": {
            "Value": round(value, DIGITS),
            "ValueUnits": unit,
            "ExpectedValue": None,
            "ExpectedValueUnits": None,
            "MinimumAcceptableValue": lowest,
            "MinimumAcceptableValueUnits": None if lowest is None else unit,
            "MaximumAcceptableValue": highest,
            "MaximumAcceptableValueUnits": None if highest is None else unit,
        },
        "UniqueIdentifier": unique,
        "MeasurementName": name.removesuffix("_um"),
        "TimeRecorded": time,
        "Sequence": number,
        "Result": NOT_JUDGED if verdict is None else RESULTS[verdict],
        "CRDs": None,
    }


def _defect(name: str, code: str, category: str, told: list[str], identity: _Identity) -> dict[str, Any]:
    return {
        "UniqueIdentifier": identity.of(f"{name} {code}"),
        "DefectCode": code,
        "DefectCategory": category,
        "Description": f"{name}: {'; '.join(told)}",
        "Comments": None,
        "ComponentOfInterest": None,
        "RegionOfInterest": None,
        "DefectImages": [],
        "Priority": None,
        "ConfidenceLevel": None,
        "RelatedMeasurements": [],
        "RelatedSymptoms": [],
        "Verification": UNVERIFIED,
        "VerificationDetail": None,
    }
