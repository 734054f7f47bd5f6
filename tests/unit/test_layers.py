"""The data flows one way: no module imports one of its own or a later stage."""

from __future__ import annotations

import ast
from pathlib import Path

import bgars
import pytest

PACKAGE = Path(bgars.__file__).parent
RECORDS = {
    "ball_names": 0.5,
    "circle_pixels": 0,
    "plain_arrays": 0.5,
    "truth_record": 1,
    "ball_records": 1,
    "material_records": 1,
    "part_identity": 2,
    "part_material": 2,
    "part_recipe": 2,
    "surface_records": 2,
    "surface_map": 0,
    "records": 3,
    "part_result": 3,
    "station_record": 3,
    "station_apply": 3.5,
    "kernel_capture": 3.5,
    "kernel_outputs": 3.5,
    "anchoring": 3.5,
    "integration_inputs": 3.5,
    "whole_capture": 3.5,
    "normals_choice": 3.6,
}
BASE = {
    **{"errors": 0, "version": 0, "extras": 0, "csv_cells": 0, "normal_methods": 0, "shown": 0.5},
    **{"bit_depth": 0, "safe_files": 0.5, "mat_files": 0, "same_images": 3.2, "noise_floor": 3.5, "flatten": 3.5},
    **{"light_names": 1, "light_formats": 1.2, "light_files": 1.5, "rig": 2, "scalar_checks": 1},
    **RECORDS,
}
STAGES = dict.fromkeys(
    ("io", "pixelwise", "shape_images", "reflectance", "integrate", "mesh", "balls", "inspection", "checks"), 4
)
PIPELINES = ("calibrate", "pipeline", "evaluate", "part_anchors", "recipes", "cfx")
JOINED = {
    **{"normals": 4.5, "check_pipeline": 4.6, "station": 5, "part_surface": 5.2, "inspection_pipeline": 5.4},
    **dict.fromkeys(PIPELINES, 5),
}
LATER = {
    **JOINED,
    "batch": 6,
    "report": 6,
    "store": 6.2,
    "line": 6.7,
    "studies": 6.5,
    "experiments": 6,
    "samples": 0,
    "cli": 7,
}
LEVEL = {**BASE, **STAGES, **LATER, "simulate": 4}


def stage(module: str) -> str:
    return module.split(".")[1] if "." in module else ""


def imports(path: Path) -> set[str]:
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("bgars."):
            found.add(stage(str(node.module)))
    return found


@pytest.mark.parametrize("path", sorted(PACKAGE.rglob("*.py")), ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_point_backward(path: Path) -> None:
    own = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
    if own in {"__init__", "__main__"}:
        return
    for other in imports(path) - {own}:
        assert LEVEL[other] < LEVEL[own], f"{own} must not import {other}"
        if own == "simulate":
            assert other in {"errors", "records", "rig"}, "the truth stays independent of the estimators"
