"""Mitsuba on the processor: which LLVM it compiles with."""

from __future__ import annotations

import importlib
import os
import re
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable
    from types import ModuleType

OLDEST = 16
"""Dr.Jit's kernels crash in LLVM 15 on processors with AVX-512."""
PLACES = ("/usr/lib/*-linux-gnu", "/usr/lib64", "/usr/lib/llvm*/lib*", "/usr/local/lib")
VARIABLE = "DRJIT_LIBLLVM_PATH"


def newest_llvm(paths: Iterable[Path]) -> Path | None:
    """The LLVM library of the highest version among files; None where all are older than `OLDEST`."""
    versions: dict[Path, int] = {}
    for path in paths:
        found = re.fullmatch(r"libLLVM(?:-(\d+)\.so[.\d]*|\.so\.(\d+)[.\d]*)", path.name)
        if found and int(found[1] or found[2]) >= OLDEST:
            versions[path] = int(found[1] or found[2])
    return max(sorted(versions), key=lambda path: versions[path]) if versions else None


def start_mitsuba() -> ModuleType:
    """Load Mitsuba with its LLVM variant.

    Raises
    ------
    RuntimeError
        Where no LLVM is found: without one Mitsuba would take hours, or crash.
    """
    if VARIABLE not in os.environ:
        found = newest_llvm(path for place in PLACES for path in Path("/").glob(f"{place[1:]}/libLLVM*"))
        if found is None:
            msg = (
                f"no LLVM of version {OLDEST} or later found in {', '.join(PLACES)}: apt-get install libllvm{OLDEST} "
                f"(or later), or let {VARIABLE} name the library"
            )
            raise RuntimeError(msg)
        os.environ[VARIABLE] = str(found)
    mitsuba = importlib.import_module("mitsuba")  # An optional install, which looks at the variable when loaded.
    mitsuba.set_variant("llvm_ad_mono")
    return mitsuba
