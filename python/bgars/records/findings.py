"""What a check says: findings, each with what to do."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, get_args

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["GEOMETRY_KINDS", "KINDS", "Finding", "Findings", "Kind", "Severity"]

Kind = Literal[
    "order",
    "handedness",
    "below-surface",
    "duplicate",
    "dark",
    "clipped",
    "half-lit",
    "ambient",
    "vignetting",
    "motion",
    "focus",
    "noise",
    "response",
    "bit-depth",
    "lamp-dead",
    "lamp-uneven",
    "orientation",
]
Severity = Literal["note", "warning", "error"]

KINDS: tuple[Kind, ...] = get_args(Kind)
GEOMETRY_KINDS: frozenset[Kind] = frozenset(
    {"order", "handedness", "below-surface", "duplicate", "dark", "noise", "lamp-dead", "orientation"}
)
"""Errors of these kinds mean that every normal is wrong, not only less certain."""
RANK: dict[Severity, int] = {"error": 0, "warning": 1, "note": 2}


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong with a capture, or seems so.

    Attributes
    ----------
    kind : str
        One of :data:`KINDS`.
    severity : {"note", "warning", "error"}
        Error: numbers from this capture would be wrong. Warning: they would be worse than they need be.
    message : str
        What was seen, in plain words.
    advice : str
        What to do about it.
    image : int or None
        The image, counted from 0, where it is one.
    file : str or None
        Name of its file.
    value, limit : float or None
        What was measured, and from where on it is told, in `unit`.
    unit : str
        Unit of both.
    """

    kind: Kind
    severity: Severity
    message: str
    advice: str
    image: int | None = None
    file: str | None = None
    value: float | None = None
    limit: float | None = None
    unit: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return plain Python values, for JSON."""
        return {
            "kind": self.kind,
            "severity": self.severity,
            "image": self.image,
            "file": self.file,
            "message": self.message,
            "advice": self.advice,
            "value": self.value,
            "limit": self.limit,
            "unit": self.unit,
        }

    def __str__(self) -> str:
        return f"{self.severity}: {self.kind}: {self.message}; {self.advice}"


@dataclass(frozen=True)
class Findings:
    """All that a check found, the worst first.

    Attributes
    ----------
    findings : tuple of Finding
    not_judged : tuple of str
        What this capture holds no evidence on, in plain words.
    """

    findings: tuple[Finding, ...]
    not_judged: tuple[str, ...] = field(default=(), repr=False)

    @classmethod
    def of(cls, findings: list[Finding], not_judged: tuple[str, ...] = ()) -> Findings:
        """Sort findings, the worst first; among equals as they came."""
        return cls(tuple(sorted(findings, key=lambda each: RANK[each.severity])), not_judged)

    def __iter__(self) -> Iterator[Finding]:
        return iter(self.findings)

    def __len__(self) -> int:
        return len(self.findings)

    @property
    def errors(self) -> tuple[Finding, ...]:
        """Findings of severity error."""
        return tuple(each for each in self.findings if each.severity == "error")

    @property
    def geometry_errors(self) -> tuple[Finding, ...]:
        """Errors that make every normal wrong."""
        return tuple(each for each in self.errors if each.kind in GEOMETRY_KINDS)

    @property
    def told(self) -> tuple[Finding, ...]:
        """Warnings and errors: what every command says before any number."""
        return tuple(each for each in self.findings if each.severity != "note")

    def to_dict(self) -> dict[str, Any]:
        """Return plain Python values, for JSON."""
        return {"findings": [each.to_dict() for each in self.findings], "not_judged": list(self.not_judged)}

    def __repr__(self) -> str:
        told = ", ".join(
            f"{each.severity} {each.kind}" + ("" if each.image is None else f" (image {each.image})")
            for each in self.findings
        )
        return f"Findings({told or 'nothing found'})"
