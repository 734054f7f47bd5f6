"""Arguments and materials that cannot be right are refused in one line."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import bgars
import numpy as np
import pytest
from hemispheres import hemisphere


def solder_for(lights: int) -> bgars.SurfaceMaterial:
    return bgars.SurfaceMaterial(100.0, 0.0, 0.0, (bgars.SurfaceLobe(255.0, 0.2, 0.0),), "smith", (1.0,) * lights)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"anchors": [[0.0, 0.0, 2.0]]}, "radius at least 3 pixels.*2"),
        ({"anchors": [[0.0, 0.0, -1.0]]}, "radii above 0 px"),
        ({"anchors": [[0.0, np.nan, 9.0]]}, "must be finite"),
        ({"anchors": [[0.0, 0.0]]}, r"circles of shape \(N, 3\).*\(1, 2\)"),
        ({"anchors": np.zeros((4, 4), np.bool_)}, r"anchors: a mask of one ball.*\(4, 4\)"),
        ({"anchors": [[0.0, 0.0, 30.0]], "material": solder_for(5)}, "material.gains.*8.*5"),
        ({"anchors": [[0.0, 0.0, 30.0]], "method": "lambertian"}, "anchors: only the method reflectance"),
        ({"material": solder_for(8), "method": "robust-filter"}, "material: only the method reflectance"),
        ({"threshold": 40.0}, "threshold: only the method specular-filter uses it, got method 'reflectance'"),
        ({"threshold": 40.0, "method": "robust-filter"}, "threshold: only the method specular-filter"),
    ],
)
def test_bad_input_is_one_clear_line(options: dict[str, Any], words: str) -> None:
    capture, _ = hemisphere()
    with pytest.raises(bgars.InputError, match=words):
        bgars.estimate_normals(capture, **options)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: bgars.SurfaceLobe(-1.0, 0.2, 0.0), r"lobe\.strength_level.*got -1"),
        (lambda: bgars.SurfaceLobe(1.0, 0.0, 0.0), r"lobe\.roughness.*got 0"),
        (lambda: bgars.SurfaceLobe(1.0, 0.2, 1.5), r"lobe\.tail.*got 1\.5"),
        (lambda: replace(solder_for(8), diffuse_level=-1.0), "diffuse_level.*got -1"),
        (lambda: replace(solder_for(8), grazing=np.inf), "grazing.*got inf"),
        (lambda: replace(solder_for(8), lobes=()), "lobes: must be one or two, got 0"),
        (lambda: replace(solder_for(8), masking="none"), "masking: must be smith or cook-torrance, got 'none'"),
        (lambda: replace(solder_for(8), gains=(1.0, 0.0)), r"gains\[1\]: must be finite and above 0, got 0"),
    ],
)
def test_impossible_materials_are_refused(make: Callable[[], object], words: str) -> None:
    with pytest.raises(bgars.InputError, match=words):
        make()
