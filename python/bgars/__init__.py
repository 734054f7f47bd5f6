"""Photometric stereo for shiny parts: one camera, several lights, one image a light.

The data flows one way: a capture becomes normals, normals become a height map, a height map becomes a mesh.

>>> import bgars
>>> capture = bgars.read_capture(bgars.sample_capture())
>>> field = bgars.estimate_normals(capture)
>>> height = bgars.integrate_normals(field)
>>> mesh = bgars.mesh_from_height(height, field)
"""

from importlib.metadata import version

from bgars.ball_records import BallLayout, FoundBall, FoundBalls
from bgars.balls import find_balls
from bgars.calibrate import calibrate_material
from bgars.cfx import to_cfx
from bgars.errors import (
    BgarsError,
    CalibrationError,
    ConvergenceError,
    FileFormatError,
    InputError,
    UnsupportedImageError,
)
from bgars.evaluate import Evaluation, angular_error_deg, evaluate
from bgars.inspection_pipeline import inspect
from bgars.integrate import integrate_normals
from bgars.io.capture import read_capture
from bgars.io.height import read_height, write_height
from bgars.io.material_file import read_material, write_material
from bgars.io.mesh_files import write_mesh
from bgars.io.normal_map import read_normal_map, write_normal_map
from bgars.io.parquet import write_parquet
from bgars.io.part_recipe import read_part_recipe
from bgars.io.result_file import read_result
from bgars.io.station_file import read_station, write_station
from bgars.io.truth import read_truth
from bgars.material_records import ReflectanceFit, SurfaceLobe, SurfaceMaterial
from bgars.mesh import mesh_from_height
from bgars.normals import estimate_normals
from bgars.part_anchors import anchors_from_part
from bgars.part_recipe import Limits, PartRecipe
from bgars.part_result import BallResult, PartResult
from bgars.pipeline import Reconstruction, reconstruct
from bgars.recipes import named_recipes, read_scene, write_simulation
from bgars.records import Capture, Component, DepthMap, HeightMap, NormalField, Truth
from bgars.report.overview import write_overview
from bgars.report.page import write_report
from bgars.report.part import write_part_pictures
from bgars.rig import LightRig
from bgars.samples import sample_capture, sample_part_recipe
from bgars.simulate import (
    Ball,
    BallTruth,
    Board,
    Bridge,
    Camera,
    Defect,
    Jitter,
    Lobe,
    Material,
    Scene,
    SimulatedTruth,
    SimulationSetup,
    Texture,
    Variation,
    simulate,
)
from bgars.station import calibrate_flat, calibrate_lights, calibrate_scale
from bgars.station_apply import with_station
from bgars.station_record import Finding, FlatField, LightCalibration, ResponseCurve, Scale, Station
from bgars.studies import (
    GaugeStudy,
    ProcessTrend,
    Study,
    gauge_rr,
    process_trend,
    read_references,
    read_results,
    read_study,
)
from bgars.surface_map import PartSurface
from bgars.surface_records import Anchors, BilateralFit, Pinhole

__version__ = version("bgars")

__all__ = [
    "Anchors",
    "Ball",
    "BallLayout",
    "BallResult",
    "BallTruth",
    "BgarsError",
    "BilateralFit",
    "Board",
    "Bridge",
    "CalibrationError",
    "Camera",
    "Capture",
    "Component",
    "ConvergenceError",
    "Defect",
    "DepthMap",
    "Evaluation",
    "FileFormatError",
    "Finding",
    "FlatField",
    "FoundBall",
    "FoundBalls",
    "GaugeStudy",
    "HeightMap",
    "InputError",
    "Jitter",
    "LightCalibration",
    "LightRig",
    "Limits",
    "Lobe",
    "Material",
    "NormalField",
    "PartRecipe",
    "PartResult",
    "PartSurface",
    "Pinhole",
    "ProcessTrend",
    "Reconstruction",
    "ReflectanceFit",
    "ResponseCurve",
    "Scale",
    "Scene",
    "SimulatedTruth",
    "SimulationSetup",
    "Station",
    "Study",
    "SurfaceLobe",
    "SurfaceMaterial",
    "Texture",
    "Truth",
    "UnsupportedImageError",
    "Variation",
    "__version__",
    "anchors_from_part",
    "angular_error_deg",
    "calibrate_flat",
    "calibrate_lights",
    "calibrate_material",
    "calibrate_scale",
    "estimate_normals",
    "evaluate",
    "find_balls",
    "gauge_rr",
    "inspect",
    "integrate_normals",
    "mesh_from_height",
    "named_recipes",
    "process_trend",
    "read_capture",
    "read_height",
    "read_material",
    "read_normal_map",
    "read_part_recipe",
    "read_references",
    "read_result",
    "read_results",
    "read_scene",
    "read_station",
    "read_study",
    "read_truth",
    "reconstruct",
    "sample_capture",
    "sample_part_recipe",
    "simulate",
    "to_cfx",
    "with_station",
    "write_height",
    "write_material",
    "write_mesh",
    "write_normal_map",
    "write_overview",
    "write_parquet",
    "write_part_pictures",
    "write_report",
    "write_simulation",
    "write_station",
]
