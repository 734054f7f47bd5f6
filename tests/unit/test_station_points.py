"""Highlights that are hardly larger than a pixel, or that nothing but a few clipped pixels shows."""

from __future__ import annotations

import bgars
import numpy as np
import pytest
from rendered_spheres import render, ring

BALL = (7.3, -4.6, 100.0)


@pytest.mark.parametrize(
    ("lamp_deg", "level", "blur_px"),
    [(0.5, 3.0, 0.5), (1.0, 30.0, 0.0)],
    ids=["a point, filtered after the pixels", "a point in clipped pixels"],
)
def test_the_uncertainty_of_points_of_light_is_of_the_size_of_their_errors(
    lamp_deg: float, level: float, blur_px: float
) -> None:
    lights = ring(8, 52.0, 17.0)
    images = render(
        lights, ball=BALL, size=(260, 260), samples=3, lamp_deg=lamp_deg, lamp_level=level, blur_px=blur_px, seed=11
    )
    capture = bgars.Capture(
        images=images, rig=bgars.LightRig.ring(8), mask=np.ones((260, 260), np.bool_), saturation=255.0,
        camera_distance_mm=np.inf,
    )  # fmt: skip
    found = bgars.calibrate_lights(capture, near=False)
    off = np.degrees(2 * np.arcsin(np.linalg.norm(found.rig.directions - lights, axis=1) / 2))
    # Two axes: the direction is off by sqrt(2) u, root mean square; half and twice that leave room for eight lights.
    expected = np.sqrt(2.0 * np.mean(found.u_deg**2))
    assert 0.4 < np.sqrt(np.mean(off**2)) / expected < 2.0
    # A place within a pixel is a place within 0.3 pixels: 0.6 / 100 of a radian.
    assert found.u_deg.max() < 1.0
    assert (off < 3.0 * np.sqrt(2) * found.u_deg).all()
