"""Read a capture folder: images, lights, mask, dark frame, response."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bgars.errors import FileFormatError, InputError
from bgars.io.capture_lights import default_recipe, image_names, match, read_lights
from bgars.io.given_paths import need_folder
from bgars.io.images import MAX_MEGAPIXELS, WEIGHTS, decode_stack, read_mask
from bgars.io.recipe import RECIPE_NAME, CaptureRecipe, GammaResponse, TableResponse, read_recipe
from bgars.io.response import Curve, gamma_curve, linearise, read_response_table, tabulate
from bgars.records import Capture, every_pixel, float_full_scale
from bgars.scalar_checks import thread_count

if TYPE_CHECKING:
    from collections.abc import Sequence
    from os import PathLike

    from numpy.typing import NDArray

    from bgars.io.capture_lights import Lights
    from bgars.io.recipe import ChannelName
    from bgars.records import BoolArray, FloatArray, PixelArray

__all__ = ["read_capture"]

RGB = 3


def read_capture(
    folder: str | PathLike[str],
    *,
    channel: ChannelName | None = None,
    images: Sequence[str] | None = None,
    max_megapixels: float = MAX_MEGAPIXELS,
    threads: int | None = None,
) -> Capture:
    """Read a folder of photographs, one light at a time, with the description of its lights.

    With a ``capture.toml`` in the folder, that recipe says everything. Without one, the lights come from
    ``light_directions.txt`` (and ``light_intensities.txt``, ``filenames.txt``: the DiLiGenT layout) or from the only
    ``.lp`` file, and ``mask.png`` is the mask if it exists. Image order: recipe, else ``filenames.txt``, else the
    ``.lp`` file, else the image files in natural order (files that start with "mask" or "dark" left out).

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
        Most threads to decode on; by default what ``RAYON_NUM_THREADS`` says, else one a core.

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
    recipe_path = folder / RECIPE_NAME
    recipe = read_recipe(recipe_path) if recipe_path.exists() else default_recipe(folder)
    lights = read_lights(folder, recipe)
    names = image_names(folder, recipe, lights)
    lights, names = match(folder, lights, names, images)
    return _load(folder, recipe, lights, names, channel or recipe.channel, max_megapixels, threads)


class _Radiometry(NamedTuple):
    """Grey levels of a stack that are not pixels."""

    full_scale: float
    saturation: float
    black_level: float


def _load(
    folder: Path,
    recipe: CaptureRecipe,
    lights: Lights,
    names: list[str],
    channel: ChannelName,
    max_megapixels: float,
    threads: int | None,
) -> Capture:
    """Decode the images and bring them, the dark frame and the levels to what a Capture promises."""
    paths = [folder / name for name in names]
    for path in paths:
        if not path.is_file():
            msg = f"{path}: no such image file"
            raise FileFormatError(msg)
    table = _response_table(folder, recipe, paths[0], max_megapixels)
    gains = _channel_gains(lights.intensities)
    images, linear, code_scale = decode_stack(
        paths, channel=channel, response=table, gains=gains, max_megapixels=max_megapixels, threads=threads
    )
    shape = (images.shape[1], images.shape[2])
    mask = every_pixel(shape) if recipe.mask is None else read_mask(folder / recipe.mask, shape)
    _refuse_nan(images, mask, paths)

    levels = _levels(folder, recipe, images, code_scale, threads)
    dark_path = None if recipe.dark is None else folder / recipe.dark
    in_values = linear and gains is not None
    dark = None
    if in_values and gains is not None:
        _subtract_offset(images, dark_path, levels.black_level, channel, table, gains)
        full_scale = levels.full_scale * float(np.mean(gains @ np.array(WEIGHTS[channel])))
        levels = _Radiometry(full_scale, saturation=float("inf"), black_level=0.0)
    else:
        if dark_path is not None:
            dark = _read_dark(dark_path, images, channel, table)
        if linear or images.dtype.kind == "f":
            images, dark, levels = _linearise_floats(folder, recipe, images, dark, levels, linear)
    rig = lights.rig.with_intensities(
        np.ones(len(paths)) if in_values else _one_intensity(lights.intensities, channel), files=tuple(names)
    )
    if rig.is_near and recipe.pixel_pitch_um is None:
        msg = f"{folder / RECIPE_NAME}: pixel_pitch_um: needed with lights.positions_mm, to place pixels under lights"
        raise InputError(msg)
    return Capture(
        images=images,
        rig=rig,
        mask=mask,
        pixel_pitch_um=recipe.pixel_pitch_um,
        pixel_pitch_u_um=recipe.pixel_pitch_u_um,
        camera_distance_mm=None if recipe.camera is None else recipe.camera.distance_mm,
        dark=dark,
        response=table if images.dtype.kind == "u" else None,
        black_level=levels.black_level,
        saturation=levels.saturation,
        full_scale=levels.full_scale,
        files=tuple(paths),
        folder=folder,
    )


def _curve(folder: Path, recipe: CaptureRecipe, full_scale: float) -> Curve | None:
    """The inverse response that the recipe names; None for a linear camera."""
    if isinstance(recipe.response, GammaResponse):
        return gamma_curve(recipe.response.gamma, full_scale)
    if isinstance(recipe.response, TableResponse):
        return read_response_table(folder / recipe.response.table, full_scale)
    return None


def _response_table(folder: Path, recipe: CaptureRecipe, first: Path, max_megapixels: float) -> FloatArray | None:
    """Linear grey level by code for integer images; the first image tells how many codes there are."""
    if recipe.response == "linear":
        return None
    full_scale = decode_stack([first], max_megapixels=max_megapixels).full_scale
    if full_scale is None:
        return None
    curve = _curve(folder, recipe, full_scale)
    return None if curve is None else tabulate(curve, int(full_scale) + 1)


def _channel_gains(intensities: NDArray[np.float64]) -> FloatArray | None:
    """(L, 3) factors where red, green and blue differ in their lights, else None."""
    if intensities.shape[1] != RGB or np.allclose(intensities, intensities[:, :1], rtol=1e-6):
        return None
    return (1.0 / intensities).astype(np.float32)


def _one_intensity(intensities: NDArray[np.float64], channel: ChannelName) -> NDArray[np.float64]:
    """(L,) intensities as the chosen combination of channels sees them."""
    if intensities.shape[1] != RGB:
        return intensities[:, 0]
    weights = np.array(WEIGHTS[channel])
    combined: NDArray[np.float64] = intensities @ weights / weights.sum()
    return combined


def _levels(
    folder: Path, recipe: CaptureRecipe, images: PixelArray, code_scale: float | None, threads: int | None
) -> _Radiometry:
    """Full scale of the files, clip and black level in the grey levels of the files."""
    if code_scale is not None:
        full_scale = code_scale
        saturation = full_scale if recipe.saturation is None else recipe.saturation
    elif recipe.saturation is not None:
        full_scale = saturation = recipe.saturation
    else:
        full_scale, saturation = float_full_scale(images, threads), float("inf")
    if not recipe.black_level < min(full_scale, saturation):
        msg = (
            f"{folder / RECIPE_NAME}: black_level: must be below the saturation level "
            f"({min(full_scale, saturation):g}), got {recipe.black_level:g}"
        )
        raise InputError(msg)
    return _Radiometry(full_scale, saturation, recipe.black_level)


def _read_dark(path: Path, images: PixelArray, channel: ChannelName, table: FloatArray | None) -> PixelArray:
    """The dark frame, decoded as the images were."""
    dark = decode_stack([path], channel=channel, response=table).images[0]
    if dark.shape != images.shape[1:]:
        msg = (
            f"{path}: the dark frame is {dark.shape[1]} x {dark.shape[0]} pixels, "
            f"but the images are {images.shape[2]} x {images.shape[1]}"
        )
        raise InputError(msg)
    if dark.dtype != images.dtype:
        msg = f"{path}: the dark frame has pixels of {dark.dtype}, but the images have {images.dtype}"
        raise InputError(msg)
    return np.ascontiguousarray(dark)


def _linearise_floats(
    folder: Path,
    recipe: CaptureRecipe,
    images: PixelArray,
    dark: PixelArray | None,
    levels: _Radiometry,
    in_values: bool,
) -> tuple[PixelArray, PixelArray | None, _Radiometry]:
    """Invert the response of float pixels (unless the decoder did) and of the levels that go with them."""
    full_scale = levels.full_scale
    curve = _curve(folder, recipe, full_scale)
    if curve is None:
        return images, dark, levels
    if not in_values:
        images = linearise(images, curve, full_scale)
        dark = None if dark is None else linearise(dark, curve, full_scale)
    black_level, saturation = linearise(np.array([levels.black_level, levels.saturation]), curve, full_scale)
    if np.isinf(levels.saturation):
        saturation = np.float32(np.inf)  # the curve ends at full scale, but nothing was said to clip there
    return images, dark, levels._replace(black_level=float(black_level), saturation=float(saturation))


def _subtract_offset(
    images: PixelArray,
    dark_path: Path | None,
    black_level: float,
    channel: ChannelName,
    table: FloatArray | None,
    gains: FloatArray,
) -> None:
    """Subtract what no light reads, in place: with gains of their own, each image has an offset of its own."""
    if dark_path is not None:
        for index, gain in enumerate(gains):
            images[index] -= decode_stack([dark_path], channel=channel, response=table, gains=gain[None]).images[0]
    else:
        level = black_level if table is None else np.interp(black_level, np.arange(len(table)), table)
        images -= (level * (gains @ np.array(WEIGHTS[channel], dtype=np.float32)))[:, None, None]


def _refuse_nan(images: PixelArray, mask: BoolArray, paths: list[Path]) -> None:
    if images.dtype.kind != "f":
        return
    for image, path in zip(images, paths, strict=True):
        bad = ~np.isfinite(image) & mask
        if bad.any():
            row, col = np.argwhere(bad)[0]
            msg = (
                f"{path}: {int(bad.sum())} pixels inside the mask are not finite (first at row {row}, column {col}); "
                "mask them out"
            )
            raise InputError(msg)
