"""The machine the numbers belong to."""

from __future__ import annotations

import os
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

PACKAGES = ("bgars", "numpy", "numba", "scipy", "pyamg", "opencv-python-headless", "tifffile", "trimesh")


def describe() -> dict[str, object]:
    """Processor, cores, system and the versions of everything that is compared."""
    return {"processor": _processor(), "cores": os.cpu_count(), "system": platform.system(), "versions": _versions()}


def _processor() -> str:
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.is_file():
        for line in cpuinfo.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()


def _versions() -> dict[str, str]:
    found = {"python": platform.python_version()}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found
