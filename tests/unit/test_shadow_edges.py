"""Where edges of shadows are measured: against shadows that are drawn, finely sampled, and seen through a lens."""

from __future__ import annotations

import bgars
import numpy as np
import pytest
from bgars.inspection.board import Board
from bgars.inspection.radiance import Radiance
from bgars.inspection.shadow_edges import EdgeSettings, measure_edges
from bgars.inspection.shadow_map import Casters, ShadowMap
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

Array = NDArray[np.float64]
HEIGHT, WIDTH, FINE = 150, 230, 8
BALLS = np.array([[-52.3, 4.1, 17.0, 23.7, 1.0], [49.6, -3.2, 18.0, 23.7, 1.0]])
RIG = bgars.LightRig.ring(8, elevation_deg=48.0, azimuth0_deg=11.0)
REACH_PX = 3.0
PIXEL_VARIANCE = 1.0 / 12.0


def photographs(lens_px: float) -> NDArray[np.float32]:
    """(L, H, W) images of two matt balls on a grey board: the mean over FINE x FINE rays of each pixel, blurred."""
    y = HEIGHT / 2.0 - (np.arange(HEIGHT * FINE)[:, None] + 0.5) / FINE
    x = (np.arange(WIDTH * FINE)[None, :] + 0.5) / FINE - WIDTH / 2.0
    images = []
    for light in RIG.directions:
        lit = np.ones((HEIGHT * FINE, WIDTH * FINE))
        for cx, cy, cz, radius, _ in BALLS:
            along = (x - cx) * light[0] + (y - cy) * light[1] - cz * light[2]
            away = (x - cx) ** 2 + (y - cy) ** 2 + cz**2 - along**2
            lit[(along < 0.0) & (away < radius**2)] = 0.0
            lit[(x - cx) ** 2 + (y - cy) ** 2 < radius**2] = 0.4
        seen = lit.reshape(HEIGHT, FINE, WIDTH, FINE).mean(axis=(1, 3))
        images.append(100.0 * gaussian_filter(seen, lens_px))
    return np.array(images, dtype=np.float32)


@pytest.mark.parametrize("lens_px", [0.35, 0.5, 0.8])
def test_blur_moves_no_edge(lens_px: float) -> None:
    """The profile of pixels and lens is blunter in its tails than the model's, on both sides alike."""
    capture = bgars.Capture(photographs(lens_px), RIG, np.ones((HEIGHT, WIDTH), dtype=np.bool_))
    radiance, board = Radiance(capture), Board()
    shadows = ShadowMap(
        radiance,
        Casters.of(BALLS, RIG.directions, False, board),
        silhouette_margin_px=REACH_PX,
        shadow_margin_px=REACH_PX + 1.0,
        threads=1,
    )
    spread_px = float(np.hypot(lens_px, np.sqrt(PIXEL_VARIANCE)))
    edges = measure_edges(
        radiance,
        shadows,
        BALLS,
        RIG.directions,
        False,
        board,
        np.ones((len(BALLS), len(RIG.directions))),
        EdgeSettings(spread_px, 0.0, 0.0, REACH_PX),
        threads=1,
    )
    known = np.isfinite(edges.u_px)
    assert known.sum() > 150
    # Every stretch to the pixel grid's own scatter, all together to a few thousandths of a pixel.
    assert np.abs(np.median(edges.shift_px[known])) < 0.004
    assert np.percentile(np.abs(edges.shift_px[known]), 95) < 0.06
