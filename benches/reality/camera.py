"""A camera: radiance in, 8-bit images out, with the faults of lens, sensor and file."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np
from scipy.ndimage import gaussian_filter

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from rendered import Rendered
    from setup_records import Setup

    Image = NDArray[np.float64]

FULL_WELL_E, READ_NOISE_E, PEDESTAL = 10000, 8, 0.006
"""Electrons at full scale, their noise without light, and the black level as a share of full scale."""
LENS_BLUR_PX = 0.5
DEFOCUS_HEIGHT_MM, DEFOCUS_LAYERS = 0.42, 5
GLARE_BLUR_PX, GLARE_LIMIT = 40, 12.0
"""Glare spreads so far; highlights beyond so many times full scale add no more to it."""
BOARD_LEVEL, SOLDER_LEVEL, HIGHLIGHT_PERCENTILE = 110, 150, 99.7
"""What exposure is set for: grey level of a lit board, of diffuse solder square to a lamp, or a share of all pixels."""


class Camera:
    """The camera of one part; `random` is asked image by image."""

    def __init__(self, setup: Setup, rendered: Rendered, random: np.random.Generator) -> None:
        self.faults, self.random = setup.camera, random
        self.radiance = rendered.radiance.astype(np.float64)
        self.z_mm = rendered.z_mm.astype(np.float64)
        self.lit_board = float(np.median([np.median(image[rendered.ball == 0]) for image in self.radiance]))
        self.gain = self._gain(setup)
        self.intensities = self._intensities(len(self.radiance))
        high, wide = self.z_mm.shape
        self.rows, self.cols = np.indices((high, wide))
        off = np.hypot(self.rows - high / 2, self.cols - wide / 2)
        self.field = off / np.hypot(high / 2, wide / 2)
        """Distance from the middle of the image, 1 in its corners."""

    def _gain(self, setup: Setup) -> float:
        """Grey values (full scale 1) a unit of radiance."""
        solder, faults = setup.solder, setup.camera
        if faults.exposed_for == "board":
            return float(BOARD_LEVEL / 255 / self.lit_board * faults.gain)
        if faults.exposed_for == "highlights":
            return float(1 / np.percentile(self.radiance, HIGHLIGHT_PERCENTILE) * faults.gain)
        return SOLDER_LEVEL / 255 / ((1 - solder.metallic_weight) * solder.diffuse / np.pi) * faults.gain

    def _intensities(self, lamps: int) -> Image:
        """True / declared intensities; the worst lamp is off by the whole spread."""
        spread = self.faults.intensity_spread
        if not spread:
            return np.ones(lamps)
        drawn = 1 + spread * self.random.uniform(-1, 1, lamps)
        return np.asarray(1 + spread * (drawn - 1) / np.abs(drawn - 1).max())

    def photograph(self, lamp: int) -> NDArray[np.uint8]:
        """The image (rows, columns) under a lamp."""
        faults = self.faults
        flicker = faults.flicker_levels * (0.5 + 0.5 * np.sin(1.7 * lamp))
        radiance = self.radiance[lamp] * self.intensities[lamp]
        return self._expose(radiance, faults.shifts_px.get(lamp, (0.0, 0.0)), faults.ambient_levels + flicker)

    def dark_frame(self) -> NDArray[np.uint8]:
        """The image with all lamps off, and without the ambient light of the others."""
        return self._expose(0 * self.radiance[0], (0.0, 0.0), 0.0)

    def _expose(self, radiance: Image, shift_px: tuple[float, float], ambient_levels: float) -> NDArray[np.uint8]:
        faults, random = self.faults, self.random
        seen = self._through_lens(radiance, shift_px)
        vignette = 1 - faults.vignetting * self.field**2
        light = np.maximum(self.gain * seen * vignette, 0) + ambient_levels / 255
        electrons = random.poisson(light * FULL_WELL_E) + random.normal(0, READ_NOISE_E, light.shape)
        signal = np.clip(electrons / FULL_WELL_E + PEDESTAL, 0, 1)
        signal = srgb(signal) if faults.gamma else signal
        signal = np.clip(signal + random.normal(0, faults.noise_levels / 255, signal.shape), 0, 1)
        return np.asarray(np.round(255 * signal).astype(np.uint8))

    def _through_lens(self, radiance: Image, shift_px: tuple[float, float]) -> Image:
        faults = self.faults
        seen = self._defocused(radiance, faults.defocus_px) if faults.defocus_px else blur(radiance, LENS_BLUR_PX)
        if faults.glare:
            veil = blur(np.minimum(seen, GLARE_LIMIT / self.gain), GLARE_BLUR_PX, "reflect")
            seen = (1 - faults.glare) * seen + faults.glare * veil
        if faults.distortion:
            seen = self._distorted(seen, faults.distortion)
        return shifted(seen, shift_px) if any(shift_px) else seen

    def _defocused(self, radiance: Image, sigmas_px: tuple[float, float]) -> Image:
        """Blur that grows with height, between layers of equal blur."""
        low, high = sigmas_px
        place = np.clip(self.z_mm / DEFOCUS_HEIGHT_MM, 0, 1) * (DEFOCUS_LAYERS - 1)
        layer = np.minimum(place.astype(int), DEFOCUS_LAYERS - 2)
        share = place - layer
        steps = [low + (high - low) * index / (DEFOCUS_LAYERS - 1) for index in range(DEFOCUS_LAYERS)]
        layers = np.stack([blur(radiance, sigma) for sigma in steps])
        lower, upper = layers[layer, self.rows, self.cols], layers[layer + 1, self.rows, self.cols]
        return np.asarray(lower * (1 - share) + upper * share)

    def _distorted(self, image: Image, distortion: float) -> Image:
        import cv2  # noqa: PLC0415 - an optional install

        high, wide = image.shape
        factor = 1 + distortion * self.field**2
        x = ((self.cols - wide / 2 + 0.5) * factor + wide / 2 - 0.5).astype(np.float32)
        y = ((self.rows - high / 2 + 0.5) * factor + high / 2 - 0.5).astype(np.float32)
        return np.asarray(cv2.remap(image, x, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE))


def blur(image: Image, sigma_px: float, border: Literal["mirror", "reflect"] = "mirror") -> Image:
    """Blur by a Gaussian, cut off at 4 sigma or the next odd size, as OpenCV does."""
    radius = (round(8 * sigma_px + 1) | 1) // 2
    return np.asarray(gaussian_filter(image, sigma_px, mode=border, radius=radius))


def shifted(image: Image, shift_px: tuple[float, float]) -> Image:
    """Move an image to the right and up."""
    import cv2  # noqa: PLC0415 - an optional install

    move = np.array([[1, 0, shift_px[0]], [0, 1, -shift_px[1]]])
    size = image.shape[1], image.shape[0]
    return np.asarray(cv2.warpAffine(image, move, size, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE))


def srgb(linear: Image) -> Image:
    """The transfer function of IEC 61966-2-1."""
    curved = 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055
    return np.where(linear <= 0.0031308, 12.92 * linear, curved)


def through_jpeg(image: NDArray[np.uint8], quality: int) -> NDArray[np.uint8]:
    """Compress and read back."""
    import cv2  # noqa: PLC0415 - an optional install

    _, coded = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return np.asarray(cv2.imdecode(coded, cv2.IMREAD_GRAYSCALE), np.uint8)
