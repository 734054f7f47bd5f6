"""Packages that a plain installation leaves out, and what to type for them."""

from __future__ import annotations

from importlib.util import find_spec

__all__ = ["EXTRA_OF", "how_to_install", "missing"]

EXTRA_OF = {
    "matplotlib": "report",
    "plotly": "report",
    "pyarrow": "parquet",
    "OpenEXR": "exr",
    "gsffile": "areal",
    "sdfio": "areal",
    "x3pio": "areal",
    "fast_simplification": "simplify",
}


def missing(*packages: str) -> tuple[str, ...]:
    """Which of some packages are not installed; none is imported."""
    return tuple(name for name in packages if find_spec(name) is None)


def how_to_install(package: str) -> str:
    """One line that names the package and the extra that brings it.

    Examples
    --------
    >>> how_to_install("matplotlib")
    "needs matplotlib: pip install 'bgars[report]'"
    """
    return f"needs {package}: pip install 'bgars[{EXTRA_OF[package]}]'"
