"""A store with results of simulated parts, made without images."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import bgars
from bgars.records.part_identity import PartIdentity
from judged_parts import judged

DEFECTS = {3: {"B2": bgars.Defect.missing()}, 5: {"A1": bgars.Defect.missing()}}


@cache
def part(number: int) -> bgars.PartResult:
    """A part of lot L0 or L1; the third and the fifth lack a ball."""
    options = {"defects": DEFECTS[number]} if number in DEFECTS else {}
    result = judged(part=number + 1, run=number, noise_um=0.3, **options)
    ball = replace(result.balls[0], budget={"top_um": {"lamps": 0.8, "noise": 0.2}})
    return replace(
        result,
        balls=(ball, *result.balls[1:]),
        serial=f"SN{number:04d}",
        inspected_utc=f"2026-01-{1 + number // 4:02d}T10:{number:02d}:00Z",
        identity=PartIdentity(lot=f"L{number % 2}", station="S1", operator="ada"),
    )


def filled_store(folder: Path, count: int = 8) -> bgars.Store:
    store = bgars.open_store(folder, create=True)
    for number in range(count):
        store.append(part(number), capture_folder=f"/captures/SN{number:04d}", seconds=1.5)
    return store
