"""What is kept of a judged scene, as JSON."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from typing import Any

READINGS = ("x", "y", "diameter", "top")


@dataclass(frozen=True)
class Reading:
    """Measured minus true, and the standard uncertainty that was stated (None: none)."""

    error_um: float
    u_um: float | None


@dataclass(frozen=True)
class BallRecord:
    """A ball that is there: whether it breaks the recipe's limits (bad), and what was said of it."""

    name: str
    defect: str
    bad: bool
    present: bool
    verdict: str | None
    reasons: tuple[str, ...] = ()
    readings: dict[str, Reading] = field(default_factory=dict)

    @property
    def wrongly_passed(self) -> bool:
        """Whether a bad ball was passed."""
        return self.bad and self.verdict == "pass"


@dataclass(frozen=True)
class NormalsRecord:
    """Mean angle to the true normals on the balls, and how far its stated errors hold (shares of pixels)."""

    mean_deg: float | None = None
    measured: float | None = None
    within_1: float | None = None
    within_2: float | None = None
    error: str | None = None


@dataclass(frozen=True)
class SceneRecord:
    """A scene; `refused`: the reason of an InputError or CalibrationError, `crashed`: any other exception."""

    scene: str
    deviations: tuple[str, ...]
    pixel_um: float
    refused: str | None = None
    crashed: str | None = None
    verdict: str | None = None
    reasons: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    balls: tuple[BallRecord, ...] = ()
    invented: tuple[str, ...] = ()
    coplanarity: Reading | None = None
    part_bad: bool = False
    normals: dict[str, NormalsRecord] = field(default_factory=dict)
    seconds: float = 0.0

    @property
    def judged(self) -> bool:
        """Whether there is a result."""
        return self.refused is None and self.crashed is None

    @property
    def bad_part_passed(self) -> bool:
        """Whether a part with a bad ball or a coplanarity above its limit was passed."""
        return self.part_bad and self.verdict == "pass"


def to_json(record: SceneRecord, state: str) -> str:
    """Write a record; `state` says of which code and which files it is."""
    return json.dumps({"state": state, "record": asdict(record)}, indent=1, allow_nan=False)


def from_json(text: str, state: str) -> SceneRecord | None:
    """Read a record back, None where it is of another state."""
    kept = json.loads(text)
    return _scene(kept["record"]) if kept["state"] == state else None


def _scene(raw: dict[str, Any]) -> SceneRecord:
    balls = tuple(
        BallRecord(
            **{
                **ball,
                "reasons": tuple(ball["reasons"]),
                "readings": {name: Reading(**reading) for name, reading in ball["readings"].items()},
            }
        )
        for ball in raw["balls"]
    )
    normals = {name: NormalsRecord(**values) for name, values in raw["normals"].items()}
    coplanarity = Reading(**raw["coplanarity"]) if raw["coplanarity"] else None
    lists = {name: tuple(raw[name]) for name in ("deviations", "reasons", "warnings", "invented")}
    return SceneRecord(**{**raw, **lists, "balls": balls, "normals": normals, "coplanarity": coplanarity})
