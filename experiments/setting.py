"""The scene that every experiment photographs, and the quantities they vary."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from bgars.records.rig import LightRig
from bgars.simulate import Camera, Material, Scene, simulate

if TYPE_CHECKING:
    from bgars.records.capture import Capture
    from bgars.simulate import SimulatedTruth

__all__ = ["DIFFUSE", "HARDNESS", "SPECULAR", "Setting"]

DIFFUSE = (0.01, 0.05, 0.1, 0.5, 1.0)
SPECULAR = (0.0, 0.25, 0.5, 0.75, 1.0)
HARDNESS = (10.0, 20.0, 40.0, 80.0, 160.0)
"""The paper's sweeps of I_d, I_s and h (its figs. 7-12)."""

PITCH_UM = 10.0
SEED = 0
"""Of the noise: every run gives the same numbers."""


@dataclass(frozen=True)
class Setting:
    """A hemisphere on a dark board under a ring of lights, 8-bit images.

    Attributes
    ----------
    i_d, i_s, hardness : float
        Material, see :class:`bgars.Material`.
    elevation_deg : float
        Of the ring.
    lights : int
        On the ring, the first at azimuth 0.
    noise_levels : float
        Standard deviation of the read noise, grey levels of 255.

    Examples
    --------
    >>> capture, truth = Setting(i_d=0.1).photograph(20)
    >>> capture.images.shape, int(truth.height_px.max())
    ((8, 60, 60), 19)
    """

    i_d: float = 0.5
    i_s: float = 1.0
    hardness: float = 40.0
    elevation_deg: float = 45.0
    lights: int = 8
    noise_levels: float = 0.0

    def with_value(self, name: str, value: float) -> Setting:
        """The same setting with another value of one of its attributes."""
        changed: dict[str, Any] = {name: int(value) if name == "lights" else value}
        return replace(self, **changed)

    def photograph(self, radius_px: int) -> tuple[Capture, SimulatedTruth]:
        """Simulate the capture of a hemisphere of `radius_px` pixels, and its truth."""
        return simulate(
            Scene.hemisphere(radius_px * PITCH_UM),
            LightRig.ring(self.lights, elevation_deg=self.elevation_deg),
            Material(i_d=self.i_d, i_s=self.i_s, hardness=self.hardness),
            Camera(pixel_pitch_um=PITCH_UM, read_noise_levels=self.noise_levels),
            seed=SEED,
            threads=1,  # so small that threads would only wait for each other
        )
