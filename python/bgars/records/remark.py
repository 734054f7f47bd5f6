"""A remark about a calibration."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

__all__ = ["Remark", "Severity"]

Severity = Literal["note", "doubt", "fail"]


@dataclass(frozen=True)
class Remark:
    """Something that a calibration or a check of a station noticed.

    Attributes
    ----------
    severity : {"note", "doubt", "fail"}
        To know; to look at before the result is used; beyond a limit.
    message : str
        One line that names what, where and how much.
    code : str
        The same for machines, such as ``"light-moved"``.
    value, limit : float or None
        What was measured and what is allowed, in `unit`.
    unit : str
        Of both.
    light : int or None
        Which light it is about, from 0.
    """

    severity: Severity
    message: str
    code: str = ""
    value: float | None = None
    limit: float | None = None
    unit: str = ""
    light: int | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return plain Python values."""
        return dict(vars(self))
