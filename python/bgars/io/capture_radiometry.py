"""From the grey levels of a capture's files to values that are proportional to light, and the levels that matter."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bgars.errors import InputError
from bgars.io.image_formats import format_of
from bgars.io.image_tags import read_tags, upright
from bgars.io.images import WEIGHTS, DecodedStack, decode_pages, decode_stack
from bgars.io.recipe import RECIPE_NAME, CaptureRecipe, GammaResponse, TableResponse
from bgars.io.response import Curve, gamma_curve, linearise, read_response_table, srgb_curve
from bgars.records.bit_depth import FEWEST_BITS, find_bit_depth
from bgars.records.pixels import float_full_scale

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from bgars.io.recipe import ChannelName
    from bgars.records.pixels import FloatArray, PixelArray

__all__ = ["Decoding", "Levels", "levels_of", "linearise_floats", "read_dark", "response_table", "subtract_offset"]

U8_SCALE, U16_SCALE = 255.0, 65535.0


class Levels(NamedTuple):
    """Grey levels of a stack that are not pixels."""

    full_scale: float
    saturation: float
    black_level: float


class Decoding(NamedTuple):
    """How the files of one capture are decoded."""

    paths: list[Path]
    stack: bool
    channel: ChannelName
    max_megapixels: float
    threads: int | None

    def decode(self, response: FloatArray | None = None, gains: FloatArray | None = None) -> DecodedStack:
        """Decode all images."""
        if self.stack:
            return decode_pages(
                self.paths[0],
                len(self.paths),
                channel=self.channel,
                response=response,
                gains=gains,
                max_megapixels=self.max_megapixels,
            )
        return decode_stack(
            self.paths,
            channel=self.channel,
            response=response,
            gains=gains,
            max_megapixels=self.max_megapixels,
            threads=self.threads,
        )


def response_table(folder: Path, recipe: CaptureRecipe, decoding: Decoding) -> FloatArray | None:
    """Linear grey level by code for integer images; the images tell how many codes the camera has."""
    if recipe.response == "linear":
        return None
    if decoding.stack:
        plain = decoding.decode()
    else:
        plain = decode_stack(decoding.paths[:1], channel=decoding.channel, max_megapixels=decoding.max_megapixels)
        if plain.full_scale == U16_SCALE:
            plain = decoding.decode()
    if plain.full_scale is None:
        return None
    full_scale = _integer_levels(recipe, plain.images, plain.full_scale, [])[0]
    curve = _curve(folder, recipe, full_scale)
    codes = np.arange(plain.full_scale + 1.0)
    return None if curve is None else linearise(codes, curve, full_scale)


def levels_of(
    folder: Path,
    recipe: CaptureRecipe,
    images: PixelArray,
    code_scale: float | None,
    threads: int | None,
    notes: list[str],
) -> Levels:
    """Full scale of the camera, clip and black level in the grey levels of the files."""
    if code_scale is not None and recipe.saturation is not None and recipe.saturation > code_scale:
        msg = (
            f"{folder / RECIPE_NAME}: saturation: no pixel of these images can exceed {code_scale:g}, "
            f"got {recipe.saturation:g}"
        )
        raise InputError(msg)
    if code_scale is not None and recipe.saturation is not None and recipe.saturation <= 1.0:
        msg = (
            f"{folder / RECIPE_NAME}: saturation: must be the grey level that clips, of {code_scale:g}, "
            f"got {recipe.saturation:g}; leave it out if that is full scale"
        )
        raise InputError(msg)
    if code_scale is not None:
        full_scale, saturation = _integer_levels(recipe, images, code_scale, notes)
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
    if 0.0 < recipe.black_level < 1.0 and full_scale >= U8_SCALE:
        notes.append(
            f"black_level = {recipe.black_level:g} is less than one of {full_scale:g} grey levels; if it is a share of "
            f"full scale, write black_level = {recipe.black_level * full_scale:.4g}"
        )
    return Levels(full_scale, saturation, recipe.black_level)


def _integer_levels(
    recipe: CaptureRecipe, images: PixelArray, code_scale: float, notes: list[str]
) -> tuple[float, float]:
    """Full scale and saturation of integer files: those of the camera where it has fewer bits than its files."""
    if recipe.saturation is not None:
        stated = recipe.saturation
        bits = int(stated + 1).bit_length() - 1
        is_depth = stated < code_scale and stated == 2.0**bits - 1 and bits >= FEWEST_BITS
        return stated if is_depth and images.max() <= stated else code_scale, stated
    depth = find_bit_depth(images)
    if depth is None:
        return code_scale, code_scale
    if depth.clipped:
        notes.append(
            f"the camera has {depth.bits} bits: {depth.reason}; saturation = {depth.saturation} is assumed "
            f"(saturation in {RECIPE_NAME} overrides it)"
        )
    return float(depth.saturation), float(depth.saturation)


def _curve(folder: Path, recipe: CaptureRecipe, full_scale: float) -> Curve | None:
    """The inverse response that the recipe names; None for a linear camera."""
    if recipe.response == "srgb":
        return srgb_curve(full_scale)
    if isinstance(recipe.response, GammaResponse):
        return gamma_curve(recipe.response.gamma, full_scale)
    if isinstance(recipe.response, TableResponse):
        return read_response_table(folder / recipe.response.table, full_scale)
    return None


def read_dark(path: Path, images: PixelArray, channel: ChannelName, table: FloatArray | None) -> PixelArray:
    """The dark frame, decoded as the images were."""
    dark = _decode_upright(path, channel, table)
    if dark.shape != images.shape[1:]:
        msg = (
            f"{path}: the dark frame is {dark.shape[1]} x {dark.shape[0]} pixels, "
            f"but the images are {images.shape[2]} x {images.shape[1]}"
        )
        raise InputError(msg)
    if dark.dtype != images.dtype:
        msg = f"{path}: the dark frame has pixels of {dark.dtype}, but the images have {images.dtype}"
        raise InputError(msg)
    return dark


def _decode_upright(
    path: Path, channel: ChannelName, table: FloatArray | None, gains: FloatArray | None = None
) -> PixelArray:
    tags = read_tags(path, format_of(path))
    if tags.pages > 1:
        msg = f"{path}: holds {tags.pages} images; a dark frame is one"
        raise InputError(msg)
    dark: PixelArray = upright(
        decode_stack([path], channel=channel, response=table, gains=gains).images[0], tags.orientation
    )
    return dark


def linearise_floats(
    folder: Path,
    recipe: CaptureRecipe,
    images: PixelArray,
    dark: PixelArray | None,
    levels: Levels,
    in_values: bool,
) -> tuple[PixelArray, PixelArray | None, Levels]:
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


def subtract_offset(
    images: PixelArray,
    dark_path: Path | None,
    black_level: float,
    channel: ChannelName,
    table: FloatArray | None,
    gains: NDArray[np.float32],
) -> None:
    """Subtract what no light reads, in place: with gains of their own, each image has an offset of its own."""
    if dark_path is not None:
        for index, gain in enumerate(gains):
            images[index] -= _decode_upright(dark_path, channel, table, gain[None])
    else:
        level = black_level if table is None else np.interp(black_level, np.arange(len(table)), table)
        images -= (level * (gains @ np.array(WEIGHTS[channel], dtype=np.float32)))[:, None, None]
