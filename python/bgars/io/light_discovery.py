"""Which file of a folder without ``capture.toml`` describes the lights, and which is the mask."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from bgars.errors import InputError
from bgars.files.light_formats import LIGHT_FORMATS
from bgars.io.image_listing import list_folder, some_of
from bgars.io.recipe import RECIPE_NAME, CaptureRecipe

if TYPE_CHECKING:
    from bgars.io.image_listing import Listing

__all__ = ["choose_mask", "default_recipe", "is_about_lights", "undescribed"]

DIRECTIONS, INTENSITIES = "light_directions.txt", "light_intensities.txt"
SUFFIXES = frozenset(suffix for kind in LIGHT_FORMATS for suffix in kind.suffixes)
ABOUT_LIGHTS = re.compile(r"(?<![a-z])(light|lights|led|leds|dir|dirs|direction|directions)(?![a-z])|^[ls]$")
ABOUT_STRENGTH = re.compile(r"intensit|strength|brightness")
INTENSITY_FILE = re.compile(r"((light|lamp|led)s?[ _-]?)?(intensit(y|ies)|strengths?)")
INTENSITY_SUFFIXES = (".txt", ".csv", ".tsv", ".dat", ".npy")
ABOUT_PLACES = re.compile(r"position|(?<![a-z])pos(?![a-z])")
RTI_FOLDERS = ("assembly-files", "finished-files")
PREFERRED = ("light_directions", "lights", "light")


def default_recipe(folder: Path, listing: Listing, notes: list[str]) -> CaptureRecipe:
    """The recipe that a folder without ``capture.toml`` amounts to; what it assumes is added to `notes`.

    Raises
    ------
    InputError
        Nothing describes the lights, or several files do.
    """
    lights: dict[str, str] = {}
    lp_files = [name for name in listing.others if name.lower().endswith(".lp")]
    if DIRECTIONS in listing.others:
        lights["directions"] = DIRECTIONS
    else:
        lp_files = lp_files or _rti_files(folder, listing, notes)
        if len(lp_files) > 1:
            msg = f"{folder}: holds {len(lp_files)} .lp files ({some_of(lp_files)}); name one in {RECIPE_NAME}"
            raise InputError(msg)
        name = lp_files[0] if lp_files else _other_file(folder, listing, notes)
        lights["lp" if lp_files else "directions"] = name
    strength = _strength_file(listing, notes)
    if strength is not None:
        lights["intensities"] = strength
    return CaptureRecipe.model_validate({"lights": lights, "mask": choose_mask(listing, notes)})


def _strength_file(listing: Listing, notes: list[str]) -> str | None:
    """The file of the intensities: of the usual name, else the only one that is called so; others are said."""
    named = [name for name in listing.others if INTENSITY_FILE.fullmatch(Path(name).stem.lower())]
    usual = [name for name in named if name.lower() == INTENSITIES]
    candidates = usual or [name for name in named if Path(name).suffix.lower() in INTENSITY_SUFFIXES]
    chosen = candidates[0] if len(candidates) == 1 else None
    if chosen is not None and not usual:
        notes.append(f"intensities taken from {chosen}")
    ignored = [name for name in named if name != chosen]
    if ignored:
        notes.append(f"files about intensities that are not used: {some_of(ignored)}")
    return chosen


def undescribed(folder: Path, listing: Listing, notes: list[str], *, may_lack_lights: bool) -> CaptureRecipe:
    """The recipe of a folder without one; without lights, too, where something else knows them.

    Raises
    ------
    InputError
        As :func:`default_recipe`, where lights may not be lacking.
    """
    try:
        return default_recipe(folder, listing, notes)
    except InputError:
        if not may_lack_lights:
            raise
    return CaptureRecipe.model_validate({"mask": choose_mask(listing, notes)})


def choose_mask(listing: Listing, notes: list[str]) -> str | None:
    """Return the mask among the images that are called so; None where there is none, or no one is the likeliest.

    `mask.png` is silent; any other is said.
    """
    named = [name for name in listing.masks if Path(name).stem.lower() == "mask"]
    candidates = named or list(listing.masks)
    chosen = "mask.png" if "mask.png" in candidates else candidates[0] if len(candidates) == 1 else None
    if chosen is not None and chosen != "mask.png":
        notes.append(f"{chosen} taken as the mask")
    ignored = [name for name in listing.masks if name != chosen]
    if ignored:
        notes.append(
            f"masks that are not used: {some_of(ignored)}; to use one, write mask = {ignored[0]!r} in {RECIPE_NAME}"
        )
    return chosen


def is_about_lights(name: str) -> bool:
    """Whether a file describes directions or positions of lights, by its name.

    Examples
    --------
    >>> [is_about_lights(name) for name in ("lights.csv", "rti.dome", "light_intensities.txt", "balls.csv")]
    [True, True, False, False]
    """
    path = Path(name)
    suffix = path.suffix.lower()
    return not name.startswith(".") and ((suffix in SUFFIXES and _says_lights(path.stem)) or suffix == ".dome")


def _says_lights(stem: str) -> bool:
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", stem)  # LightDirections
    words = re.sub(r"[\W_\d]+", " ", apart.lower()).strip()
    return ABOUT_LIGHTS.search(words) is not None and not ABOUT_STRENGTH.search(words)


def _rti_files(folder: Path, listing: Listing, notes: list[str]) -> list[str]:
    """The ``.lp`` files of an RTIBuilder project, seen from its top, or of any other folder here."""
    usual = [name for name in listing.folders if name.lower() in RTI_FOLDERS]
    found: list[str] = []
    for places in (usual, listing.folders):
        if not found:
            inner = {name: list_folder(folder / name).others for name in places}
            found = [f"{name}/{file}" for name in places for file in inner[name] if file.lower().endswith(".lp")]
    if len(found) == 1:
        notes.append(f"lights taken from {found[0]}")
    return sorted(found)


def _other_file(folder: Path, listing: Listing, notes: list[str]) -> str:
    """The file of another format that is about lights by its name."""
    about = [name for name in listing.others if is_about_lights(name)]
    positions = [name for name in about if ABOUT_PLACES.search(name.lower())]
    about = [name for name in about if name not in positions]
    for preferred in PREFERRED:
        fitting = [name for name in about if Path(name).stem.lower() == preferred]
        if len(fitting) == 1 and len(about) > 1:
            notes.append(f"other files about lights are not used: {some_of([n for n in about if n != fitting[0]])}")
            about = fitting
    if len(about) == 1:
        notes.append(f"lights taken from {about[0]}")
        return about[0]
    if not about and (listing.images or any(list_folder(folder / name).images for name in listing.folders)):
        about = _below(folder, listing)
        if len(about) == 1:
            notes.append(f"lights taken from {about[0]}")
            return about[0]
    if about:
        msg = f"{folder}: holds {len(about)} files about lights ({some_of(about)}); name one in {RECIPE_NAME}"
        raise InputError(msg)
    if positions:
        msg = (
            f"{folder}: {positions[0]} seems to hold positions of lights; write in {RECIPE_NAME}: pixel_pitch_um = "
            f'..., and under [lights] positions_mm = "{positions[0]}" (mm, origin at the image centre on the board)'
        )
        raise InputError(msg)
    almost = [name for name in listing.others if name.lower().startswith(RECIPE_NAME) and name != RECIPE_NAME]
    foreign = [name for name in listing.others if name.lower() in ("capture.yaml", "capture.yml", "capture.json")]
    if foreign:
        msg = f"{folder}: {foreign[0]} is not read: write its content as TOML into {RECIPE_NAME}"
        raise InputError(msg)
    if almost:
        msg = f"{folder}: {almost[0]} is not read: its name must be {RECIPE_NAME}"
        raise InputError(msg)
    msg = (
        f"{folder}: no description of the lights: expected {RECIPE_NAME} with [lights], {DIRECTIONS}, "
        f"or one .lp file; seen: {listing.in_words()}{_hint(folder, listing)}"
    )
    raise InputError(msg)


def _below(folder: Path, listing: Listing) -> list[str]:
    """Files about lights in folders without images, beside the images; with images they would be another capture."""
    inner = {name: list_folder(folder / name) for name in listing.folders}
    return [
        f"{name}/{file}"
        for name, within in inner.items()
        if not within.images
        for file in within.others
        if is_about_lights(file) and not ABOUT_PLACES.search(file.lower())
    ]


FOREIGN = {
    ".relight": "is a project of relight, which is not read: export its lights as .lp",
    ".ptm": "is a finished RTI: the photographs and their .lp file are needed",
    ".rti": "is a finished RTI: the photographs and their .lp file are needed",
    ".hsh": "is a finished RTI: the photographs and their .lp file are needed",
}
"""Files of other programs, and what to do."""


def _hint(folder: Path, listing: Listing) -> str:
    """What to do about it, as far as the names of files tell."""
    for name in listing.folders:
        inner = list_folder(folder / name).others
        if any(each in {RECIPE_NAME, DIRECTIONS} or is_about_lights(each) for each in inner):
            return f". {folder / name} seems to be a capture: name that folder"
    for name in listing.others:
        if Path(name).suffix.lower() in FOREIGN:
            return f". {name} {FOREIGN[Path(name).suffix.lower()]}"
    unread = [name for name in listing.others if _says_lights(Path(name).stem)]
    if unread:
        known = ", ".join(sorted(SUFFIXES))
        return f". {unread[0]} is not read: lights come as {known} (docs/captures.md)"
    tables = [name for name in listing.others if Path(name).suffix.lower() in SUFFIXES]
    if len(tables) == 1:
        return f". If {tables[0]} holds the lights, write {RECIPE_NAME} with [lights] and directions = '{tables[0]}'"
    return f". 'bgars init {folder}' writes {RECIPE_NAME}" if listing.images else ""
