"""Sections of a station file that findings belong to."""

from __future__ import annotations

__all__ = ["WHOLE", "section_of"]

WHOLE = "sections-"
"""How the codes of findings begin that are about several sections."""
SECTIONS = {
    "flat": ("flat-structure", "flat-unsure", "evenness", "falloff", "flat-before-response"),
    "response": ("linear", "not-linear", "response-structure", "black-level"),
    "scale": ("grid", "distortion", "tilt", "distance", "heights", "oblong"),
    "verified": ("mpe", "mpe-open", "bias-", "slope-", "unread-", "outdated", "few-captures"),
    "whole": (WHOLE,),
}
"""How the codes of findings begin, by section of the station file; all others are of the lights."""


def section_of(code: str) -> str:
    """Return the section of a finding's code.

    Examples
    --------
    >>> section_of("bias-height"), section_of("two-highlights")
    ('verified', 'lights')
    """
    return next((name for name, starts in SECTIONS.items() if code.startswith(starts)), "lights")
