"""Masks that lie in a capture folder, but that nothing names: each is said, with what to write."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from bgars.io.image_listing import list_folder, role_of, some_of
from bgars.io.recipe import RECIPE_NAME

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bgars.io.image_listing import Listing

__all__ = ["tell_unused_masks"]

PERHAPS_MASKS = re.compile(r"(?<![a-z])(msk|silhouettes?|segmentations?|roi)(?![a-z])", re.IGNORECASE)
TRUTH = "gt.npz"
"""Masks beside the truth of a rendered scene tell its balls, not what to use."""
ARRAYS = (".npz", ".mat")
"""Files that may hold a mask, but are not read as one."""


def tell_unused_masks(folder: Path, listing: Listing, used: Sequence[str], notes: list[str]) -> None:
    """Say which files of a capture without a mask look like one; `used` are its images."""
    if RECIPE_NAME in listing.others and listing.masks and TRUTH not in listing.others:
        verb = "is" if len(listing.masks) == 1 else "are"
        first = "mask.png" if "mask.png" in listing.masks else listing.masks[0]
        notes.append(f'{some_of(listing.masks)} {verb} not used: {RECIPE_NAME} names no mask; add mask = "{first}"')
    images = [name for name in listing.images if name not in used and PERHAPS_MASKS.search(name)]
    inner = {name: list_folder(folder / name) for name in listing.folders if _is_about_masks(f"{name}.")}
    within = [f"{name}/{image}" for name, found in inner.items() for image in (*found.masks, *found.images)]
    images += [name for name in within if name not in used]
    if images:
        notes.append(f'{some_of(images)}: not used; if it is a mask, write mask = "{images[0]}" in {RECIPE_NAME}')
    arrays = [name for name in listing.others if Path(name).suffix.lower() in ARRAYS and _is_about_masks(name)]
    if arrays:
        notes.append(
            f"{some_of(arrays)}: not used; a mask is an image or a .npy: save it so, "
            f'and write mask = "..." in {RECIPE_NAME}'
        )


def _is_about_masks(name: str) -> bool:
    return role_of(name) == "a mask" or PERHAPS_MASKS.search(name) is not None
