"""What is known of a simulated capture."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from bgars.records.pixels import BoolArray, FloatArray
from bgars.records.renamed import renamed
from bgars.records.short import Short
from bgars.records.truth import Truth
from bgars.simulate.coplanarity import PlaneTruth, regression_plane, seating_plane

if TYPE_CHECKING:
    from bgars.records.rig import LightRig
    from bgars.simulate.camera import Camera
    from bgars.simulate.material import Material
    from bgars.simulate.scene import Scene
    from bgars.simulate.shading import Finish
    from bgars.simulate.solids import Solid

__all__ = ["BallTruth", "SimulatedTruth", "SimulationSetup", "ball_table", "coplanarities"]


@dataclass(frozen=True, eq=False, repr=False)
class SimulationSetup(Short):
    """Everything that determines a simulated capture, to the bit.

    Attributes
    ----------
    scene, rig, material, camera : Scene, LightRig, Material, Camera
        What was photographed, and how; the camera has its shape.
    seed : int
        Of noise and ball-to-ball variation.
    """

    scene: Scene
    rig: LightRig
    material: Material
    camera: Camera
    seed: int = 0


@renamed(q="aspect_ratio", flat_um="flat_top_depth_um")
@dataclass(frozen=True)
class BallTruth:
    """One ball; heights are above the local board. Lengths of a missing ball are None.

    Attributes
    ----------
    name : str
        JEDEC name.
    row, col : int
        From 1, from the top left of the image; results of an inspection count from 0, so tables are joined on `name`.
    present : bool
        False for a missing ball.
    x_um, y_um : float or None
        Centre.
    diameter_um : float or None
        Horizontal diameter.
    centre_z_um, top_um : float or None
        Heights of centre and top above the board under the ball.
    aspect_ratio : float or None
        Vertical over horizontal semi-axis.
    flat_top_depth_um : float or None
        Height cut off the top.
    defect : str
        "none", or what is wrong.
    x_nominal_um, y_nominal_um : float
        Where it should be.
    board_z_um : float
        World height of the board under it (under its nominal place when missing).
    seating_deviation_um, regression_deviation_um : float or None
        Distance of the apex below each plane.
    i_d, i_s, roughness : float or None
        Material of this ball: albedo; strength and roughness of its first lobe (None without lobes).
    """

    name: str
    row: int
    col: int
    present: bool
    x_um: float | None
    y_um: float | None
    diameter_um: float | None
    centre_z_um: float | None
    top_um: float | None
    aspect_ratio: float | None
    flat_top_depth_um: float | None
    defect: str
    x_nominal_um: float
    y_nominal_um: float
    board_z_um: float
    seating_deviation_um: float | None = None
    regression_deviation_um: float | None = None
    i_d: float | None = None
    i_s: float | None = None
    roughness: float | None = None


@dataclass(frozen=True, eq=False, repr=False)
class SimulatedTruth(Truth):
    """Truth of a simulated capture, at pixel centres and without blur.

    ``ball_ids`` is the label image: 0 board, 1.. the balls in the order of `balls`, -1 bridge; ``mask`` the balls.

    Attributes
    ----------
    height_px : (H, W) float32
        World height in pixels; `height_um` in micrometres.
    lit : (L, H, W) bool
        True where the light reaches the pixel's centre: N.L > 0 and no cast shadow.
    balls : tuple of BallTruth
        One record per ball.
    seating, regression : PlaneTruth or None
        Reference planes over the world apexes of the present balls; None where they do not exist. The centre of
        gravity is the mean of the nominal places.
    setup : SimulationSetup
        What produced it.
    """

    height_px: FloatArray
    lit: BoolArray
    balls: tuple[BallTruth, ...]
    seating: PlaneTruth | None
    regression: PlaneTruth | None
    setup: SimulationSetup

    @property
    def seating_coplanarity_um(self) -> float | None:
        """Largest distance of an apex from the seating plane."""
        return None if self.seating is None else self.seating.coplanarity_um

    @property
    def regression_coplanarity_um(self) -> float | None:
        """Largest distance of an apex from the regression plane."""
        return None if self.regression is None else self.regression.coplanarity_um

    def summary(self) -> dict[str, Any]:
        """Return the record's scalars as plain Python values."""
        present = [ball for ball in self.balls if ball.present]
        return {
            "balls": len(self.balls),
            "present": len(present),
            "defects": {ball.name: ball.defect for ball in self.balls if ball.defect != "none"},
            "seating_coplanarity_um": self.seating_coplanarity_um,
            "seating_balls": [present[index].name for index in self.seating.balls] if self.seating else [],
            "regression_coplanarity_um": self.regression_coplanarity_um,
            "lit_fraction": [round(float(lit.mean()), 4) for lit in self.lit],
        }


def ball_table(scene: Scene, material: Material, solids: list[Solid], finishes: Finish) -> tuple[BallTruth, ...]:
    """One record a ball, without its deviations."""
    index_of = {solid.label: index for index, solid in enumerate(solids)}
    lobe = material.lobes[0] if material.lobes else None
    rows = []
    for label, ball in enumerate(scene.balls, start=1):
        x_nominal_um = ball.x_um if ball.x_nominal_um is None else ball.x_nominal_um
        y_nominal_um = ball.y_um if ball.y_nominal_um is None else ball.y_nominal_um
        place = (ball.x_um, ball.y_um) if ball.present else (x_nominal_um, y_nominal_um)
        row = BallTruth(
            name=ball.name,
            row=ball.row,
            col=ball.col,
            present=ball.present,
            x_um=None,
            y_um=None,
            diameter_um=None,
            centre_z_um=None,
            top_um=None,
            aspect_ratio=None,
            flat_top_depth_um=None,
            defect=ball.defect,
            x_nominal_um=x_nominal_um,
            y_nominal_um=y_nominal_um,
            board_z_um=float(scene.board.height_um(np.array(place[0]), np.array(place[1]))),
        )
        if ball.present:
            at = index_of[label]
            factors = [float(np.asarray(factor)[at]) for factor in (finishes.i_d, finishes.i_s, finishes.roughness)]
            row = replace(
                row,
                x_um=ball.x_um,
                y_um=ball.y_um,
                diameter_um=2.0 * ball.radius_um,
                centre_z_um=ball.centre_z_um,
                top_um=ball.top_um,
                aspect_ratio=ball.aspect_ratio,
                flat_top_depth_um=ball.flat_top_depth_um,
                i_d=material.i_d * factors[0],
                i_s=None if lobe is None else lobe.i_s * factors[1],
                roughness=None if lobe is None else lobe.roughness * factors[2],
            )
        rows.append(row)
    return tuple(rows)


def coplanarities(
    balls: tuple[BallTruth, ...],
) -> tuple[tuple[BallTruth, ...], PlaneTruth | None, PlaneTruth | None]:
    """Both planes over the apexes of the present balls, and the balls with their deviations."""
    apexes_um = np.array(
        [(ball.x_um, ball.y_um, ball.board_z_um + (ball.top_um or 0.0)) for ball in balls if ball.present]
    ).reshape(-1, 3)
    gravity_um = np.array([(ball.x_nominal_um, ball.y_nominal_um) for ball in balls]).reshape(-1, 2)
    seating = seating_plane(apexes_um, gravity_um.mean(axis=0)) if balls else None
    regression = regression_plane(apexes_um)
    place = iter(range(len(apexes_um)))
    rows = []
    for ball in balls:
        if not ball.present:
            rows.append(ball)
            continue
        index = next(place)
        rows.append(
            replace(
                ball,
                seating_deviation_um=None if seating is None else float(seating.deviations_um[index]),
                regression_deviation_um=None if regression is None else float(regression.deviations_um[index]),
            )
        )
    return tuple(rows), seating, regression
