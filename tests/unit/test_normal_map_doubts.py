"""Normal maps that can be read in two ways, or that their file has damaged: the wrong way is not taken in silence."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bgars.io.normal_map import read_stored_normals
from bgars.io.normal_map_blocks import Blocks, blocks_of
from bgars.io.normal_map_green import curl_of
from PIL import Image
from scipy.ndimage import gaussian_filter

SHAPE = (256, 280)
ROWS, COLS = np.mgrid[: SHAPE[0], : SHAPE[1]]
X, Y = COLS - 139.7, 127.4 - ROWS
DISC = np.hypot(X, Y) < 100
FLAT = (128, 128, 255)


def unit(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    normals = np.stack([-p, -q, np.ones_like(p)], axis=-1)
    return normals / np.linalg.norm(normals, axis=2, keepdims=True)


def relief(seed: int) -> np.ndarray:
    """Unit normals of a random surface of tilts of 20 degrees or so."""
    noise = np.random.default_rng(seed).normal(size=SHAPE)
    z_down, z_right = np.gradient(500.0 * gaussian_filter(noise, 12) + 2500.0 * gaussian_filter(noise[::-1], 30))
    return unit(z_right, -z_down)


def ball() -> np.ndarray:
    z = np.sqrt(np.maximum(101.0**2 - X**2 - Y**2, 1.0))
    normals = np.stack([X, Y, z], axis=-1)
    return normals / np.linalg.norm(normals, axis=2, keepdims=True)


def codes(normals: np.ndarray) -> np.ndarray:
    return np.rint((normals + 1) / 2 * 255).astype(np.uint8)


def errors_deg(found: np.ndarray, truth: np.ndarray) -> np.ndarray:
    use = np.isfinite(found[..., 0])
    return np.degrees(np.arccos(np.clip((found * truth).sum(axis=2)[use], -1, 1)))


@pytest.mark.parametrize("around", [(255, 255, 255), (0, 0, 0), (127, 127, 127), FLAT])
@pytest.mark.parametrize(
    ("name", "options"), [("n.jpg", {"subsampling": 2}), ("n.jpg", {"subsampling": 0}), ("n.webp", {})]
)
@pytest.mark.parametrize("quality", [60, 90])
def test_pixels_that_blocks_have_mixed_with_the_surround_are_left_out(
    around: tuple[int, int, int], name: str, options: dict[str, int], quality: int, tmp_path: Path
) -> None:
    truth = relief(3)
    image = Image.fromarray(np.where(DISC[..., None], codes(truth), np.uint8(around)))
    image.save(tmp_path / name, quality=quality, **options)
    found = read_stored_normals(tmp_path / name)
    assert any("mixed" in note and "PNG" in note for note in found.notes)
    seen = np.isfinite(found.vectors[..., 0])
    assert not (seen & ~DISC).any()
    assert seen.sum() > 0.6 * DISC.sum()
    # Far from the outline the same compression leaves errors of one source only.
    Image.fromarray(codes(truth)).save(tmp_path / f"whole{name}", quality=quality, **options)
    whole = read_stored_normals(tmp_path / f"whole{name}")
    assert not whole.notes
    assert np.quantile(errors_deg(found.vectors, truth), 0.999) < 1.5 * np.quantile(
        errors_deg(whole.vectors, truth), 0.999
    )


def test_a_mask_does_not_keep_mixed_pixels(tmp_path: Path) -> None:
    Image.fromarray(np.where(DISC[..., None], codes(ball()), np.uint8(255))).save(tmp_path / "n.jpg", quality=80)
    Image.fromarray(DISC).save(tmp_path / "use.png")
    found = read_stored_normals(tmp_path / "n.jpg", mask=tmp_path / "use.png")
    assert "mixed" in found.notes[0]
    assert errors_deg(found.vectors, ball()).max() < 6.0


def test_an_object_smaller_than_its_blocks_is_kept_with_a_note(tmp_path: Path) -> None:
    small = np.hypot(X, Y) < 9
    Image.fromarray(np.where(small[..., None], codes(relief(1)), np.uint8(255))).save(tmp_path / "n.jpg", quality=98)
    found = read_stored_normals(tmp_path / "n.jpg")
    assert "all pixels" in found.notes[0]
    assert np.isfinite(found.vectors).any()


@pytest.mark.parametrize(
    ("subsampling", "blocks"), [(0, Blocks(8, 8, 0)), (1, Blocks(8, 16, 1)), (2, Blocks(16, 16, 1))]
)
def test_the_blocks_of_a_jpeg_are_those_of_its_frame_header(subsampling: int, blocks: Blocks, tmp_path: Path) -> None:
    Image.fromarray(codes(ball())).save(tmp_path / "n.jpg", subsampling=subsampling, progressive=subsampling == 1)
    assert blocks_of(tmp_path / "n.jpg") == blocks
    (tmp_path / "cut.jpg").write_bytes((tmp_path / "n.jpg").read_bytes()[:30])
    assert blocks_of(tmp_path / "cut.jpg") == Blocks(16, 16, 1)


SURFACES = {
    **{f"relief {seed}": relief(seed) for seed in range(20, 26)},
    "ball": np.where(DISC[..., None], ball(), np.nan),
    "top of a ball": unit(X / 800, Y / 800) * np.ones((*SHAPE, 1)),
    "oval bowl": unit(X / 500, Y / 900),
    "saddle": unit(Y / 400, X / 400),
    "saddle at 45 degrees": unit(X / 400, -Y / 400),
    "grooves": unit(0.3 * np.sin(X / 7), 0 * Y),
    "grooves at 30 degrees": unit(0.4 * np.sin((2 * X + Y) / 17), 0.2 * np.sin((2 * X + Y) / 17)),
    "roof": unit(0.4 * np.sign(X), 0.4 * np.sign(Y)),
    "plane": unit(0 * X, 0 * Y),
}


def worn(normals: np.ndarray, how: str) -> np.ndarray:
    """The same map with errors that maps have."""
    rng = np.random.default_rng(7)
    worn = normals.copy()
    if how == "8 bits":
        return codes(np.nan_to_num(normals)) / 127.5 - 1.0 + 0 * normals
    if how == "noise":
        worn += rng.normal(scale=0.03, size=normals.shape)
    elif how == "noisy red":
        worn[..., 0] += rng.normal(scale=0.03, size=SHAPE)
    elif how == "rows":
        worn[..., :2] += rng.normal(scale=0.02, size=(SHAPE[0], 1, 2))
    elif how == "cloudy":
        worn[..., 0] += 0.5 * gaussian_filter(rng.normal(size=SHAPE), 15)
        worn[..., 1] += 0.5 * gaussian_filter(rng.normal(size=SHAPE), 15)
    return worn / np.linalg.norm(worn, axis=2, keepdims=True)


@pytest.mark.parametrize("how", ["exact", "8 bits", "noise", "noisy red", "rows", "cloudy"])
@pytest.mark.parametrize("name", SURFACES)
def test_red_and_green_that_are_right_are_never_exchanged(name: str, how: str) -> None:
    normals = worn(SURFACES[name], how)
    usable = np.isfinite(normals[..., 0])
    for signs in ([1, 1, 1], [1, -1, 1]):
        stored = np.float32(np.nan_to_num(normals) * signs)
        assert not curl_of(stored, usable).exchanged


@pytest.mark.parametrize("how", ["exact", "8 bits"])
@pytest.mark.parametrize("name", [*(f"relief {seed}" for seed in range(20, 26)), "ball", "grooves at 30 degrees"])
def test_exchanged_red_and_green_are_found_on_relief(name: str, how: str) -> None:
    normals = worn(SURFACES[name], how)
    usable = np.isfinite(normals[..., 0])
    for sign in (1, -1):
        stored = np.float32(np.nan_to_num(normals * [1, sign, 1])[..., [1, 0, 2]])
        found = curl_of(stored, usable)
        assert found.exchanged
        assert found.agreement * sign > 0.5


def test_what_is_stated_of_green_keeps_red_and_green_and_is_contradicted(tmp_path: Path) -> None:
    Image.fromarray(codes(relief(9)[..., [1, 0, 2]])).save(tmp_path / "n.png")
    stated = read_stored_normals(tmp_path / "n.png", directx=False)
    assert "shows them exchanged" in stated.notes[0]
    assert errors_deg(stated.vectors[..., [1, 0, 2]], relief(9)).max() < 1.0


@pytest.mark.parametrize("change", [[-1, 1, 1], [1, -1, 1]])
def test_a_reversed_channel_is_said_with_the_chance_that_it_is_the_other(change: list[int], tmp_path: Path) -> None:
    Image.fromarray(codes(relief(9) * change)).save(tmp_path / "n.png")
    (note,) = read_stored_normals(tmp_path / "n.png").notes
    assert "if bumps come out as dents, red is reversed instead" in note


def test_normals_averaged_over_creases_do_not_turn_blue(tmp_path: Path) -> None:
    ridges = unit(0.7 * np.sign(np.sin(X / 2.3)), 0.5 * np.sign(np.sin(Y / 3.1)))
    filtered = np.stack([gaussian_filter(ridges[..., axis], 0.8) for axis in range(3)], axis=-1)
    Image.fromarray(codes(filtered)).save(tmp_path / "n.png")
    assert not any("blue" in note for note in read_stored_normals(tmp_path / "n.png").notes)
