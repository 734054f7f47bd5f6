"""A material as the estimator might have fitted it."""

from __future__ import annotations

import bgars

SOLDER_FIT = bgars.ReflectanceFit(
    bgars.SurfaceMaterial(
        diffuse_level=31.5,
        grazing=0.0,
        ambient_level=0.7,
        lobes=(bgars.SurfaceLobe(strength_level=255.0, roughness=0.2, tail=0.98),),
        masking="smith",
        gains=(1.0, 0.98, 1.02, 1.0),
        standard_errors={
            "diffuse": 0.21,
            "ambient": 0.05,
            "strength_1": 1.9,
            "roughness_1": 0.0012,
            "tail_1": 0.02,
            "gain_1": 0.004,
        },
    ),
    0.043,
    True,
    (),
    (False, True),
    True,
    (0.4, 0.5),
    (None, None),
)
"""One lobe; the errors of grazing and of three of the four gains are not known."""
