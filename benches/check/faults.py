"""One fault each, put into a good capture: of every kind, from gross down to where it begins to matter."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import bgars
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, shift

__all__ = ["FAULTS", "Fault", "causes", "shown", "spoil"]

Fault = Callable[[bgars.Capture, np.random.Generator], bgars.Capture]
Array = NDArray[np.float64]
SAME_CAUSE: dict[str, set[str]] = {
    # On an even ring these are one and the same fault, in the images and in what to do.
    "listed clockwise": {"handedness", "order"},
    "listed in opposite order": {"handedness", "order"},
    "camera turned": {"orientation", "order"},
    "half turn": {"order", "orientation", "handedness"},
}


def _rig(capture: bgars.Capture, directions: Array) -> bgars.Capture:
    rig = bgars.LightRig.from_directions(directions, intensities=capture.rig.intensities)
    return replace(capture, rig=rig)


def _levels(capture: bgars.Capture) -> Array:
    return capture.images.astype(np.float64)


def _top(capture: bgars.Capture) -> float:
    """Largest grey level of the files."""
    return 255.0 if capture.images.dtype == np.uint8 else 65535.0


def _stored(capture: bgars.Capture, levels: Array) -> bgars.Capture:
    """Levels as the camera writes them."""
    whole = np.rint(np.clip(levels, 0, _top(capture)))
    return replace(capture, images=whole.astype(np.uint8) if _top(capture) < 256 else whole.astype(np.uint16))


def _one(capture: bgars.Capture, random: np.random.Generator) -> int:
    return int(random.integers(len(capture.images)))


def _offset(capture: bgars.Capture) -> Array | float:
    return capture.black_level if capture.dark is None else capture.dark.astype(np.float64)


def y_down(capture: bgars.Capture, _: np.random.Generator) -> bgars.Capture:
    return _rig(capture, capture.rig.directions * [1, -1, 1])


def x_mirrored(capture: bgars.Capture, _: np.random.Generator) -> bgars.Capture:
    return _rig(capture, capture.rig.directions * [-1, 1, 1])


def images_mirrored(capture: bgars.Capture, _: np.random.Generator) -> bgars.Capture:
    dark = None if capture.dark is None else np.ascontiguousarray(capture.dark[:, ::-1])
    return replace(capture, images=np.ascontiguousarray(capture.images[:, :, ::-1]), dark=dark)


def clockwise(capture: bgars.Capture, _: np.random.Generator) -> bgars.Capture:
    return _rig(capture, np.roll(capture.rig.directions[::-1], 1, axis=0))


def opposite(capture: bgars.Capture, _: np.random.Generator) -> bgars.Capture:
    return _rig(capture, capture.rig.directions[::-1])


def shifted(capture: bgars.Capture, random: np.random.Generator) -> bgars.Capture:
    return _rig(capture, np.roll(capture.rig.directions, int(random.choice([-1, 1])), axis=0))


def swapped(capture: bgars.Capture, random: np.random.Generator) -> bgars.Capture:
    order = np.arange(len(capture.images))
    first = _one(capture, random)
    second = (first + int(random.integers(1, len(order)))) % len(order)
    order[[first, second]] = second, first
    return replace(capture, images=capture.images[order])


def half_turn(capture: bgars.Capture, _: np.random.Generator) -> bgars.Capture:
    return _rig(capture, capture.rig.directions * [-1, -1, 1])


def z_negative(capture: bgars.Capture, _: np.random.Generator) -> bgars.Capture:
    return _rig(capture, capture.rig.directions * [1, 1, -1])


def one_below(capture: bgars.Capture, random: np.random.Generator) -> bgars.Capture:
    directions = capture.rig.directions.copy()
    directions[_one(capture, random), 2] *= -1
    return _rig(capture, directions)


def same_file(capture: bgars.Capture, random: np.random.Generator) -> bgars.Capture:
    images = capture.images.copy()
    index = _one(capture, random)
    images[index] = images[(index + 1) % len(images)]
    return replace(capture, images=images)


def fired_twice(capture: bgars.Capture, random: np.random.Generator) -> bgars.Capture:
    levels = _levels(capture)
    index = _one(capture, random)
    top = _top(capture)
    levels[index] = _fresh_noise(levels[(index + 1) % len(levels)], top, random)
    return _stored(capture, levels)


def _fresh_noise(levels: Array, top: float, random: np.random.Generator) -> Array:
    """Noise of an image whose own was smoothed away: shot noise of 12,000 electrons."""
    return levels + random.normal(0.0, 1.0, levels.shape) * np.sqrt(np.maximum(levels, 1.0) / top / 12000.0) * top


def too_dark(capture: bgars.Capture, random: np.random.Generator) -> bgars.Capture:
    factor = float(random.uniform(0.02, 0.06))
    return _stored(capture, _offset(capture) + (_levels(capture) - _offset(capture)) * factor)


def too_bright(capture: bgars.Capture, random: np.random.Generator) -> bgars.Capture:
    usual = float(np.median(_levels(capture).max(axis=0))) / _top(capture)
    return _stored(capture, _levels(capture) * float(random.uniform(1.5, 3.0)) / usual)


def rows_dark(capture: bgars.Capture, random: np.random.Generator) -> bgars.Capture:
    levels = _levels(capture)
    index, rows = _one(capture, random), levels.shape[1]
    cut = int(rows * random.uniform(0.25, 0.75))
    offset = np.broadcast_to(_offset(capture), levels.shape[1:])
    levels[index, cut:] = offset[cut:] + (levels[index, cut:] - offset[cut:]) * float(random.uniform(0.0, 0.8))
    return _stored(capture, levels)


def rows_late(capture: bgars.Capture, random: np.random.Generator) -> bgars.Capture:
    images = capture.images.copy()
    index, rows = _one(capture, random), images.shape[1]
    cut = int(rows * random.uniform(0.3, 0.7))
    images[index, cut:] = capture.images[(index + 1) % len(images), cut:]
    return replace(capture, images=images)


def ambient(capture: bgars.Capture, random: np.random.Generator) -> bgars.Capture:
    """Light of the room on the part, from a thirtieth to nearly half of that of the lamps."""
    levels = _levels(capture)
    usual = levels.max(axis=0) - _offset(capture)
    return _stored(capture, levels * 0.7 + gaussian_filter(usual, 1.5) * float(np.exp(random.uniform(-3.5, -0.9))))


def veil(capture: bgars.Capture, random: np.random.Generator) -> bgars.Capture:
    """The same in all pixels: stray light in the lens, or a black level nobody took away."""
    levels = _levels(capture)
    usual = float(np.median(np.median(levels, axis=0) - _offset(capture)))
    size = max(float(np.exp(random.uniform(-3.5, -1.6))) * usual, 1.5 / 255.0 * float(capture.saturation))
    return _stored(capture, levels * 0.8 + size)


def vignetting(capture: bgars.Capture, random: np.random.Generator) -> bgars.Capture:
    rows, cols = capture.images.shape[1:]
    y, x = np.mgrid[:rows, :cols]
    square = ((x - cols / 2) ** 2 + (y - rows / 2) ** 2) / ((cols / 2) ** 2 + (rows / 2) ** 2)
    fall = 1.0 - float(random.uniform(0.35, 0.7)) * square
    return _stored(capture, _offset(capture) + (_levels(capture) - _offset(capture)) * fall)


def moved(capture: bgars.Capture, random: np.random.Generator) -> bgars.Capture:
    levels = _levels(capture)
    size, angle = float(random.uniform(0.6, 4.0)), float(random.uniform(0, 2 * np.pi))
    index = _one(capture, random)
    levels[index] = shift(levels[index], (size * np.sin(angle), size * np.cos(angle)), order=1, mode="nearest")
    return _stored(capture, levels)


def blurred(capture: bgars.Capture, random: np.random.Generator) -> bgars.Capture:
    levels = _levels(capture)
    index = _one(capture, random)
    blurred_levels = gaussian_filter(levels[index], float(random.uniform(0.9, 3.0)))
    levels[index] = _fresh_noise(blurred_levels, _top(capture), random)
    return _stored(capture, levels)


def noisy(capture: bgars.Capture, random: np.random.Generator) -> bgars.Capture:
    levels = _levels(capture)
    index, top = _one(capture, random), _top(capture)
    levels[index] += random.normal(0.0, float(random.uniform(0.02, 0.05)) * top, levels[index].shape)
    return _stored(capture, levels)


def gamma(capture: bgars.Capture, random: np.random.Generator) -> bgars.Capture:
    top = _top(capture)
    # Cameras bend before they round: levels of 8 bits are spread first, or combs would give the curve away.
    spread = random.uniform(-0.5, 0.5, capture.images.shape)
    linear = np.clip((_levels(capture) + spread - _offset(capture)) / top, 0, 1)
    return replace(_stored(capture, linear ** (1 / float(random.uniform(1.8, 2.4))) * top), dark=None)


def twelve_bits(capture: bgars.Capture, random: np.random.Generator) -> bgars.Capture:
    bits = int(random.choice([10, 12, 14]))
    levels = _levels(capture)
    bright = float(np.percentile(levels, 99.7))
    codes = np.clip(levels / bright + random.uniform(-0.5, 0.5, levels.shape) / 255.0, 0, 1) * (2**bits - 1)
    images = np.rint(codes).astype(np.uint16)
    dark = None if capture.dark is None else np.rint(capture.dark / bright * (2**bits - 1)).astype(np.uint16)
    return replace(capture, images=images, dark=dark, saturation=65535.0, full_scale=65535.0)


def lamp_dead(capture: bgars.Capture, random: np.random.Generator) -> bgars.Capture:
    levels = _levels(capture)
    top = _top(capture)
    levels[_one(capture, random)] = _offset(capture) + random.normal(0.003, 0.003, levels.shape[1:]) * top
    return _stored(capture, levels)


def lamp_uneven(capture: bgars.Capture, random: np.random.Generator) -> bgars.Capture:
    levels = _levels(capture)
    factor = float(random.choice([random.uniform(0.5, 0.82), random.uniform(1.2, 1.4)]))
    index = _one(capture, random)
    levels[index] = _offset(capture) + (levels[index] - _offset(capture)) * factor
    return _stored(capture, levels)


def one_turned(capture: bgars.Capture, random: np.random.Generator) -> bgars.Capture:
    images = capture.images.copy()
    index = _one(capture, random)
    images[index] = images[index][::-1, ::-1] if random.random() < 0.5 else images[index][:, ::-1]
    return replace(capture, images=images)


def camera_turned(capture: bgars.Capture, random: np.random.Generator) -> bgars.Capture:
    quarter = int(random.choice([1, 3]))
    images = np.ascontiguousarray(np.rot90(capture.images, quarter, axes=(1, 2)))
    dark = None if capture.dark is None else np.ascontiguousarray(np.rot90(capture.dark, quarter))
    mask = np.ascontiguousarray(np.rot90(capture.mask, quarter))
    return replace(capture, images=images, dark=dark, mask=mask)


FAULTS: dict[str, tuple[str, Fault]] = {
    "y down": ("handedness", y_down),
    "x mirrored": ("handedness", x_mirrored),
    "images mirrored": ("handedness", images_mirrored),
    "listed clockwise": ("handedness", clockwise),
    "listed in opposite order": ("handedness", opposite),
    "shifted by one image": ("order", shifted),
    "two images swapped": ("order", swapped),
    "half turn": ("order", half_turn),
    "z negative": ("below-surface", z_negative),
    "one light below": ("below-surface", one_below),
    "same file twice": ("duplicate", same_file),
    "lamp fired twice": ("duplicate", fired_twice),
    "underexposed": ("dark", too_dark),
    "overexposed": ("clipped", too_bright),
    "rows without light": ("half-lit", rows_dark),
    "rows of the next light": ("half-lit", rows_late),
    "ambient light": ("ambient", ambient),
    "veil of stray light": ("ambient", veil),
    "vignetting": ("vignetting", vignetting),
    "moved": ("motion", moved),
    "blurred": ("focus", blurred),
    "noisy": ("noise", noisy),
    "gamma": ("response", gamma),
    "10 to 14 bits in 16": ("bit-depth", twelve_bits),
    "dead lamp": ("lamp-dead", lamp_dead),
    "uneven lamp": ("lamp-uneven", lamp_uneven),
    "one image turned": ("orientation", one_turned),
    "camera turned": ("orientation", camera_turned),
}


SHOWN_BY: dict[str, tuple[str, ...]] = {
    # What the images of the others cannot tell, whoever looks at them: floors of shadows where there are none, bumps
    # from hollows without a cast shadow.
    "ambient light": ("array", "rendered"),
    "veil of stray light": ("array", "rendered"),
    "half turn": ("array", "rendered"),
}


def shown(name: str, capture: str) -> bool:
    """Whether a kind of capture holds evidence of a fault at all."""
    return capture.startswith(SHOWN_BY.get(name, ("",)))


def causes(name: str) -> set[str]:
    """Kinds that name the cause of a fault rightly."""
    return SAME_CAUSE.get(name, {FAULTS[name][0]})


def spoil(name: str, capture: bgars.Capture, seed: int) -> bgars.Capture:
    """Put a fault into a capture."""
    return FAULTS[name][1](replace(capture, files=()), np.random.default_rng(seed))
