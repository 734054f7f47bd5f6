"""The ways in which people write a table of lights down wrongly."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bgars.files.counted import counted

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bgars.records.findings import Kind

__all__ = ["HALF_TURN", "Hypothesis", "alternatives", "either", "half_turned", "reordered"]

Array = NDArray[np.float64]

SAME = 0.1
"""Largest distance of unit vectors of tables that are the same: 6 degrees, see `geometry.LINEAR`."""
HALF_TURN = np.array([-1.0, -1.0, 1.0])
NAMED = 12
SHORT = 3
"""Words up to which two causes that differ by no more are told in one sentence."""
ONE_TURNED = (
    ("x", "mirrored left to right", (-1.0, 1.0, 1.0)),
    ("y", "mirrored top to bottom", (1.0, -1.0, 1.0)),
    ("x and y", "turned by 180 degrees", (-1.0, -1.0, 1.0)),
)
"""What a turn or a mirror of one image does to the light that it shows."""
TURNS_DEG = (45.0, -45.0, 90.0, -90.0, 135.0, -135.0)


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """Another table of lights, and what was written down wrongly where it is the true one.

    Attributes
    ----------
    kind : str
    told : str
        The cause, in words.
    advice : str
    lights : (L, 3) float64
    """

    kind: Kind
    told: str
    advice: str
    lights: Array


def alternatives(lights: Array, names: Sequence[str], suspects: Sequence[int]) -> list[Hypothesis]:
    """Tables that differ from the given one, the most usual mistakes first; suspects swapped with each other image.

    The half turn (x and y both the wrong way round) is none of them: shading shows a bump so lit as a hollow lit from
    the other side, and only cast shadows tell (`cast_shadows.py`).
    """
    return _distinct(lights, _usual(lights, names, suspects))


def half_turned(lights: Array, names: Sequence[str], found: Hypothesis) -> Hypothesis | None:
    """Return the usual mistake that differs from another by half a turn; None where it is none."""
    table = found.lights * HALF_TURN
    return next((each for each in _usual(lights, names, ()) if np.abs(each.lights - table).max() < SAME), None)


def either(one: Hypothesis, two: Hypothesis) -> Hypothesis:
    """Both, where the images do not tell which."""
    first, second = one.told.split(), two.told.split()
    same = _alike(first, second)
    rest = min(_alike(first[::-1], second[::-1]), min(len(first), len(second)) - same)
    own, others = first[same : len(first) - rest], second[same : len(second) - rest]
    if own and max(len(own), len(others)) <= SHORT:
        words = [*first[: same + len(own)], "or", *others, *first[len(first) - rest :]]
    else:
        words = [*first[:-1], first[-1] + ";", "or", *(second[same:] if same > SHORT else second)]
    advice = one.advice if one.advice == two.advice else f"{one.advice}; or {two.advice}"
    return Hypothesis(one.kind, " ".join(words) + " (no cast shadow tells which)", advice, one.lights)


def _alike(first: list[str], second: list[str]) -> int:
    """Words with which both begin."""
    pairs = zip(first, second, strict=False)
    return next((at for at, (one, two) in enumerate(pairs) if one != two), min(len(first), len(second)))


def _usual(lights: Array, names: Sequence[str], suspects: Sequence[int]) -> list[Hypothesis]:
    """All of them, also those that shading cannot tell from each other."""
    flip = np.array([1.0, -1.0, 1.0])
    count = len(lights)
    found = [
        Hypothesis(
            "handedness",
            "the images show lights on the other side in y: y was counted down, or the lights clockwise, or the "
            "images are mirrored",
            "y must point up in the image, azimuths count counter-clockwise: change the sign of y in the table of "
            "lights (or mirror the images back)",
            lights * flip,
        ),
        Hypothesis(
            "handedness",
            "the images show lights on the other side in x: x has the wrong sign, or the camera looks through a mirror",
            "x must point right in the image: change the sign of x in the table of lights (or mirror the images back)",
            lights * np.array([-1.0, 1.0, 1.0]),
        ),
        Hypothesis(
            "handedness",
            f"lights and images run round the opposite way ({names[1]} shows the last light)",
            "number the lights counter-clockwise as seen in the image, or list the images the other way round",
            np.roll(lights[::-1], 1, axis=0),
        ),
        Hypothesis(
            "handedness",
            f"lights and images run in opposite order ({names[0]} shows the last light)",
            "reverse the list of lights, or of images",
            lights[::-1],
        ),
        Hypothesis(
            "handedness",
            "x and y are exchanged in the table of lights",
            "give x (right) first, then y (up)",
            lights[:, [1, 0, 2]],
        ),
        Hypothesis(
            "handedness",
            "x and y are exchanged in the table of lights with opposite sign",
            "give x (right) first, then y (up)",
            -lights[:, [1, 0, 2]] * np.array([1.0, 1.0, -1.0]),
        ),
    ]
    found += [
        Hypothesis(
            "order",
            f"images and lights are shifted by {_images(shift)}: {names[0]} shows light {shift % count}",
            "look for a missed or an extra trigger, or start the list of images at the other lamp (a camera turned "
            "against the ring looks the same)",
            np.roll(lights, -shift, axis=0),
        )
        for shift in sorted((each for each in range(-(count // 2), count // 2 + 1) if each), key=abs)
    ]
    found += _one_turned(lights, names, suspects)
    pairs = {(min(one, two), max(one, two)) for one in suspects for two in range(count) if one != two}
    for first, second in sorted(pairs):
        order = np.arange(count)
        order[[first, second]] = second, first
        found.append(
            Hypothesis(
                "order",
                f"{names[first]} and {names[second]} are swapped: each shows the other's light",
                "exchange them in the list of images, or their two lines in the table of lights",
                lights[order],
            )
        )
    found += [
        Hypothesis(
            "orientation",
            f"the images are turned by {turn:+.0f} degrees (counter-clockwise) against the table of lights",
            "turn the table of lights (azimuth0_deg), or the images back",
            lights @ _turned(turn).T,
        )
        for turn in TURNS_DEG
    ]
    return found


def _one_turned(lights: Array, names: Sequence[str], suspects: Sequence[int]) -> list[Hypothesis]:
    """One image turned or mirrored, or one line of the table."""
    return [
        Hypothesis(
            "orientation",
            f"{names[index]} shows its light on the other side in {axes}: the image is {how}, or {axes} has the wrong "
            "sign in its line of the table",
            "turn the image back, or change the sign",
            np.where(np.arange(len(lights))[:, None] == index, lights * np.array(signs), lights),
        )
        for index in suspects
        for axes, how, signs in ONE_TURNED
    ]


def reordered(lights: Array, names: Sequence[str], table: Array) -> Hypothesis:
    """The same lights in any other order: that of `table`."""
    nearest = np.argmax(lights @ table.T, axis=1)
    listed = ", ".join(names[index] for index in nearest[:NAMED]) + (", ..." if len(nearest) > NAMED else "")
    return Hypothesis(
        "order",
        f"images and lights are not in the same order: the table of lights fits {listed}",
        "list the images in that order (img2 comes before img10), or name the image of each light, as .lp files do",
        table,
    )


def _images(shift: int) -> str:
    return counted(abs(shift), "image")


def _turned(turn_deg: float) -> Array:
    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _distinct(lights: Array, found: list[Hypothesis]) -> list[Hypothesis]:
    """Leave out tables that shading cannot tell from an earlier one: the same, or the same after a half turn."""
    kept: list[Hypothesis] = []
    known = [lights]
    for each in found:
        tables = np.stack(known)
        for candidate in (each.lights, each.lights * HALF_TURN):
            if (np.abs(tables - candidate).max(axis=(1, 2)) < SAME).any():
                break
        else:
            kept.append(each)
            known.append(each.lights)
    return kept
