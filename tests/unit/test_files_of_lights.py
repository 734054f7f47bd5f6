"""Tables of lights that name their images under any word: the order is that of the names; what is not used is said."""

from __future__ import annotations

import json
from pathlib import Path

import bgars
import numpy as np
import pytest
from bgars.files.image_endings import IMAGE_ENDINGS
from bgars.io.image_formats import IMAGE_SUFFIXES
from case_captures import COUNT, LIGHTS, levels, read_with_notes, reads_right, refused, write_images
from scipy.io import savemat

NAMES = [f"img_{index:02d}.png" for index in range(1, COUNT + 1)]
ORDER = [3, 1, 4, 0, 5, 2, 7, 6]
MIXED = [NAMES[place] for place in ORDER]
VECTORS = LIGHTS[ORDER].tolist()
NUMBERED = [{"id": place, "direction": LIGHTS[place].tolist()} for place in ORDER]


def table(*columns: str, header: str) -> str:
    rows = [
        ",".join(
            {"file": name, "xyz": "{:.6f},{:.6f},{:.6f}".format(*vector)}.get(column, column) for column in columns
        )
        for name, vector in zip(MIXED, VECTORS, strict=True)
    ]
    return "\n".join([header, *rows])


FILES = {
    "Foto": ("lights.csv", table("file", "xyz", header="Foto,x,y,z"), []),
    "Bild, last": ("lights.csv", table("xyz", "file", header="x,y,z,Bild"), []),
    "two words": ("lights.csv", table("file", "xyz", header="Image File,x,y,z"), []),
    "name of the lamp": ("lights.csv", table("left", "file", "xyz", header="name,Datei,x,y,z"), ["not used: name"]),
    "files": ("lights.json", {"directions": VECTORS, "files": MIXED}, []),
    "stems": ("lights.json", {"filenames": [name[:-4] for name in MIXED], "directions": VECTORS}, ["by stem"]),
    "entries beside": ("lights.json", {"directions": VECTORS, "photos": [{"src": name} for name in MIXED]}, []),
    "any word": (
        "lights.json",
        {"lights": VECTORS, "Bilder": MIXED, "lamp": MIXED},
        ["8 values that are not used: lamp"],
    ),
    "in entries": (
        "lights.json",
        [{"name": "left", "Foto": name, "direction": vector} for name, vector in zip(MIXED, VECTORS, strict=True)],
        [],
    ),
    "dome": ("a.dome", {"directions": VECTORS, "images": MIXED}, []),
    "id": ("lights.json", {"lights": NUMBERED}, ["sorted by their numbers"]),
    "id from 1, intensities beside": (
        "lights.json",
        {"lights": [{**each, "id": each["id"] + 1} for each in NUMBERED], "intensities": [1.0] * COUNT},
        ["sorted by their numbers"],
    ),
}


@pytest.mark.parametrize("case", FILES)
def test_names_give_the_order(tmp_path: Path, case: str) -> None:
    name, content, words = FILES[case]
    write_images(tmp_path)
    (tmp_path / name).write_text(content if isinstance(content, str) else json.dumps(content))
    reads_right(tmp_path, name, *words)


@pytest.mark.parametrize("names", [np.array(MIXED, dtype=object), np.array(MIXED)], ids=["cells", "characters"])
@pytest.mark.parametrize("compressed", [False, True])
def test_names_in_matlab(tmp_path: Path, names: np.ndarray, compressed: bool) -> None:
    write_images(tmp_path)
    others = {"note": "a text", "gain": np.ones((1, COUNT)), "mixed": np.array([1.0, "a"], dtype=object)}
    savemat(tmp_path / "L.mat", {"L": np.array(VECTORS), "bilder": names, **others}, do_compression=compressed)
    reads_right(tmp_path, "'L'", "lists of 8 values that are not used: gain")


def test_strengths_follow_their_numbers(tmp_path: Path) -> None:
    write_images(tmp_path)
    content = {"lights": NUMBERED, "intensities": [1.0 + place for place in ORDER]}
    (tmp_path / "lights.json").write_text(json.dumps(content))
    capture, _ = read_with_notes(tmp_path)
    np.testing.assert_array_equal(capture.rig.intensities, np.arange(COUNT) + 1.0)


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (
            {"lights": [{**each, "id": 7 * each["id"]} for each in NUMBERED]},
            "id is not used (21, 7, 28, 0, 35, 14, ...)",
        ),
        ({"directions": VECTORS, "exposure": [1.0] * COUNT}, "lists of 8 values that are not used: exposure"),
    ],
)
def test_what_is_not_used_is_said(tmp_path: Path, content: object, told: str) -> None:
    write_images(tmp_path)
    (tmp_path / "lights.json").write_text(json.dumps(content))
    with pytest.warns(bgars.CaptureWarning) as warned:
        bgars.read_capture(tmp_path)
    assert any(told in str(each.message) for each in warned)


def test_another_number_of_names_is_refused(tmp_path: Path) -> None:
    write_images(tmp_path)
    (tmp_path / "lights.json").write_text(json.dumps({"directions": VECTORS, "files": MIXED[:-1]}))
    refused(tmp_path, "lights.json: files names 7 images, but there are 8 lights")


def test_every_image_that_is_read_counts_as_a_name() -> None:
    assert set(IMAGE_ENDINGS) >= IMAGE_SUFFIXES


@pytest.mark.parametrize("name", ["L.npy", "l.npy", "S.npy", "light.npy"])
@pytest.mark.parametrize("vectors", [LIGHTS, LIGHTS.T])
def test_an_array_of_vectors_is_no_image(tmp_path: Path, name: str, vectors: np.ndarray) -> None:
    write_images(tmp_path)
    np.save(tmp_path / name, vectors)
    np.save(tmp_path / "intensities.npy", np.ones(COUNT))
    reads_right(tmp_path, f"lights taken from {name}", "intensities taken from intensities.npy")


def test_an_array_of_vectors_beside_arrays_of_images(tmp_path: Path) -> None:
    for name, image in zip(NAMES, levels(), strict=True):
        np.save(tmp_path / f"{name[:-4]}.npy", image)
    np.save(tmp_path / "L.npy", LIGHTS)
    reads_right(tmp_path, "lights taken from L.npy")


@pytest.mark.parametrize("content", [b"", b"PK\3\4", b"\x93NUMPY\1\0\x0a\0{'descr': ("])
def test_a_damaged_array_is_left_to_its_reader(tmp_path: Path, content: bytes) -> None:
    write_images(tmp_path, NAMES[1:], levels()[1:])
    (tmp_path / "img_01.npy").write_bytes(content)
    np.save(tmp_path / "L.npy", LIGHTS)
    refused(tmp_path, "img_01.npy")
