"""Which image files of a capture folder belong to its lights."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from bgars.errors import FileFormatError, InputError
from bgars.files.light_files import read_filenames
from bgars.io.image_formats import format_of
from bgars.io.image_listing import Listing, choose_series, list_folder, natural_key, role_of, some_of
from bgars.io.image_names import find_named_images
from bgars.io.image_tags import read_tags
from bgars.io.light_discovery import choose_mask
from bgars.io.recipe import RECIPE_NAME

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bgars.io.capture_lights import Lights
    from bgars.io.recipe import CaptureRecipe

__all__ = ["ChosenImages", "choose_images", "match"]

NAMES_FILE = "filenames.txt"
MIN_IMAGES = 3


class ChosenImages(NamedTuple):
    """Images of a capture.

    Attributes
    ----------
    names : list of str
        Files relative to the capture folder, one per light; one alone is a stack.
    written : list of str
        The same as the file that names them does.
    mask : str or None
        A mask that lies beside the images in a subfolder.
    """

    names: list[str]
    written: list[str]
    mask: str | None = None


def choose_images(
    folder: Path, recipe: CaptureRecipe, lights: Lights, listing: Listing, notes: list[str]
) -> ChosenImages:
    """Return the images: of the recipe, filenames.txt, or the file of the lights, else those that lie there.

    Raises
    ------
    FileFormatError
        A named image is missing.
    InputError
        No images that fit the lights; the message says what lies there.
    """
    listing = _without(listing, _files_of(recipe))
    written, source = _named(folder, recipe, lights, listing)
    if written:
        names, told = find_named_images(folder, written, source, listing.folders)
        twice = next((name for index, name in enumerate(names) if name in names[:index]), None)
        if twice is not None:
            msg = f"{source or folder}: names {twice!r} twice; each light has an image of its own"
            raise InputError(msg)
        notes.extend(told)
        unused = [name for name in (*listing.images, *listing.special) if name not in names]
        by_lights = written == list(lights.rig.files)  # a list of images is a choice, a file of lights perhaps is not
        if unused and by_lights and not told and recipe.images is None and source is not None:
            notes.append(f"images that {source.name} does not name are not used: {some_of(unused)}")
        return ChosenImages(names, written)
    count = len(lights.rig)
    special, images = listing.special, listing.images
    chosen = _fitting(folder, images, special, count)
    if chosen is not None:
        _tell_surplus(recipe, (*images, *special), chosen, notes)
        return ChosenImages(list(chosen), list(chosen))
    below = _one_folder_down(folder, recipe, listing, count, notes) if not images else None
    if below is not None:
        return below
    needed = f"but {lights.source} gives {count} lights" if lights.source else "one per light is needed, 3 or more"
    msg = (
        f"{folder}: {len(images)} images ({some_of(images) or 'none found'}), {needed}"
        f"; seen: {listing.in_words(without_images=bool(images))}{_unread(listing, count)}"
    )
    raise InputError(msg)


def _unread(listing: Listing, count: int) -> str:
    """What to do with as many files as lights of an ending that no image has here."""
    endings = [Path(name).suffix.lower() for name in listing.others]
    unknown = next((ending for ending in endings if ending and endings.count(ending) == count), None)
    return "" if unknown is None else f"; {unknown} is not read as images: convert them to PNG or TIFF"


def _files_of(recipe: CaptureRecipe) -> set[str]:
    """Files that a recipe names for something else than an image of one light."""
    lights = () if recipe.lights is None else vars(recipe.lights).values()
    return {value for value in (recipe.dark, recipe.mask, *lights) if isinstance(value, str)}


def _without(listing: Listing, names: set[str]) -> Listing:
    kept = [tuple(name for name in group if name not in names) for group in (listing.images, listing.special)]
    return replace(listing, images=kept[0], special=kept[1])


def _named(folder: Path, recipe: CaptureRecipe, lights: Lights, listing: Listing) -> tuple[list[str], Path | None]:
    """Names of the images and the file that gives them; none where nothing does."""
    if isinstance(recipe.images, list):
        return recipe.images, folder / RECIPE_NAME
    names_file = next((name for name in listing.others if name.lower() == NAMES_FILE), None)
    if names_file is not None:
        return read_filenames(folder / names_file), folder / names_file
    return list(lights.rig.files), lights.path


def _fitting(folder: Path, images: Sequence[str], special: Sequence[str], count: int) -> tuple[str, ...] | None:
    """As many images as lights: all, or the only series among them; or one stack."""
    if len(images) == count:
        return tuple(images)
    series = choose_series([*images, *special], count)
    if series is not None:
        return series
    if len(images) == 1 and count > 1 and _may_be_stack(folder / images[0]):
        return tuple(images)
    return None


def _may_be_stack(path: Path) -> bool:
    try:
        kind = format_of(path)
        return kind.stack and (kind.decoder != "tiff" or read_tags(path, kind).pages > 1)
    except FileFormatError:
        return True  # let its decoder say what is wrong


def _one_folder_down(
    folder: Path, recipe: CaptureRecipe, listing: Listing, count: int, notes: list[str]
) -> ChosenImages | None:
    """Images in the only subfolder that has as many as there are lights, or one each in as many subfolders."""
    below = {name: list_folder(folder / name) for name in listing.folders}
    fitting = []
    for name, inner in below.items():
        chosen = _fitting(folder / name, inner.images, inner.special, count)
        if chosen is not None:
            fitting.append((name, inner, chosen))
    if len(fitting) > 1:  # not those of masks, normals, results
        fitting = [found for found in fitting if role_of(f"{found[0]}.") is None] or fitting
    if len(fitting) == 1:
        name, inner, chosen = fitting[0]
        notes.append(f"images taken from the folder {name}")
        _tell_surplus(recipe, (*inner.images, *inner.special), chosen, notes, name)
        mask = None if recipe.mask is not None or listing.masks else choose_mask(inner, notes)
        names = [f"{name}/{image}" for image in chosen]
        return ChosenImages(names, names, None if mask is None else f"{name}/{mask}")
    if fitting:
        msg = (
            f"{folder}: holds no images, but {len(fitting)} folders with {count} each "
            f"({some_of([name for name, _, _ in fitting])}); give one of them, or name the images in {RECIPE_NAME}"
        )
        raise InputError(msg)
    single = [f"{name}/{inner.images[0]}" for name, inner in below.items() if len(inner.images) == 1]
    if len(single) == count and count > 1:
        names = sorted(single, key=natural_key)
        notes.append(f"one image taken from each of {count} folders, from {names[0]} to {names[-1]}")
        return ChosenImages(names, names)
    return None


def _tell_surplus(
    recipe: CaptureRecipe, present: Sequence[str], chosen: Sequence[str], notes: list[str], where: str = ""
) -> None:
    left = [name for name in present if name not in chosen]
    if recipe.black_level > 0:  # stands for the dark frame
        left = [name for name in left if "dark" not in name.lower()]
    if not left:
        return
    place = f" of {where}" if where else ""
    without_light = [name for name in left if any(word in name.lower() for word in ("dark", "ambi", "background"))]
    advice = ""
    if without_light and recipe.dark is None:
        advice = f'; to subtract {without_light[0]}, write dark = "{without_light[0]}" in {RECIPE_NAME}'
    notes.append(f"images{place} that are not used: {some_of(left)}{advice}")


def match(folder: Path, lights: Lights, chosen: ChosenImages, wanted: Sequence[str] | None) -> tuple[Lights, list[str]]:
    """Pair lights and images: by name where the file of the lights names them all, else by order.

    Raises
    ------
    InputError
        Other numbers of images and lights, or `wanted` images that are not there.
    """
    names, written = chosen.names, chosen.written
    if lights.rig.files and written != list(lights.rig.files):
        for key in (_base, _stem):
            place = {key(name): index for index, name in enumerate(lights.rig.files)}
            if len(place) == len(lights.rig.files) and all(key(name) in place for name in written):
                lights = lights.take([place[key(name)] for name in written])
                break
    is_stack = len(names) == 1 and len(lights.rig) > 1
    if len(names) != len(lights.rig) and not is_stack:
        msg = (
            f"{folder}: {len(names)} images ({some_of(names) or 'none found'}), but {lights.source} gives "
            f"{len(lights.rig)} lights"
        )
        raise InputError(msg)
    if wanted is None:
        return lights, names
    if is_stack:
        msg = f"images: cannot be chosen from a stack ({names[0]} of {folder})"
        raise InputError(msg)
    known = {**{name: index for index, name in enumerate(written)}, **{name: index for index, name in enumerate(names)}}
    unknown = [name for name in wanted if name not in known]
    if unknown:
        msg = f"images: {unknown[0]!r} is not an image of {folder}"
        raise InputError(msg)
    if len(wanted) < MIN_IMAGES:
        msg = f"images: at least {MIN_IMAGES} images are needed, got {len(wanted)}"
        raise InputError(msg)
    indices = [known[name] for name in wanted]
    return lights.take(indices), [names[index] for index in indices]


def _base(name: str) -> str:
    return name.replace("\\", "/").rpartition("/")[2].lower()


def _stem(name: str) -> str:
    return Path(_base(name)).stem
