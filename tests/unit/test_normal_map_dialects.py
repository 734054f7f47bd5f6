"""Normal maps as people hold them: read right, saying what was assumed, or refused in one line."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path

import bgars
import imageio.v3 as iio
import numpy as np
import pytest
import tifffile
from bgars.cli.app import app
from bgars.io.normal_map import read_stored_normals
from case_captures import pfm
from PIL import Image
from scipy.io import savemat
from typer.testing import CliRunner

SHAPE = (90, 110)
CASES = Path(os.environ.get("BGARS_DATA", "/nonexistent")) / "cases"


def truth() -> np.ndarray:
    """(H, W, 3) unit normals of a hilly surface, float64."""
    rows, cols = np.mgrid[: SHAPE[0], : SHAPE[1]]
    height = 5 * np.sin(rows / 13) * np.cos(cols / 17) + 6 * np.exp(-((rows - 50) ** 2 + (cols - 40) ** 2) / 300)
    z_down, z_right = np.gradient(height)
    normals = np.stack([-z_right, z_down, np.ones(SHAPE)], axis=-1)
    return normals / np.linalg.norm(normals, axis=2, keepdims=True)


MASK = np.hypot(*(np.mgrid[: SHAPE[0], : SHAPE[1]] - 48)) < 35


def codes(normals: np.ndarray, bits: int = 8) -> np.ndarray:
    top = 2**bits - 1
    return np.rint((normals + 1) / 2 * top).astype(np.uint8 if bits == 8 else np.uint16)


def on(background: tuple[int, int, int]) -> np.ndarray:
    return np.where(MASK[..., None], codes(truth()), np.uint8(background))


def srgb(normals: np.ndarray) -> np.ndarray:
    share = (normals + 1) / 2
    curved = np.where(share <= 0.0031308, 12.92 * share, 1.055 * share ** (1 / 2.4) - 0.055)
    return np.rint(255 * curved).astype(np.uint8)


def with_alpha(alpha: np.ndarray, color: np.ndarray | None = None) -> np.ndarray:
    return np.dstack([codes(truth()) if color is None else color, alpha.astype(np.uint8)])


def error_deg(found: np.ndarray, use: np.ndarray) -> float:
    cosine = np.clip((found * truth()).sum(axis=2)[use], -1, 1)
    return float(np.degrees(np.arccos(cosine)).mean())


TURNED = truth() * [1, -1, 1]
BLUE_FROM_0 = np.dstack([codes(truth())[..., :2], np.rint(255 * truth()[..., 2]).astype(np.uint8)])
SWIZZLED = with_alpha(codes(truth())[..., 0], np.dstack([np.full(SHAPE, 255, np.uint8), *[codes(truth())[..., 1]] * 2]))


def png(values: np.ndarray) -> Callable[[Path], Path]:
    def save(folder: Path) -> Path:
        if values.dtype == np.uint16:
            bgars._bgars.write_png16(folder / "n.png", values)
        else:
            iio.imwrite(folder / "n.png", values)
        return folder / "n.png"

    return save


def saved(name: str, write: Callable[[Path], object]) -> Callable[[Path], Path]:
    def save(folder: Path) -> Path:
        write(folder / name)
        return folder / name

    return save


def exr(path: Path) -> None:
    library = pytest.importorskip("OpenEXR")
    header = {"compression": library.ZIP_COMPRESSION, "type": library.scanlineimage}
    with library.File(header, {"RGB": truth().astype(np.float32)}) as file:
        file.write(str(path))


def radiance(path: Path) -> None:
    """A flat file of four bytes a pixel: red, green and blue of one exponent."""
    shares = truth() / 2 + 0.5
    _, exponent = np.frexp(shares.max(axis=2))
    mantissa = np.floor(shares * 256.0 / np.exp2(exponent)[..., None]).astype(np.uint8)
    pixels = np.dstack([mantissa, (exponent + 128).astype(np.uint8)])
    path.write_bytes(f"#?RADIANCE\n\n-Y {SHAPE[0]} +X {SHAPE[1]}\n".encode() + pixels.tobytes())


# name: (file, where normals are expected, words of the note or "")
READ: dict[str, tuple[Callable[[Path], Path], np.ndarray, str]] = {
    "8 bits": (png(codes(truth())), MASK | True, ""),
    "16 bits": (png(codes(truth(), 16)), MASK | True, ""),
    "8 bits in 16": (png(codes(truth()).astype(np.uint16) * 257), MASK | True, ""),
    "white background": (png(on((255, 255, 255))), MASK, ""),
    "grey background": (png(on((127, 127, 127))), MASK, ""),
    "grey background 128": (png(on((128, 128, 128))), MASK, ""),
    "black background": (png(on((0, 0, 0))), MASK, ""),
    "coloured background": (png(on((255, 0, 255))), MASK, ""),
    "flat background": (png(on((128, 128, 255))), MASK, "flat surround"),
    "flat background 127": (png(on((127, 127, 255))), MASK, "flat surround"),
    "alpha": (png(with_alpha(MASK * 255, on((200, 20, 30)))), MASK, ""),
    "green down": (png(codes(TURNED)), MASK | True, "DirectX"),
    "green down, 16 bits": (png(codes(TURNED, 16)), MASK | True, "DirectX"),
    "green down, white": (png(np.where(MASK[..., None], codes(TURNED), np.uint8(255))), MASK, "DirectX"),
    "blue first": (png(codes(truth())[..., ::-1].copy()), MASK | True, "B, G, R"),
    "blue first, green down": (png(codes(TURNED)[..., ::-1].copy()), MASK | True, "B, G, R"),
    "red and green exchanged": (png(codes(truth())[..., [1, 0, 2]]), MASK | True, "exchanged"),
    "exchanged, 16 bits": (png(codes(truth()[..., [1, 0, 2]], 16).copy()), MASK | True, "exchanged"),
    "exchanged, y down": (png(codes(TURNED)[..., [1, 0, 2]]), MASK | True, "exchanged, and y as down"),
    "blue from 0 to 1": (png(BLUE_FROM_0), MASK | True, "from 0 to 1"),
    "blue from 0 to 1, white": (png(np.where(MASK[..., None], BLUE_FROM_0, np.uint8(255))), MASK, "from 0 to 1"),
    "z away": (png(codes(truth() * [1, 1, -1])), MASK | True, "away"),
    "sRGB curve": (png(srgb(truth())), MASK | True, "sRGB"),
    "two channels, blue 0": (png(codes(truth()) * np.uint8([1, 1, 0])), MASK | True, "third channel"),
    "two channels, blue 255": (
        png(np.dstack([codes(truth())[..., :2], np.full(SHAPE, 255, np.uint8)])),
        MASK | True,
        "third channel",
    ),
    "x in alpha": (png(SWIZZLED), MASK | True, "alpha"),
    "JPEG": (saved("n.jpg", lambda path: iio.imwrite(path, codes(truth()), quality=95)), MASK | True, ""),
    "TIFF, 8 bits": (saved("n.tif", lambda path: tifffile.imwrite(path, codes(truth()))), MASK | True, ""),
    "TIFF, 16 bits": (saved("n.tiff", lambda path: tifffile.imwrite(path, codes(truth(), 16))), MASK | True, ""),
    "TIFF, floats": (
        saved("n.tif", lambda path: tifffile.imwrite(path, truth().astype(np.float32), photometric="rgb")),
        MASK | True,
        "",
    ),
    "TIFF, floats, minimal": (
        saved(
            "n.tif",
            lambda path: tifffile.imwrite(
                path, truth().astype(np.float32), photometric="minisblack", planarconfig="contig"
            ),
        ),
        MASK | True,
        "",
    ),
    "TIFF, doubles": (saved("n.tif", lambda path: tifffile.imwrite(path, truth(), photometric="rgb")), MASK | True, ""),
    "npy": (saved("n.npy", lambda path: np.save(path, truth())), MASK | True, ""),
    "npy, Fortran order": (saved("n.npy", lambda path: np.save(path, np.asfortranarray(truth()))), MASK | True, ""),
    "npy, big-endian": (saved("n.npy", lambda path: np.save(path, truth().astype(">f4"))), MASK | True, ""),
    "npy, channels first": (saved("n.npy", lambda path: np.save(path, np.moveaxis(truth(), 2, 0))), MASK | True, ""),
    "npy, 0 to 1": (saved("n.npy", lambda path: np.save(path, truth() / 2 + 0.5)), MASK | True, "from 0 to 1"),
    "npy, zeros outside": (saved("n.npy", lambda path: np.save(path, truth() * MASK[..., None])), MASK, ""),
    "npy, NaN outside": (
        saved("n.npy", lambda path: np.save(path, np.where(MASK[..., None], truth(), np.nan))),
        MASK,
        "",
    ),
    "npy, codes": (saved("n.npy", lambda path: np.save(path, codes(truth()))), MASK | True, ""),
    "npz": (saved("n.npz", lambda path: np.savez(path, normals=truth(), depth=truth())), MASK | True, ""),
    "npz, one array": (saved("n.npz", lambda path: np.savez(path, truth())), MASK | True, ""),
    "MATLAB": (saved("N.mat", lambda path: savemat(path, {"Normal_gt": truth()})), MASK | True, ""),
    "TGA": (saved("n.tga", lambda path: Image.fromarray(codes(truth())).save(path)), MASK | True, ""),
    "WebP": (saved("n.webp", lambda path: Image.fromarray(codes(truth())).save(path, lossless=True)), MASK | True, ""),
    "Radiance HDR": (saved("n.hdr", radiance), MASK | True, "from 0 to 1"),
    "PFM": (saved("n.pfm", lambda path: path.write_bytes(pfm(truth()))), MASK | True, ""),
    "EXR": (saved("n.exr", exr), MASK | True, ""),
}


@pytest.mark.parametrize("name", READ)
def test_a_map_of_every_dialect_is_read_right_and_says_what_was_assumed(name: str, tmp_path: Path) -> None:
    write, use, note = READ[name]
    found = read_stored_normals(write(tmp_path))
    assert any(note in told for told in found.notes) if note else not found.notes, found.notes
    seen = np.isfinite(found.vectors[..., 0])
    assert error_deg(found.vectors, use & seen) < (1.5 if name == "JPEG" else 0.5)
    wrong = np.mean(seen != use)
    assert wrong < 0.002, "only pixels of the outline may be taken for the other side"


REFUSED: dict[str, tuple[Callable[[Path], Path], str]] = {
    "world space": (png(codes(np.roll(truth(), 1, axis=2)[..., [2, 0, 1]] * [1, 1, -1])), "face away"),
    "a photograph": (png(np.random.default_rng(0).integers(0, 256, (*SHAPE, 3), np.uint8)), "not a normal map"),
    "a photograph on white": (
        png(np.where(MASK[..., None], np.uint8([180, 150, 90]) + np.uint8(MASK[..., None]), np.uint8(255))),
        "not a normal map",
    ),
    "grey": (png(codes(truth())[..., 2]), "RGB"),
    "grey and alpha": (png(codes(truth())[..., :2].copy()), "RGB"),
    "npy of objects": (saved("n.npy", lambda path: np.save(path, np.array([{}, 1]), allow_pickle=True)), "numbers"),
    "npy of one row": (saved("n.npz", lambda path: np.savez(path, a=np.zeros(3))), "(H, W, 3)"),
    "complex": (saved("n.npy", lambda path: np.save(path, truth() * 1j)), "numbers"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_normal_map_is_refused_in_one_line(name: str, tmp_path: Path) -> None:
    write, words = REFUSED[name]
    path = write(tmp_path)
    with pytest.raises((bgars.FileFormatError, bgars.InputError)) as error:
        read_stored_normals(path)
    assert words in str(error.value)
    assert path.name in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("code", [(128, 128, 255), (127, 127, 255), (127, 128, 254)])
def test_a_plain_flat_map_stays_flat(code: tuple[int, int, int], tmp_path: Path) -> None:
    iio.imwrite(tmp_path / "flat.png", np.full((256, 256, 3), code, np.uint8))
    height = bgars.integrate_normals(bgars.read_normal_map(tmp_path / "flat.png")).height_px
    assert np.ptp(height) == 0.0


def test_a_board_around_a_bump_is_no_background(tmp_path: Path) -> None:
    rows, cols = np.mgrid[:80, :80] - 40
    z_down, z_right = np.gradient(6 * np.exp(-(rows**2 + cols**2) / 100))
    normals = np.stack([-z_right, z_down, np.ones_like(z_right)], axis=-1)
    iio.imwrite(tmp_path / "n.png", codes(normals / np.linalg.norm(normals, axis=2, keepdims=True)))
    found = read_stored_normals(tmp_path / "n.png")
    assert np.isfinite(found.vectors).all()
    assert not found.notes


@pytest.mark.parametrize("slope", [0.3, 0.8])
def test_a_cone_on_its_plane_is_no_cut_out(slope: float, tmp_path: Path) -> None:
    rows, cols = np.mgrid[:80, :80] - 40.0
    inside, radius = np.hypot(rows, cols) < 25, np.maximum(np.hypot(rows, cols), 1)
    normals = np.stack([slope * inside * cols / radius, -slope * inside * rows / radius, np.ones((80, 80))], axis=-1)
    iio.imwrite(tmp_path / "n.png", codes(normals / np.linalg.norm(normals, axis=2, keepdims=True)))
    assert np.isfinite(read_stored_normals(tmp_path / "n.png").vectors).all()


def test_a_declared_green_is_kept_and_a_field_that_says_else_is_told(tmp_path: Path) -> None:
    path = png(codes(TURNED))(tmp_path)
    found = read_stored_normals(path, directx=False)
    assert "shows y down" in found.notes[0]
    assert error_deg(found.vectors * [1, -1, 1], MASK | True) < 0.5
    with pytest.warns(UserWarning, match="DirectX"):
        bgars.read_normal_map(path)


def test_a_mask_is_used_and_wins_over_a_background(tmp_path: Path) -> None:
    path = png(codes(truth()))(tmp_path)
    iio.imwrite(tmp_path / "use.png", (MASK * 255).astype(np.uint8))
    found = read_stored_normals(path, mask=tmp_path / "use.png")
    assert (np.isfinite(found.vectors[..., 0]) == MASK).all()
    iio.imwrite(tmp_path / "small.png", np.full((4, 4), 255, np.uint8))
    with pytest.raises(bgars.InputError, match="4 x 4"):
        read_stored_normals(path, mask=tmp_path / "small.png")


def mesh(source: Path, folder: Path, *options: str) -> dict[str, object]:
    run = CliRunner().invoke(app, ["mesh", str(source), "-o", str(folder / "m.ply"), "--json", *options])
    assert run.exit_code == 0, run.exception
    said: dict[str, object] = json.loads(run.output)
    return said


def test_mesh_says_what_it_assumed_and_takes_the_word_of_the_caller(tmp_path: Path) -> None:
    path = png(codes(TURNED))(tmp_path)
    assert "DirectX" in str(mesh(path, tmp_path)["notes"])
    assert mesh(path, tmp_path, "--directx")["notes"] == []
    assert "shows y down" in str(mesh(path, tmp_path, "--opengl")["notes"])


@pytest.mark.data
@pytest.mark.parametrize(
    ("file", "note"),
    [
        ("mesh_bg_flat/normal_map.png", "flat surround"),
        ("mesh_bg_grey127/normal_map.png", ""),
        ("mesh_directx_noflag/normal_dx.png", "DirectX"),
        ("mesh_flat128/flat.png", ""),
        ("mesh_float_tif/normal.tif", ""),
        ("mesh_jpg/normal.jpg", ""),
        ("mesh_npy_HW3/normals.npy", ""),
        ("mesh_srgb/normal.png", "sRGB"),
        ("mesh_tif16/normal.tif", ""),
        ("mesh_zneg/normal.png", "away"),
    ],
)
def test_cases_of_public_reports(file: str, note: str, tmp_path: Path) -> None:
    if not CASES.is_dir():
        pytest.skip("BGARS_DATA has no cases")
    told = mesh(CASES / file, tmp_path)["notes"]
    assert note in str(told) if note else told == []
    found = read_stored_normals(CASES / file).vectors
    expected = np.load(CASES / "mesh_npy_HW3/normals.npy")
    if file.startswith("mesh_flat128"):
        assert (found == [0, 0, 1]).all()
        return
    use = np.isfinite(found[..., 0])
    assert use.mean() > 0.25
    assert np.degrees(np.arccos(np.clip((found * expected).sum(axis=2)[use], -1, 1))).mean() < 1.0
