"""Check a capture, or a folder: what every command does before any number."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from bgars.checks.run import check_capture
from bgars.errors import InputError
from bgars.io.capture import read_capture
from bgars.records.capture import Capture

if TYPE_CHECKING:
    from os import PathLike

    from bgars.records.findings import Findings

__all__ = ["check", "refuse_wrong_geometry"]


def check(capture: Capture | str | PathLike[str]) -> Findings:
    """Find out whether a capture shows what its description says.

    Order and handedness of the lights, lights below the surface, images twice, dead or uneven lamps, exposure, frames
    lit in part, ambient light, vignetting, motion, focus, noise, response and bit depth. It looks at a reduced copy.

    Parameters
    ----------
    capture : Capture or path
        A path is read with :func:`bgars.read_capture`.

    Returns
    -------
    Findings
        ``findings`` with the worst first; each has kind, severity ("note", "warning", "error"), image, message and
        advice. A flat field is no evidence: nothing is said of what a capture cannot show.

    Raises
    ------
    FileFormatError, InputError
        As :func:`bgars.read_capture`.

    References
    ----------
    P. N. Belhumeur, D. J. Kriegman, A. L. Yuille, The bas-relief ambiguity, IJCV 35 (1999) 33-44.

    Examples
    --------
    >>> import bgars
    >>> from dataclasses import replace
    >>> capture = bgars.read_capture(bgars.sample_capture())
    >>> bgars.check(capture)
    Findings(nothing found)
    >>> mirrored = bgars.LightRig.from_directions(capture.rig.directions * [1, -1, 1])
    >>> bgars.check(replace(capture, rig=mirrored))
    Findings(error handedness)
    """
    return check_capture(capture if isinstance(capture, Capture) else read_capture(Path(capture)))


def refuse_wrong_geometry(findings: Findings, name: str, *, way_out: str) -> None:
    """Raise InputError where every normal would be wrong.

    Parameters
    ----------
    findings : Findings
    name : str
        Of the capture, for the message.
    way_out : str
        How to go on all the same.

    Raises
    ------
    InputError
        Lights in wrong order, mirrored or below the surface, an image twice or turned, a dead lamp.
    """
    wrong = findings.geometry_errors
    if wrong:
        told = "; ".join(f"{each.message}: {each.advice}" for each in wrong)
        msg = f"{name}: {told} ({way_out})"
        raise InputError(msg)
