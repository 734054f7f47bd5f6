"""Readings of rendered parts as they were last taken on purpose: what moves is seen, and asked for a reason."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from records import SceneRecord

__all__ = ["PINNED", "differences", "pin_of"]

PINNED = Path(__file__).parent / "pinned_readings.json"
MOVED = 0.02
"""Share of its standard uncertainty that a reading may differ by, and share that the uncertainty may."""
DIGITS = 5

Pin = dict[str, Any]


def pin_of(record: SceneRecord) -> Pin:
    """Verdicts and, of each ball, errors and uncertainties (um) of a judged part."""
    pin: Pin = {"verdict": record.verdict, "refused": record.refused, "invented": list(record.invented), "balls": {}}
    for ball in record.balls:
        readings = {
            name: [round(value, DIGITS) for value in (reading.error_um, reading.u_um or 0.0)]
            for name, reading in ball.readings.items()
        }
        pin["balls"][ball.name] = {"verdict": ball.verdict, **readings}
    if record.coplanarity is not None:
        value = record.coplanarity
        pin["coplanarity"] = [round(value.error_um, DIGITS), round(value.u_um or 0.0, DIGITS)]
    return pin


def differences(pin: Pin, pinned: Pin) -> list[str]:
    """In words, where a part differs from what is on record."""
    found = [name for name in ("verdict", "refused", "invented") if pin[name] != pinned[name]]
    if pin["balls"].keys() != pinned["balls"].keys():
        return [*found, "other balls"]
    rows = [(name, pin["balls"][name], pinned["balls"][name]) for name in pin["balls"]]
    rows.append(("part", {"coplanarity": pin.get("coplanarity")}, {"coplanarity": pinned.get("coplanarity")}))
    for name, now, then in rows:
        for reading in now.keys() | then.keys():
            if not _same(now.get(reading), then.get(reading)):
                found.append(f"{name} {reading}: {now.get(reading)}, on record {then.get(reading)}")
    return sorted(found)


def _same(now: Any, then: Any) -> bool:  # noqa: ANN401 - a verdict or a reading
    if not isinstance(now, list) or not isinstance(then, list):
        return bool(now == then)
    limit = MOVED * max(then[1], 1e-3)
    return abs(now[0] - then[0]) <= limit and abs(now[1] - then[1]) <= limit
