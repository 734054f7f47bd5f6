"""A short run of the fuzzer in CI, and what longer runs found."""

from __future__ import annotations

import re
import sys
from collections import Counter
from pathlib import Path
from random import Random

import bgars
import numpy as np
import pytest
import tifffile

sys.path.insert(0, str(Path(__file__).parent))
import fuzzer
from hostile import CALLS, hostile_call
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from readers import READERS, make_corpus

INPUTS = 60
SEED = 20261128


@pytest.fixture(scope="module")
def corpus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("fuzz") / "corpus"
    make_corpus(folder)
    return folder


@pytest.mark.parametrize("name", READERS)
def test_whole_files_are_read(name: str, corpus: Path) -> None:
    read, patterns = READERS[name]
    files = [path for pattern in patterns for path in sorted(corpus.glob(pattern))]
    assert files
    for path in files:
        if path.name == "hp.tif":  # several pages
            with pytest.raises(bgars.FileFormatError, match="several pages"):
                read(path)
        elif path.name != "scene.json":
            read(path)


@pytest.mark.parametrize("name", READERS)
def test_damaged_files_are_read_or_refused_in_one_line(name: str, corpus: Path, tmp_path: Path) -> None:
    found = fuzzer.run_batch(corpus, name, SEED, 0, INPUTS, tmp_path)
    assert found == Counter({"": INPUTS})


@pytest.mark.parametrize("name", CALLS)
@pytest.mark.filterwarnings("ignore")
@settings(max_examples=30, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(chance=st.randoms(use_true_random=False))
def test_hostile_arguments_are_answered_or_refused(name: str, chance: Random) -> None:
    assert hostile_call(name, chance) == ""


def test_a_capture_made_by_hand_must_fit_together() -> None:
    rig = bgars.LightRig.ring(4)
    images = np.full((4, 6, 7), 90, np.uint8)
    mask = np.ones((6, 7), bool)
    bgars.check(bgars.Capture(images, rig, mask))
    for wrong, said in (
        (bgars.Capture(images[:3], rig, mask), "one light for each of the 3 images, got 4"),
        (bgars.Capture(images[0], rig, mask), r"images: must have shape \(lights, rows, columns\)"),
        (bgars.Capture(images, rig, mask.T), r"mask: must have shape \(6, 7\)"),
        (bgars.Capture(images, rig, mask, dark=images[0, :3]), r"dark: must have shape \(6, 7\)"),
        (bgars.Capture(images, rig, mask, saturation="x"), "saturation: must be a number"),  # type: ignore[arg-type]
        (bgars.Capture(images, rig, mask, dark=np.full((6, 7), 5.5)), "dark: must have the dtype of the images, uint8"),
        (bgars.Capture(images / 255, rig, mask, dark=np.full((6, 7), np.nan, np.float32)), "dark: must be finite"),
        (bgars.Capture(images, rig, mask, response=np.arange(256)[::-1]), "response: must be finite and must not fall"),
        (bgars.Capture(images, rig, mask, response=np.full(256, np.nan)), "response: must be finite and must not fall"),
        (bgars.Capture(images, rig, mask, full_scale=0.0), "full_scale: must be finite and above 0, got 0"),
    ):
        for function in (bgars.check, bgars.find_balls, bgars.estimate_normals):
            with pytest.raises(bgars.InputError, match=said):
                function(wrong)


def test_directions_are_no_rig() -> None:
    with pytest.raises(bgars.InputError, match=r"rig: must be a LightRig, as bgars.LightRig.from_directions.* ndarray"):
        bgars.Capture(np.zeros((4, 6, 7), np.uint8), bgars.LightRig.ring(4).directions, np.ones((6, 7), bool))  # type: ignore[arg-type]


@pytest.mark.parametrize(("value", "is_used"), [(90, False), (np.nan, True)])
def test_a_board_without_pixels_or_numbers_has_no_flat_field(value: float, is_used: bool) -> None:
    images = np.full((4, 6, 7), value, np.float32)
    capture = bgars.Capture(images, bgars.LightRig.ring(4), np.full((6, 7), is_used), full_scale=255.0)
    with pytest.raises(bgars.CalibrationError, match="must be finite" if is_used else "the mask has 0 pixels"):
        bgars.calibrate_flat(capture)


def test_nor_does_a_masked_stack_take_any_mask() -> None:
    images = np.ma.masked_array(np.full((4, 6, 7), 90, np.uint8), mask=False)
    with pytest.raises(bgars.InputError, match=r"mask: must have shape \(6, 7\)"):
        bgars.Capture(images, bgars.LightRig.ring(4), np.ones((6, 8), bool))


def test_a_deep_side_file_is_refused_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "report.json").write_text("[" * 100_000, encoding="utf-8")
    read, _ = READERS["page source"]
    with pytest.raises(bgars.FileFormatError, match="remove it to do without"):
        read(tmp_path / "report.json")


def test_an_encrypted_surface_file_is_refused_in_one_line(corpus: Path, tmp_path: Path) -> None:
    content = bytearray((corpus / "surface.npz").read_bytes())
    for mark, flags in ((b"PK\x01\x02", 8), (b"PK\x03\x04", 6)):  # in the table of contents, and before each array
        for found in re.finditer(re.escape(mark), bytes(content)):
            content[found.start() + flags] |= 1
    (tmp_path / "surface.npz").write_bytes(content)
    read, _ = READERS["surface"]
    with pytest.raises(bgars.FileFormatError, match="remove it to do without"):
        read(tmp_path / "surface.npz")


def test_a_black_capture_is_dark_and_no_accident() -> None:
    black = bgars.Capture(np.zeros((4, 6, 7), np.uint8), bgars.LightRig.ring(4), np.ones((6, 7), bool))
    assert [each.kind for each in bgars.check(black)] == ["dark"]


def test_a_tiff_of_more_rows_than_its_table_of_strips_is_refused_at_once(tmp_path: Path) -> None:
    path = tmp_path / "h.tif"
    tifffile.imwrite(path, np.zeros((12, 14), np.float32), compression="zlib", rowsperstrip=3)
    with tifffile.TiffFile(path, mode="r+b") as tiff:
        tiff.pages.first.tags["ImageLength"].overwrite(2_097_164)
    with pytest.raises(bgars.FileFormatError, match="table of strips"):
        bgars.read_height(path)


@pytest.mark.parametrize(
    "header",
    [
        {"descr": "<f4", "fortran_order": False, "shape": (10**9, 10**9)},
        {"descr": "<f4", "fortran_order": False, "shape": (-4, 4)},
        {"descr": "|O", "fortran_order": False, "shape": (4, 4)},
        {"descr": "<c8", "fortran_order": False, "shape": (4, 4)},
    ],
)
def test_an_npy_header_is_not_believed(header: dict[str, object], tmp_path: Path) -> None:
    path = tmp_path / "h.npy"
    with path.open("wb") as file:
        np.lib.format.write_array_header_1_0(file, header)
        file.write(bytes(3000))
    with pytest.raises(bgars.FileFormatError, match=path.name):
        bgars.read_height(path)
