"""What intensities of lights, as a station states them, do to an inspection: next to nothing."""

from __future__ import annotations

from dataclasses import replace

import bgars
import numpy as np


def test_wrong_intensities_move_readings_by_less_than_a_quarter_of_their_uncertainty() -> None:
    """The brightness under each light is fitted anew, so `u_intensities` is in no error budget (docs/station.md)."""
    scene = bgars.Scene.ball_array(3, 3, jitter=bgars.Jitter(4.0, 2.0, 6.0), defects={"B2": bgars.Defect.clipped(25.0)})
    rig, material = bgars.LightRig.ring(8), bgars.Material(i_d=0.3, i_s=1.0, hardness=40)
    capture, _ = bgars.simulate(scene, rig, material, bgars.Camera())
    wrong = np.where(np.arange(8) % 2, 1.05, 0.95)
    usual = bgars.inspect(capture)
    moved = bgars.inspect(replace(capture, rig=capture.rig.with_intensities(wrong)))
    for key in ("x_um", "y_um", "diameter_um", "top_um", "flat_top_depth_um"):
        for one, two in zip(usual.balls, moved.balls, strict=True):
            assert abs(getattr(one, key) - getattr(two, key)) <= 0.25 * getattr(one, f"u_{key}"), (key, one.name)
