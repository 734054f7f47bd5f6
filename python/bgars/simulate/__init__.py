"""Simulated captures with exact truth; shares no code with the estimators."""

from bgars.simulate.array import Jitter
from bgars.simulate.balls import Ball, Bridge, ball_name
from bgars.simulate.board import Board, Texture
from bgars.simulate.camera import Camera
from bgars.simulate.coplanarity import PlaneTruth
from bgars.simulate.defects import Defect
from bgars.simulate.material import Lobe, Material, Variation, roughness_from_hardness
from bgars.simulate.scene import Scene
from bgars.simulate.simulation import simulate
from bgars.simulate.truth import BallTruth, SimulatedTruth, SimulationSetup

__all__ = [
    "Ball",
    "BallTruth",
    "Board",
    "Bridge",
    "Camera",
    "Defect",
    "Jitter",
    "Lobe",
    "Material",
    "PlaneTruth",
    "Scene",
    "SimulatedTruth",
    "SimulationSetup",
    "Texture",
    "Variation",
    "ball_name",
    "roughness_from_hardness",
    "simulate",
]
