"""Which files a capture was read from, with their checksums."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING

from bgars.errors import FileFormatError
from bgars.io.bracket import bracket_names, recipe_of_exposure
from bgars.io.image_listing import list_folder
from bgars.io.light_discovery import undescribed
from bgars.io.recipe import RECIPE_NAME, TableResponse, read_recipe
from bgars.records.input_file import InputFile

if TYPE_CHECKING:
    from collections.abc import Iterable

    from bgars.records.capture import Capture

__all__ = ["capture_files", "checksums"]

FILENAMES = "filenames.txt"
BLOCK_BYTES = 1 << 20


def capture_files(capture: Capture) -> tuple[Path, ...]:
    """Return the files that a capture was read from: images, recipe, dark frame, mask, response, lights.

    Examples
    --------
    >>> import bgars
    >>> files = capture_files(bgars.read_capture(bgars.sample_capture()))
    >>> [path.name for path in files if path.suffix != ".png"]
    ['capture.toml', 'filenames.txt', 'light_directions.txt', 'light_intensities.txt']
    """
    if capture.folder is None:
        return capture.files
    path = capture.folder / RECIPE_NAME
    if path.is_file():
        recipe = read_recipe(path)
    else:  # the lights may be those of a station
        recipe = undescribed(capture.folder, list_folder(capture.folder), [], may_lack_lights=True)
    named = [RECIPE_NAME, FILENAMES if recipe.images is None else None, recipe.dark, recipe.mask, recipe.station]
    if isinstance(recipe.response, TableResponse):
        named.append(recipe.response.table)
    if recipe.lights is not None:
        named += [value for value in vars(recipe.lights).values() if isinstance(value, str)]
    if recipe.exposures_ms is not None:
        exposures = [recipe_of_exposure(recipe, one, place, None) for place, one in
                     enumerate(bracket_names(recipe, len(capture.images)))]  # fmt: skip
        named += [name for one in exposures for name in (*(one.images or ()), one.dark)]
    others = [path for name in named if name is not None and (path := capture.folder / name) not in capture.files]
    return (*dict.fromkeys(capture.files), *(file for file in others if file.is_file()))


def checksums(files: Iterable[Path]) -> tuple[InputFile, ...]:
    """Return name and SHA-256 of each file, in hexadecimal.

    Raises
    ------
    FileFormatError
        A file is gone or cannot be read.
    """
    return tuple(InputFile(path.name, _sha256(path)) for path in files)


def _sha256(path: Path) -> str:
    digest = hashlib.sha256()
    try:
        with path.open("rb") as file:
            while block := file.read(BLOCK_BYTES):
                digest.update(block)
    except OSError as error:
        msg = f"{path}: cannot be read ({error.strerror})"
        raise FileFormatError(msg) from error
    return digest.hexdigest()
