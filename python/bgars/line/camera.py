"""A camera with its lights, as small as it can be, and captures made with one."""

from __future__ import annotations

import importlib
import shutil
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import imageio.v3 as iio
import numpy as np

from bgars.errors import BgarsError, FileFormatError, InputError
from bgars.io.image_listing import list_folder
from bgars.io.recipe import RECIPE_NAME, CaptureRecipe, read_recipe
from bgars.line.folders import IMAGES
from bgars.records.scalar_checks import check_progress

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

__all__ = ["Camera", "FolderCamera", "camera_of", "take_capture"]

GREY, COLOUR = 2, 3


class Camera(Protocol):
    """Whatever takes a picture under a light.

    A class for a camera of your own needs this one method: it switches light `light` on, exposes, switches it off, and
    returns the pixels. docs/line.md has examples for the interfaces of makers.
    """

    def grab(self, light: int) -> NDArray[Any]:
        """Return (rows, cols) or (rows, cols, 3) pixels, uint8 or uint16, under light `light`, from 0."""
        ...


class FolderCamera:
    """Shows the images of a folder as if it took them: for tests, and for a station without its camera.

    Examples
    --------
    >>> import bgars
    >>> FolderCamera(bgars.sample_capture()).grab(0).shape
    (240, 256)
    """

    def __init__(self, folder: str | Path) -> None:
        folder = Path(folder)
        if not folder.is_dir():
            msg = f"{folder}: is not a folder" if folder.exists() else f"{folder}: no such folder"
            raise FileFormatError(msg)
        described = read_recipe(folder / RECIPE_NAME).images if (folder / RECIPE_NAME).is_file() else None
        if not isinstance(described, list):
            described = [name for name in list_folder(folder).images if Path(name).suffix.lower() in IMAGES]
        self.files = [folder / name for name in described]
        lost = next((path for path in self.files if not path.is_file()), None)
        if lost is not None:
            msg = f"{folder / RECIPE_NAME}: images: no such file: {lost}"
            raise FileFormatError(msg)
        if not self.files:
            msg = f"{folder}: holds no images"
            raise FileFormatError(msg)

    def grab(self, light: int) -> NDArray[Any]:
        """Return the image of a light: as capture.toml in the folder lists them, else in the order of their numbers."""
        if not 0 <= light < len(self.files):
            msg = (
                f"light: must be 0 to {len(self.files) - 1}, as {self.files[0].parent} holds {len(self.files)} images, "
                f"got {light}"
            )
            raise InputError(msg)
        return np.asarray(iio.imread(self.files[light]))


def camera_of(name: str) -> Camera:
    """Return the camera that is meant: ``folder:PATH``, or ``MODULE:CALLABLE`` that returns one.

    Raises
    ------
    InputError
        No such module or callable, or what it returns cannot grab.
    BgarsError
        The camera cannot be opened.
    """
    kind, _, rest = name.partition(":")
    if kind == "folder" and rest:
        return FolderCamera(rest)
    if not rest:
        msg = f"camera: must be folder:PATH or MODULE:CALLABLE, got {name!r}"
        raise InputError(msg)
    if str(Path.cwd()) not in sys.path:
        sys.path.insert(0, str(Path.cwd()))  # a driver beside the project, as python -m finds it
    try:
        make: Callable[[], Any] = getattr(importlib.import_module(kind), rest)
    except (ImportError, AttributeError) as error:
        msg = f"camera: {name!r} cannot be imported ({error})"
        raise InputError(msg) from None
    try:
        made: Camera = make()
    except BgarsError:
        raise
    except Exception as error:
        msg = f"camera: {name!r} cannot be opened ({_told(error)})"
        raise BgarsError(msg) from error
    if not callable(getattr(made, "grab", None)):
        msg = f"camera: what {name!r} returns must have grab(light), got {type(made).__name__}"
        raise InputError(msg)
    return made


def take_capture(
    camera: Camera,
    folder: str | Path,
    *,
    lights: int,
    rig: str | Path | None = None,
    progress: Callable[[float], object] = lambda _fraction: None,
) -> list[str]:
    """Take an image under each light and write a capture folder, whole or not at all.

    Parameters
    ----------
    camera : Camera
    folder : path
        New. It appears when all is in it: an inbox may hold it.
    lights : int
    rig : path, optional
        capture.toml that is copied into it, or its folder, with the files of lights, dark frame, mask and response that
        it names; with ``images`` it names the images, else they are ``light_00.png``, ...
    progress : callable
        Called with the fraction done.

    Returns
    -------
    list of str
        The files.

    Raises
    ------
    InputError
        The folder is there, no lights, a file that the rig names is missing, or the camera returned no image or one of
        another shape.
    BgarsError
        The camera failed.
    FileFormatError
        It cannot be written.
    """
    check_progress(progress)
    folder = Path(folder)
    if folder.exists():
        msg = f"{folder}: must be a new folder; captures are never overwritten"
        raise InputError(msg)
    if lights < 1:
        msg = f"lights: must be 1 or more, got {lights}"
        raise InputError(msg)
    names = [f"light_{light:02d}.png" for light in range(lights)]
    beside: list[str] = []
    if rig is not None:
        rig = Path(rig) / RECIPE_NAME if Path(rig).is_dir() else Path(rig)
        recipe = read_recipe(rig)
        if recipe.exposures_ms is not None or isinstance(recipe.images, str):
            msg = f"{rig}: exposures_ms: a camera is asked for one image per light; take the bracket's files yourself"
            raise InputError(msg)
        described = recipe.images
        if described is not None and len(described) != lights:
            msg = f"{rig}: images: must name {lights} files, one per light, got {len(described)}"
            raise InputError(msg)
        names = described or names
        beside = _named_files(rig, recipe, folder)
    try:
        folder.absolute().parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".bgars-partial-", dir=folder.absolute().parent) as place:
            made = Path(place) / folder.name
            made.mkdir()
            first: NDArray[Any] | None = None
            for light, name in enumerate(names):
                image = _grabbed(camera, light, first)
                first = image if first is None else first
                iio.imwrite(made / name, image)
                progress((light + 1) / lights)
            if rig is not None:
                shutil.copyfile(rig, made / RECIPE_NAME)
                for name in beside:
                    (made / name).parent.mkdir(parents=True, exist_ok=True)
                    shutil.copyfile(rig.parent / name, made / name)
                names = [*names, RECIPE_NAME, *beside]
            made.rename(folder)
    except BgarsError:
        raise
    except OSError as error:
        msg = f"{folder}: cannot be written ({error.strerror or error})"
        raise FileFormatError(msg) from error
    return names


def _named_files(rig: Path, recipe: CaptureRecipe, folder: Path) -> list[str]:
    """The files that a description of a rig names; all are there, and its station is found from the new folder, too."""
    lights = recipe.lights
    given = {"dark": recipe.dark, "mask": recipe.mask, "response.table": getattr(recipe.response, "table", None)}
    for name in () if lights is None else ("directions", "angles_deg", "positions_mm", "lp", "intensities"):
        given[f"lights.{name}"] = getattr(lights, name)
    named = {key: name for key, name in given.items() if isinstance(name, str) and not Path(name).is_absolute()}
    for key, name in named.items():
        if ".." in Path(name).parts or not (rig.parent / name).is_file():
            msg = f"{rig}: {key}: the file {name!r} must stand beside it, to be copied into the capture"
            raise InputError(msg)
    if recipe.station is not None and not (folder / recipe.station).is_file():
        msg = f"{rig}: station: {recipe.station!r} is not found from {folder}; write its whole path, as bgars init does"
        raise InputError(msg)
    return list(dict.fromkeys(named.values()))


def _grabbed(camera: Camera, light: int, first: NDArray[Any] | None) -> NDArray[Any]:
    try:
        image = np.asarray(camera.grab(light))
    except BgarsError:
        raise
    except Exception as error:
        msg = f"camera: grab({light}) gave no image ({_told(error)})"
        raise BgarsError(msg) from error
    is_image = image.ndim == GREY or (image.ndim == COLOUR and image.shape[2] == COLOUR)
    if not is_image or image.dtype not in (np.uint8, np.uint16) or image.size == 0:
        msg = (
            f"camera: grab({light}) must return grey or RGB pixels of uint8 or uint16, got {image.dtype} {image.shape}"
        )
        raise InputError(msg)
    if first is not None and (image.shape != first.shape or image.dtype != first.dtype):
        told = f"{first.dtype} {first.shape}, got {image.dtype} {image.shape}"
        msg = f"camera: grab({light}) must be like the first image {told}"
        raise InputError(msg)
    return image


def _told(error: Exception) -> str:
    """An error of somebody's library in one line."""
    return " ".join(f"{type(error).__name__}: {error}".split())
