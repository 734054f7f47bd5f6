"""The machine the numbers belong to."""

from __future__ import annotations

import os
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

PACKAGES = ("bgars", "numpy", "numba", "scipy", "pyamg", "opencv-python-headless", "tifffile", "trimesh")
VECTORS = {"avx512f": "AVX-512", "avx2": "AVX2"}


def describe() -> dict[str, object]:
    """Processor, its vectors, cores, system and the versions of everything that is compared."""
    return {
        "processor": _processor(),
        "vectors": _vectors(),
        "cores": os.cpu_count(),
        "system": platform.system(),
        "versions": _versions(),
    }


def _processor() -> str:
    """Its name, and what tells generations of the same name apart."""
    name = _cpuinfo("model name") or platform.processor() or platform.machine()
    family, model = _cpuinfo("cpu family"), _cpuinfo("model")
    return f"{name} (family {family}, model {model})" if family and model else name


def _vectors() -> str:
    """The widest vectors that the kernels know and the processor has."""
    flags = _cpuinfo("flags").split()
    return next((name for flag, name in VECTORS.items() if flag in flags), "no AVX2")


def _cpuinfo(key: str) -> str:
    """What Linux says of the first processor; empty where nobody says."""
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.is_file():
        for line in cpuinfo.read_text(encoding="utf-8").splitlines():
            name, _, value = line.partition(":")
            if name.strip() == key:
                return value.strip()
    return ""


def _versions() -> dict[str, str]:
    found = {"python": platform.python_version()}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found
