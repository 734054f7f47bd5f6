"""Memory of an integration: at most 100 bytes a pixel beyond its input and output."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

LIMIT_BYTES = 100.0
SIDE_PX = 2048
SMALL_SIDE_PX = 512
"""What is there once, or with every thread, counts most."""
LARGE_PAGES = Path("/sys/kernel/mm/transparent_hugepage/enabled")

PROGRAM = """
import sys
from pathlib import Path

import numpy as np

import bgars


def status_bytes(field):
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return 1024 * int(next(line for line in lines if line.startswith(field)).split()[1])


def integrate(mask):
    normals = np.zeros((*mask.shape, 3), dtype=np.float32)
    y, x = np.indices(mask.shape, dtype=np.float32) * (20 / mask.shape[0])
    normals[..., 0], normals[..., 1] = 0.3 * np.sin(x) * np.cos(y), 0.3 * np.cos(x + y)
    normals[..., 2] = np.sqrt(1 - normals[..., 0] ** 2 - normals[..., 1] ** 2)
    Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
    before = status_bytes("VmRSS")
    # The set-up of a large graph needs more with every thread.
    threads = 2 if shape == "many holes" else None
    height = bgars.integrate_normals(normals, mask=mask, relative_tolerance=1e-6, threads=threads)
    output = height.height_px.nbytes + height.labels.nbytes + height.mask.nbytes
    return (status_bytes("VmHWM") - before - output) / mask.size


shape, side = sys.argv[1], int(sys.argv[2])
random = np.random.default_rng(0)
mask = np.ones((side, side), dtype=np.bool_)
integrate(mask[:64, :64])
if shape == "dense slits":
    for cut in range((side // 128) ** 2):
        row, col = (random.random(2) * side).astype(int)
        mask[(slice(row, row + 256), col) if cut % 2 else (row, slice(col, col + 256))] = False
elif shape == "many holes":
    mask = random.random(mask.shape) > 0.3
elif shape == "serpentine":
    mask[:, 1::2] = False
    mask[0, 1::4] = mask[-1, 3::4] = True
print(integrate(mask))
"""


def _can_measure() -> bool:
    try:
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
    except OSError:
        return False
    return True


@pytest.mark.skipif(not _can_measure(), reason="the most that was resident is known on Linux alone")
@pytest.mark.parametrize(
    ("shape", "side_px"),
    [(shape, SIDE_PX) for shape in ("rectangle", "dense slits", "many holes", "serpentine")]
    + [(shape, SMALL_SIDE_PX) for shape in ("rectangle", "dense slits", "serpentine")],
)
def test_an_integration_needs_at_most_a_hundred_bytes_a_pixel(shape: str, side_px: int) -> None:
    if side_px == SMALL_SIDE_PX and "[always]" in (LARGE_PAGES.read_text() if LARGE_PAGES.exists() else ""):
        pytest.skip("the system puts large pages under small arrays, asked or not")
    command = [sys.executable, "-c", PROGRAM, shape, str(side_px)]
    done = subprocess.run(command, check=True, capture_output=True, text=True, timeout=120)
    # The solution alone takes eight: less would mean that nothing was measured.
    assert 8.0 < float(done.stdout) <= LIMIT_BYTES
