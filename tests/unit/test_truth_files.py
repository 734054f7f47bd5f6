"""Truth as benchmarks ship it."""

from __future__ import annotations

from pathlib import Path

import bgars
import imageio.v3 as iio
import numpy as np
import pytest
from case_captures import SHAPE, read_with_notes, truth, write_directions, write_images
from scipy.io import savemat

MASK = np.zeros(SHAPE, np.uint8)
MASK[3:12, 4:20] = 255
NORMALS = truth() * (MASK > 0)[..., None]


def put(folder: Path, name: str) -> None:
    if name.endswith(".npy"):
        np.save(folder / name, NORMALS.astype(np.float32))
    elif name.endswith(".mat"):
        savemat(folder / name, {"Normal_gt": NORMALS})
    else:
        np.savetxt(folder / name, NORMALS.reshape(-1, 3))


@pytest.mark.parametrize("name", ["Normal_gt.npy", "Normal_gt.mat", "normal.txt"])
def test_a_folder_of_the_benchmark_is_evaluated_as_it_is_shipped(tmp_path: Path, name: str) -> None:
    names = write_images(tmp_path, [f"{index:03d}.png" for index in range(1, 9)])
    write_directions(tmp_path)
    np.savetxt(tmp_path / "light_intensities.txt", np.ones((8, 3)))
    (tmp_path / "filenames.txt").write_text("\n".join(names), encoding="utf-8")
    iio.imwrite(tmp_path / "mask.png", MASK)
    put(tmp_path, name)
    capture, notes = read_with_notes(tmp_path)
    assert notes == []
    known = bgars.read_truth(tmp_path)
    np.testing.assert_array_equal(known.mask, MASK > 0)
    field = bgars.estimate_normals(capture, method="lambertian")
    errors = bgars.angular_error_deg(field.normals, known.normals)
    assert np.nanmax(errors[known.mask]) < 0.5


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("Normal_gt.mat", b"nonsense" * 99, "not an array of normals"),
        ("Normal_gt.npy", b"\x93NUMPY", "not an array of normals"),
        ("gt.npz", b"PK\3\4", "not a scene truth"),
        ("normal.txt", b"0 0 1\n", "1 normals"),
        ("normal.txt", b"0 0\n", "not an array of normals"),
    ],
)
def test_damaged_truth(tmp_path: Path, name: str, content: bytes, words: str) -> None:
    (tmp_path / name).write_bytes(content)
    iio.imwrite(tmp_path / "mask.png", MASK)
    with pytest.raises(bgars.FileFormatError, match=words):
        bgars.read_truth(tmp_path)
