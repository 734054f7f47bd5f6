"""The shared captures in the dialects of public reports: each has the outcome that its README names."""

from __future__ import annotations

import warnings
from pathlib import Path

import bgars
import numpy as np
import pytest

MEAN_NORMAL = (-0.006, 0.008, 0.945)
"""Of the scene that most cases show, by the capture that follows every rule (img_png8)."""

READ_SILENTLY = [
    "lp_basic",
    "lp_tabs",
    "lp_trailing_blank",
    "lp_spaces",
    "lp_unnormalised",
    "lp_positions_mm",
    "lp_quoted",
    "lp_csv",
    "lp_comments",
    "lp_crlf_bom",
    "lp_uppercase_LP",
    "img_bmp",
    "img_natural_order",
    "img_natural_order12",
    "img_pgm",
    "img_png8",
    "img_png16",
    "img_tga",
    "img_upper_PNG",
    "png_la",
    "png_palette",
    "png_rgba",
    "tif16_bigendian",
    "tif16_gray",
    "tif16_rgb_lzw_pred",
    "tif_8bit_rgb",
    "tif_tiled",
    "tif12in16",
    "names_crlf_filenames",
    "names_hash",
    "names_subdir",
    "extra_files",
    "dirs_comma",
    "inten3_gray",
    "appledouble",
    "pslight_names_in_lights",
    "Ordner mit Umlaut ä [1]",
]

SAID = {
    "lp_winpath": ["last part of their paths", "img_01.png"],
    "lp_posixpath": ["last part of their paths"],
    "lp_rtibuilder_layout": ["assembly-files/coin.lp", "jpeg-exports"],
    "lp_case": ["case of letters", "IMG_01.PNG"],
    "lp_ext_differs": ["by stem", "img_01.CR2 as img_01.png"],
    "lp_nocount": ["no count", "8 lights"],
    "lp_comma_decimal": ["decimal commas"],
    "lp_utf16": ["UTF-16"],
    "lp_latin1": ["Windows-1252"],
    "lp_extra_images": ["preview.png"],
    "lights_txt_count": ["lights.txt"],
    "lights_npy": ["lights.npy", "3 rows of 8"],
    "lights_mat": ["L.mat", "'L'"],
    "lights_json": ["lights.json"],
    "dirs_3xN": ["3 rows of 8"],
    "dirs_csv_header": ["light_directions.csv"],
    "img_webp": ["WebP"],
    "img_gif": ["GIF"],
    "img_jpeg": ["JPEG"],
    "img_upper_JPG": ["JPEG"],
    "jpg_cmyk": ["JPEG"],
    "images_in_subdir_nofilenames": ["folder images"],
    "tif_multipage": ["stack of 8 images"],
    "jpg_exif6": ["orientation tag (6)"],
    "ambient_in_folder": ["ambient.png", "dark ="],
    "normalgt_png_in_folder": ["Normal_gt.png"],
}

MASKED = {
    "mask_1bit": [],
    "mask_rgba": [],
    "mask_tif": ["mask.tif"],
    "mask_upper": ["Mask.png"],
    "png_rgba_alpha_mask": ["transparent"],
}

REFUSED = {
    "lp_count_less": ["lights.lp", "announces 6", "8 follow"],
    "lp_count_more": ["lights.lp", "announces 9", "8 follow"],
    "lp_missing_image": ["img_08.png", "no such image"],
    "lp_nan": ["line 4", "nan"],
    "lp_zero": ["line 4", "not zero"],
    "lp_two_files": ["coin_ball1.lp", "coin_ball2.lp"],
    "lp_dup": ["img_01.png", "twice"],
    "inten_zero": ["light 2", "above 0"],
    "two_images": ["at least 3", "2"],
    "size_mismatch": ["008.png", "80 x 60"],
    "truncated": ["005.jpg", "truncated"],
    "mask_wrong_size": ["mask.png", "40 x 32"],
    "mask_01": ["mask.png", "largest value is 1"],
    "no_lights": ["no description of the lights", "8 images"],
    "more_lights": ["7 images", "8 lights"],
}

pytestmark = pytest.mark.data


@pytest.fixture(scope="module")
def cases(data_folder: Path) -> Path:
    folder = data_folder / "cases"
    if not folder.is_dir():
        pytest.skip("no shared cases")
    return folder


def mean_normal(folder: Path) -> tuple[np.ndarray, bgars.Capture, str]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", bgars.CaptureWarning)
        capture = bgars.read_capture(folder)
    field = bgars.estimate_normals(capture, method="robust-filter")
    assert field.mask[capture.mask].mean() > 0.99
    told = " | ".join(str(entry.message) for entry in caught)
    return np.nanmean(field.normals, axis=(0, 1)), capture, told


@pytest.mark.parametrize("name", [*READ_SILENTLY, *SAID])
def test_read_right_and_what_is_assumed_is_said(cases: Path, name: str) -> None:
    normal, capture, told = mean_normal(cases / name)
    np.testing.assert_allclose(normal, MEAN_NORMAL, atol=2e-3)
    assert capture.mask.all()
    for word in SAID.get(name, []):
        assert word in told
    if name in READ_SILENTLY:
        assert told == ""


@pytest.mark.parametrize("name", MASKED)
def test_masks_are_used(cases: Path, name: str) -> None:
    _, capture, told = mean_normal(cases / name)
    assert 0.5 < capture.mask.mean() < 0.7
    for word in MASKED[name]:
        assert word in told


def test_a_subset_of_the_images(cases: Path) -> None:
    normal, capture, told = mean_normal(cases / "lp_subset")
    assert len(capture.images) == 6
    np.testing.assert_allclose(normal, MEAN_NORMAL, atol=3e-3)
    assert "img_07.png, img_08.png" in told


def test_srgb_is_doubted_and_undone(cases: Path, tmp_path: Path) -> None:
    wrong, _, told = mean_normal(cases / "jpg_srgb")
    assert 'response = "srgb"' in told
    assert np.abs(wrong - MEAN_NORMAL).max() > 0.02
    for path in (cases / "jpg_srgb").iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    (tmp_path / "capture.toml").write_text(
        'response = "srgb"\n[lights]\ndirections = "light_directions.txt"\n', encoding="utf-8"
    )
    right, _, told = mean_normal(tmp_path)
    assert told == ""
    np.testing.assert_allclose(right, MEAN_NORMAL, atol=2e-3)


@pytest.mark.parametrize("name", REFUSED)
def test_refused_in_one_line(cases: Path, name: str) -> None:
    with pytest.raises(bgars.BgarsError) as caught:
        bgars.read_capture(cases / name)
    message = str(caught.value)
    assert "\n" not in message
    for word in REFUSED[name]:
        assert word in message, message


def test_coplanar_lights_are_refused(cases: Path) -> None:
    with pytest.raises(bgars.InputError, match=r"one plane"):
        bgars.estimate_normals(bgars.read_capture(cases / "coplanar"), method="robust-filter")


def test_no_case_is_forgotten(cases: Path) -> None:
    known = {*READ_SILENTLY, *SAID, *MASKED, *REFUSED, "lp_subset", "jpg_srgb", "coplanar"}
    elsewhere = {"lp_negz", "lp_ydown", "oblate_one_ball_q085", "shape_cap", "shape_coin", "shape_flat", "shape_oblate"}
    present = {path.name for path in cases.iterdir() if path.is_dir() and not path.name.startswith("mesh_")}
    assert present - known - elsewhere == set()
