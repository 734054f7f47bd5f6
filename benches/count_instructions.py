"""Count the instructions a pixel of each kernel under callgrind, and compare them with the last ones kept.

Instructions, unlike seconds, are the same on a busy machine. A count over the kept one by more than 10 % fails; after a
change that is worth it (or another compiler), ``--update`` keeps the new counts in ``benches/instructions.json``.
Valgrind knows AVX2 but not AVX-512: what is counted is the AVX2 version of each kernel, on one thread.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
KEPT = ROOT / "benches" / "instructions.json"
KERNELS = (
    "lambertian-u8",
    "normals-u8",
    "normals-u8-24-lights",
    "normals-u16",
    "normals-f32",
    "normals-robust-u8",
    "integrate-6-iterations",
)
PIXELS = 256 * 256
TOLERANCE = 1.10


def build() -> Path:
    """Compile the bench and return its path."""
    messages = subprocess.run(
        ["cargo", "bench", "--locked", "--bench", "instructions", "--no-run", "--message-format=json"],
        cwd=ROOT,
        check=True,
        stdout=subprocess.PIPE,
        text=True,
    ).stdout
    artifacts = (json.loads(line) for line in messages.splitlines())
    return next(
        Path(artifact["executable"])
        for artifact in artifacts
        if artifact.get("executable") and artifact["target"]["name"] == "instructions"
    )


def total(binary: Path, kernel: str, times: int) -> int:
    """Instructions of a whole process that runs `kernel` so many times."""
    with tempfile.TemporaryDirectory() as folder:
        outcome = subprocess.run(
            ["valgrind", "--tool=callgrind", f"--callgrind-out-file={folder}/out", str(binary), kernel, str(times)],
            env={**os.environ, "RAYON_NUM_THREADS": "1"},
            check=True,
            capture_output=True,
            text=True,
        )
    found = re.search(r"Collected : (\d+)", outcome.stderr)
    if found is None:
        sys.exit(f"callgrind did not report a count:\n{outcome.stderr}")
    return int(found.group(1))


def main() -> int:
    """Count, compare, and keep the counts if asked to."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--update", action="store_true", help="keep the counts of this run")
    update = parser.parse_args().update
    if shutil.which("valgrind") is None:
        print("SKIPPED: counting instructions needs valgrind on the PATH")
        return 0
    binary = build()
    kept = json.loads(KEPT.read_text()) if KEPT.exists() else {}
    counts = {}
    worse = []
    print(f"{'kernel':24} {'instructions/pixel':>18} {'kept':>10} {'ratio':>7}")
    for kernel in KERNELS:
        # The difference of two runs leaves the start of the process out.
        counts[kernel] = round((total(binary, kernel, 3) - total(binary, kernel, 1)) / 2 / PIXELS, 2)
        before = kept.get(kernel)
        ratio = counts[kernel] / before if before else float("nan")
        print(f"{kernel:24} {counts[kernel]:18.2f} {before or float('nan'):10.2f} {ratio:7.3f}")
        if before is None or ratio > TOLERANCE:
            worse.append(kernel)
    if update:
        KEPT.write_text(json.dumps(counts, indent=2) + "\n")
        print(f"kept in {KEPT.relative_to(ROOT)}")
        return 0
    if worse:
        print(f"FAILED: more than {TOLERANCE:.0%} of the kept count, or none kept: {', '.join(worse)}; see --update")
        return 1
    print(f"{len(KERNELS)} passed, 0 failed")
    return 0


if __name__ == "__main__":
    sys.exit(main())
