"""The material of the board: matte solder mask; dark and glossy with pads, copper and silk screen; or bare copper."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

if TYPE_CHECKING:
    from types import ModuleType

    from balls import Ball
    from numpy.typing import NDArray
    from setup_records import Setup

TEXELS = 1536
LABELS = (("BGA A1 U7", (-1.5, -0.35)), ("R12", (0.7, 0.45)), ("2619-B", (-1.7, 1.25)))
"""What the silk screen says, and where (mm)."""
SILK_ALBEDO = 0.65
COPPER = {"type": "roughconductor", "distribution": "ggx", "alpha": 0.3, "eta": 0.5, "k": 3.0}


def board_side_mm(setup: Setup) -> float:
    """Half the side of the square that is rendered: twice the image, so that shadows come from beyond it, too."""
    half_mm = np.array((setup.view.width, setup.view.height)) * setup.view.pixel_mm / 2
    return 2.0 * float(max(half_mm))


def board_material(mitsuba: ModuleType, setup: Setup, balls: list[Ball]) -> dict[str, Any]:
    """A material (bsdf) in Mitsuba's words."""
    board = setup.board
    if board.kind == "copper":
        rest = {"type": "diffuse", "reflectance": bitmap(mitsuba, _albedo(setup, 0.35))}
        return {"type": "blendbsdf", "weight": 0.9, "a": rest, "b": COPPER}
    albedo = _albedo(setup, board.albedo)
    if board.kind == "matte":
        return {"type": "diffuse", "reflectance": bitmap(mitsuba, albedo)}
    pads, silk = _pads_and_silk(setup, balls)
    mask = {
        "type": "roughplastic",
        "distribution": "ggx",
        "alpha": board.gloss,
        "int_ior": 1.5,
        "diffuse_reflectance": bitmap(mitsuba, albedo * (1 - silk) + SILK_ALBEDO * silk),
    }
    pad = {"type": "blendbsdf", "weight": 0.6, "a": {"type": "diffuse", "reflectance": 0.35}, "b": COPPER}
    return {"type": "blendbsdf", "weight": bitmap(mitsuba, pads), "a": mask, "b": pad}


def bitmap(mitsuba: ModuleType, values: NDArray[np.float32], **options: str) -> dict[str, Any]:
    """A texture of raw values (rows, columns)."""
    image = mitsuba.Bitmap(np.ascontiguousarray(values[..., None]).astype(np.float32))
    return {"type": "bitmap", "bitmap": image, "raw": True, "filter_type": "bilinear", **options}


def _albedo(setup: Setup, albedo: float) -> NDArray[np.float32]:
    """Blotches of three sizes, and strips of copper under the mask."""
    random = np.random.default_rng([setup.seed, 7])
    pattern = np.zeros((TEXELS, TEXELS), np.float32)
    for size, share in ((3, 0.35), (12, 0.5), (60, 0.6)):
        blotches = cv2.GaussianBlur(random.standard_normal((TEXELS, TEXELS)).astype(np.float32), (0, 0), size)
        pattern += share * blotches / blotches.std()
    for _ in range(60):
        start, angle = random.uniform(0, TEXELS, 2), random.integers(0, 4) * np.pi / 4
        end = start + random.uniform(60, 500) * np.array([np.cos(angle), np.sin(angle)])
        strip = np.zeros((TEXELS, TEXELS), np.float32)
        corners = [(int(x), int(y)) for x, y in (start, end)]
        cv2.line(strip, *corners, 1.0, int(random.integers(4, 12)), cv2.LINE_AA)
        pattern += 0.9 * strip
    return np.asarray(np.clip(albedo * (1 + setup.board.texture * pattern), 0.3 * albedo, 2.5 * albedo))


def _pads_and_silk(setup: Setup, balls: list[Ball]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Bare metal (pads, and vias beside every fourth ball), and silk screen, as shares of 1."""
    side_mm, part = board_side_mm(setup), setup.part
    random = np.random.default_rng([setup.seed, 7])

    def place(x_mm: float, y_mm: float) -> tuple[int, int]:
        return int((x_mm + side_mm) / (2 * side_mm) * TEXELS), int((y_mm + side_mm) / (2 * side_mm) * TEXELS)

    def length(value_mm: float) -> int:
        return max(1, int(value_mm / (2 * side_mm) * TEXELS))

    pads, silk = np.zeros((TEXELS, TEXELS), np.float32), np.zeros((TEXELS, TEXELS), np.uint8)
    for ball in balls:
        radius = length(part.diameter_mm / 2 * 0.85)
        cv2.circle(pads, place(ball.x_nominal_mm, ball.y_nominal_mm), radius, 1.0, -1, cv2.LINE_AA)
    for ball in balls[::4]:
        off = random.choice([-1, 1], 2) * part.pitch_mm / 2
        middle = place(ball.x_nominal_mm + off[0], ball.y_nominal_mm + off[1])
        cv2.circle(pads, middle, length(0.07), 1.0, -1, cv2.LINE_AA)
    for text, corner in LABELS:
        size, width = 0.0075 * length(0.45) * 4, max(2, length(0.03))
        cv2.putText(silk, text, place(*corner), cv2.FONT_HERSHEY_SIMPLEX, size, 255, width, cv2.LINE_AA)
    frame = (part.cols / 2 + 0.1) * part.pitch_mm
    cv2.rectangle(silk, place(-frame, -frame), place(frame, frame), 255, length(0.06), cv2.LINE_AA)
    return pads, np.asarray(silk.astype(np.float32) / 255 * (1 - pads), np.float32)
