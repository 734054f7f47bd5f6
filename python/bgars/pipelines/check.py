"""Check a capture, or a folder: what every command does before any number."""

from __future__ import annotations

import warnings
from concurrent.futures import ThreadPoolExecutor
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from bgars.checks.run import check_capture
from bgars.errors import BgarsError, CaptureWarning, InputError
from bgars.io.capture import read_capture
from bgars.records.capture import Capture

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import TypeAlias

    from bgars.records.findings import Findings

    Tell: TypeAlias = Callable[[Findings], tuple[str, ...]]

__all__ = ["check", "checked_beside", "refuse_wrong_geometry", "tell_before", "told_by"]

Done = TypeVar("Done")


def check(capture: Capture | str | PathLike[str]) -> Findings:
    """Check whether a capture shows what its description says.

    Order and handedness of the lights, lights below the surface, images twice, dead or uneven lamps, exposure, partly
    lit frames, ambient light, vignetting, motion, focus, noise, response and bit depth. It looks at a reduced copy.

    Parameters
    ----------
    capture : Capture or path
        A path is read with :func:`bgars.read_capture`.

    Returns
    -------
    Findings
        ``findings`` with the worst first; each has kind, severity ("note", "warning", "error"), image, message and
        advice. A flat field is no evidence: nothing is said of what a capture cannot show. Images that are all the
        same, black, or noise, are errors.

    Raises
    ------
    FileFormatError, InputError
        As :func:`bgars.read_capture`; and lights in one plane, or all near one direction.

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
    return check_capture(read_capture(Path(capture)) if isinstance(capture, str | PathLike) else capture)


def told_by(findings: Findings) -> tuple[str, ...]:
    """Return warnings and errors as texts, such as a result keeps."""
    return tuple(f"capture: {each.kind}: {each.message}; {each.advice}" for each in findings.told)


def tell_before(capture: Capture, *, stacklevel: int) -> Tell:
    """What a library call says of a capture before a number is made of it.

    Parameters
    ----------
    capture : Capture
    stacklevel : int
        Of the warnings, counted from what is returned.

    Returns
    -------
    callable
        Takes the findings. It returns what was found, each also a :class:`~bgars.CaptureWarning`, and raises InputError
        where every normal would be wrong.
    """

    def tell(findings: Findings) -> tuple[str, ...]:
        way_out = "bgars.check shows it; check=False continues nevertheless"
        refuse_wrong_geometry(findings, capture.name, way_out=way_out)
        texts = told_by(findings)
        for text in texts:
            warnings.warn(f"{capture.name}: {text.removeprefix('capture: ')}", CaptureWarning, stacklevel=stacklevel)
        return texts

    return tell


def checked_beside(
    capture: Capture, tell: Tell | None, work: Callable[[], Done], *, threads: int | None
) -> tuple[tuple[str, ...], Done]:
    """Check a capture on a thread of its own while the first work on it goes on.

    Parameters
    ----------
    capture : Capture
    tell : callable or None
        What is done with the findings, when the work ends; None = no check. What it refuses comes before what the work
        says: images in another order have no balls where their lights say so.
    work : callable
    threads : int or None
        With one thread the check comes first.

    Returns
    -------
    tuple of str
        What `tell` returned.
    object
        What the work returned.
    """
    if tell is None:
        return (), work()
    if threads == 1:
        return tell(check_capture(capture)), work()
    with ThreadPoolExecutor(1) as beside:
        findings = beside.submit(check_capture, capture)
        try:
            done = work()
        except BgarsError:
            tell(findings.result())
            raise
        return tell(findings.result()), done


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
        Lights in wrong order, mirrored or below the surface, an image twice or turned, a dead lamp, black images,
        noise and nothing else.
    """
    wrong = findings.geometry_errors
    if wrong:
        told = "; ".join(f"{each.message}: {each.advice}" for each in wrong)
        msg = f"{name}: {told} ({way_out})"
        raise InputError(msg)
