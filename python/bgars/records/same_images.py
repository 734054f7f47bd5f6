"""Images that are equal bit by bit."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

import numpy as np

from bgars.errors import InputError
from bgars.files.light_names import light_name

if TYPE_CHECKING:
    from collections.abc import Iterable

    from bgars.records.capture import Capture
    from bgars.records.pixels import PixelArray

__all__ = ["refuse_repeated", "refuse_seen", "refuse_shared", "same_images"]

SAMPLE = 50_000


def same_images(images: PixelArray) -> tuple[int, int] | None:
    """First two of (L, H, W) images that are equal, unless they are empty; None where there are none.

    Examples
    --------
    >>> images = np.arange(24, dtype=np.uint8).reshape(3, 2, 4)
    >>> images[2] = images[0]
    >>> same_images(images), same_images(images[:2])
    ((0, 2), None)
    """
    stack = images.reshape(len(images), -1)
    step = max(1, stack.shape[1] // SAMPLE)
    sample = stack[:, ::step]
    for second in range(1, len(stack)):
        if sample[second].min() == sample[second].max():
            continue
        for first in range(second):
            if np.array_equal(sample[first], sample[second]) and np.array_equal(stack[first], stack[second]):
                return first, second
    return None


def refuse_repeated(capture: Capture) -> None:
    """Raise InputError where two images are the same, unless both are empty."""
    same = same_images(capture.images)
    if same is not None:
        files = [path.name for path in capture.files]
        first, second = (files[each] if files else light_name(each, what="image") for each in same)
        msg = f"{capture.name}: images: {first} and {second} are the same picture; each light needs its own"
        raise InputError(msg)


def refuse_shared(captures: Iterable[Capture], advice: str) -> None:
    """Raise InputError where a picture is in two captures: a copy repeats perfectly, and says nothing new."""
    seen: dict[str, str] = {}
    for capture in captures:
        refuse_seen(capture, seen, advice)


def refuse_seen(capture: Capture, seen: dict[str, str], advice: str) -> None:
    """Raise InputError where a picture, unless it is empty, is one of those `seen`; else add it to these.

    `seen` holds names of pictures by their checksums, which are kept in place of captures.
    """
    new: dict[str, str] = {}
    for index, image in enumerate(capture.images):
        if image.min() == image.max():
            continue
        name = f"{capture.name}/{capture.files[index].name if capture.files else light_name(index, what='image')}"
        digest = hashlib.sha256(f"{image.shape} {image.dtype}".encode() + image.tobytes()).hexdigest()
        if digest in seen:
            msg = f"{name} is the same picture as {seen[digest]}; {advice}"
            raise InputError(msg)
        new[digest] = name
    seen.update(new)
