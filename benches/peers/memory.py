"""Peak memory of an integration beyond its input and output, in a fresh process (Linux: /proc).

python benches/peers/memory.py rectangle 2048
"""

from __future__ import annotations

import sys
from pathlib import Path

from integrate import GROUP, bgars_call
from normal_fields import make_field
from process import own_threads
from rows import Skipped, emit, emit_check

LIMIT_BYTES = 100.0
STATUS, RESET = Path("/proc/self/status"), Path("/proc/self/clear_refs")
KIBIBYTE = 1024


def status_bytes(field: str) -> int:
    """A line of the process's status: VmRSS (now) or VmHWM (the most since the last reset)."""
    line = next(line for line in STATUS.read_text(encoding="ascii").splitlines() if line.startswith(field))
    return int(line.split()[1]) * KIBIBYTE


def main(shape: str, side: int) -> None:
    """Measure one integration, after a small one that starts the threads."""
    what, size = f"peak memory beyond input and output, {shape}", f"{side} x {side}"
    bgars_call(make_field(shape, 64))()
    call = bgars_call(make_field(shape, side))
    try:
        RESET.write_text("5", encoding="ascii")  # the peak becomes what is resident now: the input and the libraries
        before = status_bytes("VmRSS")
    except OSError as error:
        emit(Skipped(GROUP, f"{what}, {size}", f"no {error.filename}: {error.strerror}"))
        return
    height = call()
    output = height.height_px.nbytes + height.labels.nbytes + height.mask.nbytes
    beyond = (status_bytes("VmHWM") - before - output) / (side * side)
    emit_check(GROUP, what, size, own_threads(), beyond, "bytes a pixel", limit=LIMIT_BYTES)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
