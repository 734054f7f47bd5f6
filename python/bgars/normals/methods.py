"""The names of the methods of ``estimate_normals``; the command line reads them without loading the estimators."""

from __future__ import annotations

from typing import Literal, get_args

__all__ = ["ALL_METHODS", "DEFAULT_METHOD", "METHODS", "Method"]

Method = Literal["lambertian", "specular-filter", "robust-filter", "reflectance", "blind"]
METHODS: tuple[Method, ...] = ("lambertian", "specular-filter", "robust-filter", "reflectance")
"""The methods that are compared; ``blind`` is what ``reflectance`` does without balls."""
DEFAULT_METHOD: Method = "reflectance"
ALL_METHODS: tuple[Method, ...] = get_args(Method)
