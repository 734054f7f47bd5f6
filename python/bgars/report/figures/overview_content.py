"""What an overview shows of a reconstruction, reduced to the pixels of a picture: little to hand to another process."""

from __future__ import annotations

import textwrap
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from bgars.files.counted import counted
from bgars.files.light_names import light_name
from bgars.report.color_ramp import cividis
from bgars.report.figures.prior import prior_label, prior_legend, prior_overlay, prior_pixels, stripes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bgars.pipelines.reconstruct import Reconstruction
    from bgars.records.height_map import HeightMap

    Array = NDArray[np.float64]

__all__ = ["OverviewContent", "Profile", "Surface", "overview_content"]

MAX_SURFACE_POINTS = 240
MAX_PICTURE_PX = 1600
AMBIENT = 0.25
PICTURE_LIGHT = (-0.55, -0.4, 0.73)
WEIGHING_METHODS = ("reflectance", "blind")
TITLE_WIDTH = 150
SURFACE_STRIPES = 45


@dataclass(frozen=True)
class Surface:
    """The largest part: heights, their spacing, (H, W, 3) colours from 0 to 1, and what to write above."""

    z: Array
    spacing: float
    colors: Array
    title: str


@dataclass(frozen=True)
class Profile:
    """Heights along a row of `cols` pixels of size `pitch`, which of them are a prior, and where the row is."""

    row: int
    y: float
    cols: int
    pitch: float
    height: NDArray[np.float32]
    prior: NDArray[np.bool_]
    rise: float


@dataclass(frozen=True)
class OverviewContent:
    """Thinned pictures with their titles and ranges.

    Attributes
    ----------
    title : str
    unit : str
        Of all lengths, as it is written.
    extent : (float, float, float, float)
        Left, right, bottom, top of the image; origin at its centre.
    image : (h, w) pixels
        Under the first light; white at `image_top`.
    image_top : float
    image_title : str
    lights : int
    normals : (h, w, 3) float32
    overlay : (h, w, 4) uint8 or None
        Stripes over what is a prior.
    prior : str
        Where the prior normals come from.
    prior_legend : str
        The same, and how many they are.
    error_deg, kept : (h, w) floating or None
        Standard error of the normals of methods that weigh all lights, or number of lights kept; NaN = no normal.
    height : (h, w) float32
        Its usual range is `height_range`.
    height_range : (float, float)
    parts : int
        Connected parts of the height map.
    surface : Surface
    profile : Profile
        Through the highest point: it crosses a ball, if there is one.
    """

    title: str
    unit: str
    extent: tuple[float, float, float, float]
    image: NDArray[Any]
    image_top: float
    image_title: str
    lights: int
    normals: NDArray[np.float32]
    overlay: NDArray[np.uint8] | None
    prior: str
    prior_legend: str
    error_deg: NDArray[np.float32] | None
    kept: Array | None
    height: NDArray[np.float32]
    height_range: tuple[float, float]
    parts: int
    surface: Surface
    profile: Profile


def overview_content(result: Reconstruction) -> OverviewContent:
    """Reduce a reconstruction to what is drawn of it."""
    capture, field, height = result.capture, result.field, result.height
    rows, cols = height.mask.shape
    pitch = height.pixel_pitch_um or 1.0
    weighs = field.method in WEIGHING_METHODS
    image = _thinned(capture.images[0])
    inside = image.astype(np.float32)[_thinned(capture.mask)]
    rig = capture.rig
    place = f"azimuth {rig.azimuths_deg[0]:.0f}°, elevation {rig.elevations_deg[0]:.0f}°"
    mask, heights = _thinned(field.mask), _thinned(height.height)
    known = heights[np.isfinite(heights)]
    low, high = np.percentile(known if known.size else height.height_px, [0.5, 99.5])
    return OverviewContent(
        title=_title(result),
        unit=_unit(height),
        extent=(-cols / 2 * pitch, cols / 2 * pitch, -rows / 2 * pitch, rows / 2 * pitch),
        image=image,
        image_top=float(np.percentile(inside if inside.size else image, 99.8)),
        image_title=f"Input: {light_name(0, capture.files)} of {len(rig)}\n{place}",
        lights=len(rig),
        normals=_thinned(field.normals),
        overlay=prior_overlay(field),
        prior=prior_label(field),
        prior_legend=prior_legend(field),
        error_deg=np.where(mask, _thinned(field.standard_error_deg), np.float32(np.nan)) if weighs else None,
        kept=None if weighs else np.where(mask, _thinned(field.lights_kept), np.nan),
        height=heights,
        height_range=(float(low), float(high)),
        parts=len(height.components),
        surface=_surface(result),
        profile=_profile(result),
    )


def _title(result: Reconstruction) -> str:
    capture, height = result.capture, result.height
    scale = "pixel pitch unknown" if capture.pixel_pitch_um is None else f"{capture.pixel_pitch_um:g} µm per pixel"
    parts = len(height.components)
    title = (
        f"{capture.name}: {len(capture.rig)} lights, {capture.images.shape[2]} x {capture.images.shape[1]} px, "
        f"{scale}; "
        f"method {result.field.method}; {counted(parts, 'connected part')}"
    )
    choice = textwrap.wrap(f"Normals: {result.field.method_reason}", TITLE_WIDTH) if result.field.method_reason else []
    return "\n".join([title, *choice])


def _unit(height: HeightMap) -> str:
    return "µm" if height.unit == "um" else "px"


def _thinned(values: NDArray[Any]) -> NDArray[Any]:
    """As many pixels as a picture shows: thinned before anything is made of them."""
    step = max(1, int(np.ceil(max(values.shape[:2]) / MAX_PICTURE_PX)))
    return np.ascontiguousarray(values[::step, ::step])


def _surface(result: Reconstruction) -> Surface:
    """Shaded relief of the largest part, thinned to a drawable number of points."""
    height = result.height
    largest = int(np.argmax([part.pixels for part in height.components]))
    inside = height.labels == largest
    rows, cols = np.flatnonzero(inside.any(axis=1)), np.flatnonzero(inside.any(axis=0))
    step = max(1, int(np.ceil(max(np.ptp(rows), np.ptp(cols)) / MAX_SURFACE_POINTS)))
    thinned = (slice(rows[0], rows[-1] + 1, step), slice(cols[0], cols[-1] + 1, step))
    pitch = height.pixel_pitch_um or 1.0
    z = np.where(inside[thinned], height.height[thinned], np.nan).astype(np.float64)
    colors = _shaded_colors(z, pitch * step)
    colors *= 1.0 - stripes(prior_pixels(result.field)[thinned], SURFACE_STRIPES)[..., None]
    part = ", largest part" if len(height.components) > 1 else ""
    wide, deep = (np.ptp(cols) + 1) * pitch, (np.ptp(rows) + 1) * pitch
    rise = float(np.nanmax(z) - np.nanmin(z))
    size = f"{wide:.4g} x {deep:.4g} x {rise:.4g} {_unit(height)} (x, y, z)"
    return Surface(z, pitch * step, colors, f"Surface, true to scale{part}\n{size}")


def _shaded_colors(z: Array, spacing: float) -> Array:
    """(H, W, 3) colours of a relief: by height, as bright as a light from the lower left makes it."""
    filled = np.where(np.isfinite(z), z, np.nanmin(z))
    slope_down, slope_right = np.gradient(filled, spacing) if min(z.shape) > 1 else (np.zeros_like(z),) * 2
    normals = np.stack([-slope_right, slope_down, np.ones_like(z)], axis=2)
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    brightness = AMBIENT + (1.0 - AMBIENT) * np.clip(normals @ np.array(PICTURE_LIGHT), 0.0, 1.0)
    low, high = np.nanpercentile(z, [0.5, 99.5])
    colors = cividis((filled - low) / max(high - low, 1e-9))
    shaded: Array = np.clip(colors * brightness[..., None] * 1.25, 0.0, 1.0)
    return shaded


def _profile(result: Reconstruction) -> Profile:
    height = result.height
    rows, cols = height.mask.shape
    pitch = height.pixel_pitch_um or 1.0
    row = int(np.argmax(np.where(height.mask, height.height_px, -np.inf))) // cols
    values = height.height[row]
    return Profile(
        row=row,
        y=(rows / 2 - row - 0.5) * pitch,
        cols=cols,
        pitch=pitch,
        height=values,
        prior=prior_pixels(result.field)[row],
        rise=float(np.ptp(values[height.mask[row]])),
    )
