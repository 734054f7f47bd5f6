"""The scale of a station's images."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Scale"]


@dataclass(frozen=True)
class Scale:
    """Pixel pitch and camera as a grid shows them.

    Attributes
    ----------
    pixel_pitch_um, pixel_pitch_u_um : float
        Size of a pixel on the board, at the image centre, and its standard uncertainty.
    tilt_deg : float
        Angle of the grid against the image plane; NaN where the distance of the camera is not known, or endless.
    rotation_deg : float
        Of the grid in the image, counter-clockwise.
    distortion : float
        Radial: displacement at the corner of the image, of its distance from the centre.
    residual_px : float
        Root mean square of the points against the model.
    points : int
        Points of the grid.
    camera_distance_mm : float or None
        From the camera to the board, by grids at two heights or more; infinite of a telecentric lens.
    size_px : (int, int) or None
        Height and width of the images that it holds for.
    """

    pixel_pitch_um: float
    pixel_pitch_u_um: float
    tilt_deg: float = float("nan")
    rotation_deg: float = 0.0
    distortion: float = 0.0
    residual_px: float = 0.0
    points: int = 0
    camera_distance_mm: float | None = None
    size_px: tuple[int, int] | None = None
