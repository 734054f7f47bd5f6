"""Known heights put the parts of a surface where they are."""

from __future__ import annotations

from typing import Any, Literal

import bgars
import numpy as np
import pytest

SHAPE = (40, 60)


def two_plates() -> tuple[np.ndarray, np.ndarray]:
    """Normals that are flat everywhere, and two regions."""
    normals = np.zeros((*SHAPE, 3), np.float32)
    normals[..., 2] = 1.0
    regions = np.zeros(SHAPE, np.int32)
    regions[10:30, 20:40] = 7
    return normals, regions


def known(**places: float) -> np.ndarray:
    height_um = np.full(SHAPE, np.nan)
    height_um[0, 0], height_um[20, 30] = places["board"], places["top"]
    return height_um


@pytest.mark.parametrize("method", ["least-squares", "bilateral"])
def test_regions_are_apart_and_each_goes_to_its_anchor(method: Literal["least-squares", "bilateral"]) -> None:
    normals, regions = two_plates()
    anchors = bgars.Anchors(known(board=-5.0, top=250.0), regions=regions)
    found = bgars.integrate_normals(normals, method=method, anchors=anchors, pixel_pitch_um=10.0)
    assert found.height_um is not None
    assert np.abs(found.height_um - np.where(regions == 7, 250.0, -5.0)).max() < 1e-3
    assert [part.anchor_pixels for part in found.components] == [1, 1]
    assert [part.pixels for part in found.components] == [2000, 400]


def test_a_region_without_an_anchor_keeps_its_mean() -> None:
    normals, regions = two_plates()
    height_um = known(board=100.0, top=np.nan)
    found = bgars.integrate_normals(normals, anchors=bgars.Anchors(height_um, regions=regions), pixel_pitch_um=10.0)
    assert found.height_um is not None
    assert np.abs(found.height_um[regions == 0] - 100.0).max() < 1e-3
    assert np.abs(found.height_um[regions == 7]).max() < 1e-3
    assert found.components[1].anchor_pixels == 0
    assert np.isnan(found.components[1].anchor_rms_px)


def test_anchors_that_contradict_each_other_show() -> None:
    normals, _ = two_plates()
    anchors = bgars.Anchors(known(board=0.0, top=30.0), weights=np.where(np.indices(SHAPE)[0] == 0, 2.0, 1.0))
    found = bgars.integrate_normals(normals, anchors=anchors, pixel_pitch_um=10.0)
    assert found.height_um is not None
    assert found.height_um[0, 0] == pytest.approx(10.0, abs=1e-3)  # weights 2 and 1
    assert found.components[0].anchor_rms_px == pytest.approx(np.sqrt((2 * 1 + 1 * 4) / 3), rel=1e-4)


def test_a_reach_bends_what_is_long_and_keeps_what_is_short() -> None:
    """Normals with a false tilt and a true ripple; anchors say flat."""
    rows, cols = np.indices((120, 120))
    ripple_px = 0.1 * np.sin(2 * np.pi * cols / 6.0)
    slope = 0.05 + 0.1 * 2 * np.pi / 6.0 * np.cos(2 * np.pi * cols / 6.0)
    normals = np.stack([-slope, 0.0 * rows, np.ones(rows.shape)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    flat = np.zeros(rows.shape)
    inner = (slice(20, 100), slice(20, 100))
    for reach, worst_px in (({}, 2.5), ({0: 4.0}, 0.03)):
        found = bgars.integrate_normals(normals, anchors=bgars.Anchors(flat, reach_px=reach), pixel_pitch_um=10.0)
        error_px = (found.height_px - ripple_px)[inner]
        assert np.abs(error_px).max() < worst_px
        if not reach:
            assert np.abs(error_px).max() > 1.0


BAD: list[tuple[dict[str, Any], str]] = [
    (
        {"height_um": np.zeros((2, 2))},
        r"anchors.height_um: must have the shape of the normals \(40, 60\), got \(2, 2\)",
    ),
    ({"height_um": np.full(SHAPE, np.nan)}, r"anchors.height_um: no height is known"),
    ({"regions": np.zeros(SHAPE)}, r"anchors.regions: must be integers, got float64"),
    ({"weights": np.full(SHAPE, -1.0)}, r"anchors.weights: must be finite and at least 0"),
    ({"weights": np.zeros(SHAPE)}, r"anchors: none lies on a pixel"),
    ({"reach_px": {0: -3.0}}, r"anchors.reach_px: must be finite and above 0, got -3 for region 0"),
]


@pytest.mark.parametrize(("change", "message"), BAD)
def test_bad_anchors_are_named(change: dict[str, Any], message: str) -> None:
    normals, _ = two_plates()
    arguments = {"height_um": np.zeros(SHAPE)} | change
    with pytest.raises(bgars.InputError, match=message):
        bgars.integrate_normals(normals, anchors=bgars.Anchors(**arguments), pixel_pitch_um=10.0)


def test_micrometres_need_a_pitch_and_no_camera() -> None:
    normals, _ = two_plates()
    anchors = bgars.Anchors(np.zeros(SHAPE))
    with pytest.raises(bgars.InputError, match="need pixel_pitch_um"):
        bgars.integrate_normals(normals, anchors=anchors)
    camera = bgars.Pinhole([[50, 0, 30], [0, 50, 20], [0, 0, 1]])
    with pytest.raises(bgars.InputError, match="leave one of the two out"):
        bgars.integrate_normals(normals, anchors=anchors, method="bilateral", camera=camera, pixel_pitch_um=10.0)
