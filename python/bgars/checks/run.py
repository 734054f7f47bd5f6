"""All checks of a capture, in the order in which one fault hides the next."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bgars.checks.ambient import check_ambient
from bgars.checks.below_surface import check_below, raised
from bgars.checks.bit_depth import check_bit_depth, check_few_levels
from bgars.checks.duplicates import check_all_alike, check_duplicates
from bgars.checks.exposure import check_clipped, check_dark, dead_lamps
from bgars.checks.focus import check_focus
from bgars.checks.gains import check_gains, gains_by_moments, gains_by_promise
from bgars.checks.half_lit import check_half_lit
from bgars.checks.moments import lit_everywhere, moments_by
from bgars.checks.motion import check_motion, find_move, registered, told_move
from bgars.checks.noise import check_drowned, check_noise
from bgars.checks.noise_levels import noise_curve, own_noise
from bgars.checks.odd_image import check_odd_image
from bgars.checks.orientation import check_orientation
from bgars.checks.response import check_format, check_noise_of_levels, check_response
from bgars.checks.table import check_table
from bgars.checks.view import TILES, make_view
from bgars.checks.vignetting import check_vignetting
from bgars.checks.windows import cut_windows, noise_of
from bgars.errors import InputError
from bgars.records.findings import Finding, Findings
from bgars.records.same_images import same_images
from bgars.records.whole_capture import need_whole

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bgars.checks.view import View
    from bgars.records.capture import Capture

__all__ = ["check_capture"]

MOST_CLIPPED = 0.5
"""Share of the image that is overexposed from which on images are not compared with each other."""
LEAST_CONDITIONING = 1e-6
"""27 det(L^T L) / tr(L^T L)^3 of the lights below which no method estimates normals (`MIN_CONDITIONING` of the core);
1 for three at right angles."""
MOTION_LOOKS_LIKE = {"duplicate", "order", "orientation", "half-lit", "noise", "response", "lamp-uneven"}
"""On texture, an image that lies elsewhere differs from what it should be by all but noise, those that moved with it
by noise alone."""
FEW_LIT = 200
"""Pixels of the small copy, lit by all lights and matt, below which noise and motion of one image are not judged."""


def check_capture(capture: Capture) -> Findings:
    """Check a capture before any number is made of it.

    A reduced copy is looked at (and three windows at full resolution), so that it costs little.

    Parameters
    ----------
    capture : Capture

    Returns
    -------
    Findings
        The worst first. A capture without evidence (a flat, evenly lit field) has no findings on what it cannot show.

    Raises
    ------
    InputError
        Lights in one plane, or all near one direction: nothing can be measured under them.
    """
    need_whole(capture)
    _refuse_flat_lights(capture)
    view = make_view(capture)
    inside = view.values.max(axis=0) > 0.0
    below = check_below(view)
    view = view.with_lights(raised(view.lights))
    kind = capture.images.dtype
    dark = check_dark(view, inside, float(2 ** (8 * kind.itemsize) - 1) if kind.kind == "u" else np.inf)
    if not inside.any() or any(each.severity == "error" for each in dark):
        return Findings.of(below + dark)
    alike = check_all_alike(capture)
    if alike:
        return Findings.of(below + alike)
    found = below + dead_lamps(view, inside) + check_bit_depth(capture)
    few = check_few_levels(capture)
    found += check_format(capture) + dark + check_clipped(view, inside)
    if any(each.kind == "clipped" and (each.value or 0.0) > MOST_CLIPPED for each in found):
        # What is clipped cannot be compared; a threshold clips what it does not blacken.
        return Findings.of([each for each in few if each.value == 1.0] + found)
    found += few
    curve = noise_curve(capture)
    drowned = check_drowned(curve)
    if any(each.severity == "error" for each in drowned):  # nor what is noise
        # In dark images noise is what darkness leaves, and more light the remedy.
        lost = [replace(each, severity="error") if each.kind == "dark" else each for each in found]
        return Findings.of(lost if dark else lost + drowned)
    if not drowned:
        drowned = check_noise_of_levels(capture, curve)
    gone = [each.image for each in found if each.kind == "lamp-dead" and each.image is not None]
    found += _between(capture, view, gone, drowned)
    if any(each.kind == "response" and each.severity != "note" for each in found):
        found = [each for each in found if each.kind != "response" or each.severity != "note"]
    return Findings.of([_with_file(each, capture) for each in found])


def _refuse_flat_lights(capture: Capture) -> None:
    directions = capture.rig.directions
    product = directions.T @ directions
    conditioning = 27.0 * float(np.linalg.det(product)) / max(float(np.trace(product)), 1e-12) ** 3
    if conditioning < LEAST_CONDITIONING:
        msg = (
            f"{capture.name}: the lights stand in one plane, or all near one direction (conditioning "
            f"{conditioning:.1e}, at least {LEAST_CONDITIONING:g} is needed), so that no surface can be measured; "
            "directions are x, y, z, and angles are in degrees"
        )
        raise InputError(msg)


def _with_file(finding: Finding, capture: Capture) -> Finding:
    if finding.image is None or finding.image >= len(capture.files):
        return finding
    return replace(finding, file=capture.files[finding.image].name)


def _between(capture: Capture, view: View, gone: list[int], levels: list[Finding]) -> list[Finding]:
    """Checks of images against each other; what is gone once an image that moved is put back is the motion's doing."""
    found = _compared(capture, view, gone, levels)
    if not found or found == levels or found[0].kind not in MOTION_LOOKS_LIKE:
        return found
    if same_images(capture.images) is not None:
        return found  # no motion leaves two images alike to the last bit
    kept = np.setdiff1d(np.arange(len(view.lights)), gone)
    move = find_move(capture, kept, view.lights[kept])
    if move is None:
        return found
    still = registered(capture, kept, move)
    again = _compared(still, make_view(still).with_lights(view.lights), gone, levels)
    # A turned image, or one under another light, that is shifted as well is no longer found, but is not right either.
    strict = found[0].kind in {"orientation", "order", "duplicate"}
    if any(each.kind == found[0].kind or (strict and each.severity != "note") for each in again):
        return found
    told = _renumbered([told_move(move, [view.names[index] for index in kept])], kept)
    return told + [each for each in again if each.kind != "motion"]


def _compared(capture: Capture, view: View, gone: list[int], levels: list[Finding]) -> list[Finding]:
    """Checks of images against each other, of those with light. `levels`: what is wrong with all grey levels."""
    alike = check_duplicates(capture, view)
    turned = check_orientation(view)
    if alike or turned:
        return alike + turned + levels
    kept = np.setdiff1d(np.arange(len(view.lights)), gone)
    for index in sorted(gone, reverse=True):
        view = view.without(index)
    if len(kept) < 4:  # noqa: PLR2004 - three images fit any surface
        return levels
    found, lights = check_table(capture, view)
    # A frame that is lit in part upsets all that follows, as it does the comparison of tables.
    lit = lit_everywhere(view, lights)
    by_moments = (
        None if int(lit.sum()) < FEW_LIT else gains_by_moments(moments_by(view, lit, view.tiles, TILES * TILES))
    )
    uneven, factors = check_gains(view, by_moments or gains_by_promise(view), lights)
    halves = check_half_lit(view.with_lights(lights))
    if halves and uneven:
        # A dim lamp is missing in what its image promises the others, more in some rows than in others.
        even = replace(view, values=view.values / factors.astype(np.float32)[:, None, None], lights=lights)
        without = {each.image for each in check_half_lit(even)}
        halves = [each for each in halves if each.image in without]
    if halves:
        return _renumbered(halves + [each for each in found if each.kind != "order"], kept) + levels
    if not found:
        found = check_odd_image(view)
        if found:
            return _renumbered(found, kept) + levels
    # All that follows compares grey levels as if they were light.
    return _renumbered(found, kept) + (
        levels or _renumbered(_single(capture, view, lights, kept, (lit, uneven, factors)), kept)
    )


def _single(
    capture: Capture,
    view: View,
    lights: NDArray[np.float64],
    kept: NDArray[np.intp],
    lamps: tuple[NDArray[np.bool_], list[Finding], NDArray[np.float64]],
) -> list[Finding]:
    """Checks of single images under the right table. `lamps`: pixels that all reach, uneven ones, their strengths."""
    lit, uneven, factors = lamps
    strengths = factors if len(factors) == len(capture.rig) else 1.0
    found = check_ambient(capture, lights, strengths) + check_vignetting(view.with_lights(lights), lit)
    blurred = check_focus(capture, kept, view.names)
    veiled = any(each.kind == "ambient" for each in found)
    few = int(lit.sum()) < FEW_LIT
    stated, lights = lights, lights * factors[:, None]
    # A dim lamp bends what its light leaves of the others; a curve stays once the lamps are as they are.
    curved = [] if veiled or not check_response(view, stated) else check_response(view, lights)
    if curved:
        return found + curved
    found += uneven
    if few:
        return found + blurred
    # A blurred image looks shifted, and less noisy; a noisy one may look shifted; a shifted one is as sharp as others.
    odd = blurred or check_noise(own_noise(capture, kept), np.inf, view.names)
    moved = odd or check_motion(capture, kept, lights, view.names)
    windows = None if moved or len(kept) != len(capture.rig) else cut_windows(capture, view)
    if windows is None:
        return found + moved
    return found + check_noise(noise_of(windows, lights), windows.level, view.names)


def _renumbered(found: list[Finding], kept: NDArray[np.intp]) -> list[Finding]:
    """Findings with the images' numbers in the capture."""
    return [each if each.image is None else replace(each, image=int(kept[each.image])) for each in found]
