"""Read a capture folder: images, lights, mask, dark frame, response."""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bgars.errors import CaptureWarning, InputError
from bgars.io.bracket import bracket_names, lights_in_bracket, merge_exposures, recipe_of_exposure
from bgars.io.capture_headers import Headers, read_headers
from bgars.io.capture_images import choose_images, match
from bgars.io.capture_lights import Lights, note_far_lights, read_lights
from bgars.io.capture_radiometry import (
    Decoding,
    Levels,
    levels_of,
    linearise_floats,
    read_dark,
    response_table,
    subtract_offset,
)
from bgars.io.capture_station import seen_through, station_of
from bgars.io.capture_values import note_light_below_zero, refuse_nan
from bgars.io.given_paths import need_folder
from bgars.io.image_listing import Listing, list_folder, role_of
from bgars.io.image_tags import upright
from bgars.io.images import MAX_MEGAPIXELS, WEIGHTS
from bgars.io.light_discovery import undescribed
from bgars.io.mask_hints import tell_unused_masks
from bgars.io.masks import opaque_everywhere, read_mask
from bgars.io.recipe import RECIPE_NAME, CaptureRecipe, read_recipe
from bgars.records.capture import Capture
from bgars.records.plain_arrays import every_pixel
from bgars.records.rig import STAND_IN_DEG, LightRig
from bgars.records.scalar_checks import thread_count
from bgars.records.station_apply import with_station

if TYPE_CHECKING:
    from collections.abc import Sequence
    from os import PathLike
    from pathlib import Path

    from numpy.typing import NDArray

    from bgars.io.recipe import ChannelName
    from bgars.records.pixels import BoolArray, FloatArray, PixelArray
    from bgars.records.station import Station

__all__ = ["read_capture", "read_unlit"]

RGB = 3


def read_capture(
    folder: str | PathLike[str],
    *,
    channel: ChannelName | None = None,
    images: Sequence[str] | None = None,
    max_megapixels: float = MAX_MEGAPIXELS,
    threads: int | None = None,
    station: Station | str | PathLike[str] | None = None,
) -> Capture:
    """Read a folder of photographs, one light at a time, with the description of its lights.

    With a ``capture.toml`` in the folder, that recipe says everything. Without one, the lights come from
    ``light_directions.txt`` (and ``light_intensities.txt``, ``filenames.txt``: the DiLiGenT layout), from the only
    ``.lp`` file, or from the only other file about lights (docs/captures.md lists the formats), and an image called
    mask is the mask. Image order: recipe, else ``filenames.txt``, else the file of the lights, else the image files in
    natural order (masks, dark frames, normal maps and previews left out).

    Whatever had to be assumed is said: a :class:`~bgars.CaptureWarning` each, kept in ``Capture.assumed``.

    Parameters
    ----------
    folder : path
        The capture folder.
    channel : {"luminance", "mean", "red", "green", "blue"}, optional
        How a colour pixel becomes one value (linear, no hidden gamma); the recipe's choice by default, else luminance.
    images : sequence of str, optional
        Use only these image files, in this order; their lights are picked by name.
    max_megapixels : float
        Images whose header claims more are refused before anything is allocated.
    threads : int, optional
        Largest number of threads; by default ``RAYON_NUM_THREADS``, else one per core.
    station : Station or path, optional
        What is known of the station (:func:`bgars.read_station`): lights, response, flat field and scale are then
        taken from it, one light per image in its order. By default what ``station`` in ``capture.toml`` names.

    Returns
    -------
    Capture
        Grey images keep their dtype (no float copy). Colour images with a response or with intensities that differ
        between the channels become float32; these are then in the values, and the rig's intensities are 1.

    Raises
    ------
    FileFormatError
        A file is missing, truncated, oversized, or not what it should be.
    InputError
        Lights and images do not fit, an unknown recipe key, an empty or wrongly sized mask, NaN inside the mask.

    Examples
    --------
    >>> import bgars
    >>> capture = bgars.read_capture(bgars.sample_capture())
    >>> capture.images.shape, capture.pixel_pitch_um
    ((8, 240, 256), 3.4)
    """
    threads = thread_count(threads)
    folder = need_folder(folder)
    notes: list[str] = []
    listing = list_folder(folder)
    if RECIPE_NAME in (*listing.others, *listing.folders):
        recipe = read_recipe(folder / RECIPE_NAME)
    else:
        recipe = undescribed(folder, listing, notes, may_lack_lights=station is not None)
    known, station_name = station_of(folder, recipe, station)
    if known is None or known.lights is None or recipe.lights is not None:
        lights = read_lights(folder, recipe, notes)
    else:
        lights = _by_order(known.lights.rig, known.name)
    if recipe.exposures_ms is not None:
        if images is not None:
            msg = f"images: cannot be chosen from an exposure bracket (exposures_ms in {folder / RECIPE_NAME})"
            raise InputError(msg)
        capture = _load_bracket(folder, recipe, lights, listing, channel, max_megapixels, threads, notes, known)
    else:
        capture = _load_chosen(folder, recipe, lights, listing, images, channel, max_megapixels, threads, notes)
    _tell(folder, notes)
    return seen_through(capture, known, folder, station_name)


def read_unlit(folder: str | PathLike[str], *, channel: ChannelName | None = None) -> Capture:
    """Read the images of a folder whose lights are not known yet, of a ball, a board or a grid.

    As :func:`read_capture` in all else, but that the only image called dark is taken as the dark frame where nothing
    is described. Where the folder does describe lights, these are read; else an even ring at 45 degrees stands in.

    Raises
    ------
    InputError, FileFormatError
        One or two images, or what :func:`read_capture` refuses.
    """
    folder = need_folder(folder)
    notes: list[str] = []
    listing = list_folder(folder)
    if RECIPE_NAME in listing.others:
        recipe = read_recipe(folder / RECIPE_NAME)
    else:
        recipe = undescribed(folder, listing, notes, may_lack_lights=True)
        darks = [name for name in listing.special if role_of(name) == "a dark frame"]
        if recipe.lights is None and len(darks) == 1:
            recipe = recipe.model_copy(update={"dark": darks[0]})
            notes.append(f"{darks[0]} taken as the dark frame, and subtracted")
    if recipe.lights is not None:
        return read_capture(folder, channel=channel)
    if recipe.exposures_ms is not None:
        lights = _by_order(_stand_in(lights_in_bracket(folder, recipe)), str(folder))
        return _load_bracket(folder, recipe, lights, listing, channel, MAX_MEGAPIXELS, None, notes, None)
    if (count := len(recipe.images or listing.images)) in {1, 2}:
        msg = f"{folder}: {count} image{'s'[: count - 1]}, 3 are needed or more; of a grid, copies will do"
        raise InputError(msg)
    lights = _by_order(_stand_in(count), str(folder) if count else "")
    capture = _load_chosen(folder, recipe, lights, listing, None, channel, MAX_MEGAPIXELS, None, notes)
    _tell(folder, notes)
    return capture


def _tell(folder: Path, notes: list[str]) -> None:
    for note in notes:
        warnings.warn(f"{folder}: {note}", CaptureWarning, stacklevel=3)


def _stand_in(count: int) -> LightRig:
    """Lights of which nothing is known: that they are a ring is no statement to hold against what is found."""
    rig = LightRig.ring(max(count, 3))
    return replace(rig, u_deg=np.full(len(rig), STAND_IN_DEG))


def _by_order(rig: LightRig, source: str) -> Lights:
    """Lights that name no images: they take them as they come."""
    return Lights(replace(rig, files=()), np.ones((len(rig), 1)), source)


def _load_chosen(
    folder: Path,
    recipe: CaptureRecipe,
    lights: Lights,
    listing: Listing,
    images: Sequence[str] | None,
    channel: ChannelName | None,
    max_megapixels: float,
    threads: int | None,
    notes: list[str],
) -> Capture:
    """Choose the images of the lights, and read them."""
    chosen = choose_images(folder, recipe, lights, listing, notes)
    lights, names = match(folder, lights, chosen, images)
    if recipe.mask is None and chosen.mask is not None:
        recipe = recipe.model_copy(update={"mask": chosen.mask})
    if recipe.mask is None:
        tell_unused_masks(folder, listing, names, notes)
    return _load(folder, recipe, lights, names, channel or recipe.channel, max_megapixels, threads, notes)


def _load_bracket(
    folder: Path,
    recipe: CaptureRecipe,
    lights: Lights,
    listing: Listing,
    channel: ChannelName | None,
    max_megapixels: float,
    threads: int | None,
    notes: list[str],
    station: Station | None,
) -> Capture:
    """Read every exposure as a capture of its own, and merge them."""
    times = recipe.exposures_ms or []
    names = bracket_names(recipe, len(lights.rig))
    found: dict[int, Capture] = {}
    saturation: float | None = None
    # The longest one first: it clips, and so tells how many bits the camera has.
    for place in sorted(range(len(times)), key=lambda index: -times[index]):
        one = recipe_of_exposure(recipe, names[place], place, saturation)
        said: list[str] = []
        capture = _load_chosen(folder, one, lights, listing, None, channel, max_megapixels, threads, said)
        notes += [note for note in said if note not in notes]
        if saturation is None and capture.images.dtype.kind == "u":
            saturation = capture.saturation
        if station is not None and station.response is not None:
            capture = with_station(capture, replace(station, lights=None, flat=None, scale=None))
        found[place] = capture
    merged, said = merge_exposures([found[place] for place in range(len(times))], times)
    notes += said
    return replace(merged, assumed=tuple(notes))


def _load(
    folder: Path,
    recipe: CaptureRecipe,
    lights: Lights,
    names: list[str],
    channel: ChannelName,
    max_megapixels: float,
    threads: int | None,
    notes: list[str],
) -> Capture:
    """Decode the images and bring them, the dark frame and the levels to what a Capture promises."""
    stack = len(names) == 1 and len(lights.rig) > 1
    paths = [folder / name for name in names] * (len(lights.rig) if stack else 1)
    if stack:
        notes.append(f"{names[0]} taken as a stack of {len(paths)} images, in the order of the lights")
    headers = read_headers(paths[:1] if stack else paths, stack=stack)
    if headers.doubt and "response" not in recipe.model_fields_set:
        notes.append(
            f"{headers.doubt}, but is taken as linear; if a camera or phone made it, "
            f'write response = "srgb" in {RECIPE_NAME}, or "linear" to confirm'
        )
    decoding = Decoding(paths, stack, channel, max_megapixels, threads)
    table = response_table(folder, recipe, decoding)
    gains = _channel_gains(lights.intensities)
    images, linear, code_scale = decoding.decode(table, gains)
    images = _turn(images, headers, notes)
    mask = _mask(folder, recipe, images, headers, notes)
    refuse_nan(images, mask, paths)

    levels = levels_of(folder, recipe, images, code_scale, threads, notes)
    dark_path = None if recipe.dark is None else folder / recipe.dark
    in_values = linear and gains is not None
    dark = None
    if in_values and gains is not None:
        subtract_offset(images, dark_path, levels.black_level, channel, table, gains)
        full_scale = levels.full_scale * float(np.mean(gains @ np.array(WEIGHTS[channel])))
        levels = Levels(full_scale, saturation=float("inf"), black_level=0.0)
    else:
        if dark_path is not None:
            dark = read_dark(dark_path, images, channel, table)
        if linear or images.dtype.kind == "f":
            images, dark, levels = linearise_floats(folder, recipe, images, dark, levels, linear)
    note_light_below_zero(images, levels.black_level if dark is None else dark, mask, paths, notes)
    files = tuple(f"{names[0]}[{index}]" for index in range(len(paths))) if stack else tuple(names)
    rig = lights.rig.with_intensities(
        np.ones(len(paths)) if in_values else _one_intensity(lights.intensities, channel), files=files
    )
    note_far_lights(rig, notes)
    return Capture(
        images=images,
        rig=rig,
        mask=mask,
        pixel_pitch_um=lights.pixel_pitch_um if recipe.pixel_pitch_um is None else recipe.pixel_pitch_um,
        pixel_pitch_u_um=recipe.pixel_pitch_u_um,
        camera_distance_mm=None if recipe.camera is None else recipe.camera.distance_mm,
        dark=dark,
        response=table if images.dtype.kind == "u" else None,
        black_level=levels.black_level,
        saturation=levels.saturation,
        full_scale=levels.full_scale,
        files=tuple(paths),
        folder=folder,
        assumed=tuple(notes),
    )


def _turn(images: PixelArray, headers: Headers, notes: list[str]) -> PixelArray:
    """Turn all images as their tags say."""
    if headers.orientation == 1:
        return images
    notes.append(f"images turned upright, as their orientation tag ({headers.orientation}) says")
    turned: PixelArray = np.stack([upright(image, headers.orientation) for image in images])
    return turned


def _mask(folder: Path, recipe: CaptureRecipe, images: PixelArray, headers: Headers, notes: list[str]) -> BoolArray:
    """The mask of the recipe, else what no image declares transparent."""
    shape = (images.shape[1], images.shape[2])
    if headers.with_extra:
        notes.append(f"a further channel of unstated meaning is not used ({headers.with_extra[0].name})")
    if recipe.mask is not None:
        return read_mask(folder / recipe.mask, shape, notes)
    opaque = opaque_everywhere(headers.with_alpha, headers.orientation)
    if opaque is None or opaque.shape != shape:
        return every_pixel(shape)
    if not opaque.any():
        msg = f"{headers.with_alpha[0]}: no pixel is opaque in all images"
        raise InputError(msg)
    notes.append("transparent pixels of the images taken as outside the mask")
    return opaque


def _channel_gains(intensities: NDArray[np.float64]) -> FloatArray | None:
    """(L, 3) factors where red, green and blue differ in their lights, else None."""
    if intensities.shape[1] != RGB or np.allclose(intensities, intensities[:, :1], rtol=1e-6):
        return None
    return np.ascontiguousarray(1.0 / intensities, dtype=np.float32)


def _one_intensity(intensities: NDArray[np.float64], channel: ChannelName) -> NDArray[np.float64]:
    """(L,) intensities as the chosen combination of channels sees them."""
    if intensities.shape[1] != RGB:
        return intensities[:, 0]
    weights = np.array(WEIGHTS[channel])
    combined: NDArray[np.float64] = intensities @ weights / weights.sum()
    return combined
