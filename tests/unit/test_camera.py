"""Captures through the small protocol of a camera."""

from __future__ import annotations

from pathlib import Path

import bgars
import imageio.v3 as iio
import numpy as np
import pytest
from bgars.cli.app import app
from bgars.line.camera import FolderCamera, camera_of, take_capture
from typer.testing import CliRunner

RIG = "pixel_pitch_um = 3.4\n[lights]\nring = { count = 8, elevation_deg = 45.0 }\n"


class Broken:
    def __init__(self, *images: np.ndarray) -> None:
        self.images = images

    def grab(self, light: int) -> np.ndarray:
        return self.images[light]


def test_a_capture_through_a_camera_is_what_the_camera_showed(tmp_path: Path) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text(RIG)
    out = tmp_path / "inbox" / "SN1"
    run = CliRunner().invoke(app, ["capture", f"folder:{bgars.sample_capture()}", "-o", str(out), "--rig", str(rig)])
    assert run.exit_code == 0, run.output
    assert np.array_equal(bgars.read_capture(out).images, bgars.read_capture(bgars.sample_capture()).images)
    assert [path.name for path in out.parent.iterdir()] == ["SN1"], "nothing half-written"


def test_a_folder_shows_its_images_in_the_order_of_a_capture(tmp_path: Path) -> None:
    for light in (10, 5, 1):
        iio.imwrite(tmp_path / f"img_{light}.png", np.full((4, 5), light, np.uint8))
    iio.imwrite(tmp_path / "MASK.png", np.ones((4, 5), np.uint8))
    shown = FolderCamera(tmp_path)
    assert [int(shown.grab(light)[0, 0]) for light in range(len(shown.files))] == [1, 5, 10]
    (tmp_path / "capture.toml").write_text('images = ["img_10.png", "img_1.png"]\n' + RIG)
    assert [path.name for path in FolderCamera(tmp_path).files] == ["img_10.png", "img_1.png"]
    (tmp_path / "img_1.png").unlink()
    with pytest.raises(bgars.FileFormatError, match=r"capture\.toml: images: no such file: .*img_1\.png"):
        FolderCamera(tmp_path)


def test_a_rig_is_named_by_its_folder_too_and_a_clean_check_says_so(tmp_path: Path) -> None:
    (tmp_path / "rig").mkdir()
    (tmp_path / "rig" / "capture.toml").write_text(RIG)
    line = ["capture", f"folder:{bgars.sample_capture()}", "-o", str(tmp_path / "SN1"), "--rig", str(tmp_path / "rig")]
    run = CliRunner().invoke(app, line)
    assert run.exit_code == 0, run.output
    assert (tmp_path / "SN1" / "capture.toml").read_text() == RIG
    findings = bgars.check(bgars.read_capture(tmp_path / "SN1"))
    assert ("no faults found" in run.output.splitlines()) == (not findings.told)


def test_a_driver_of_ones_own_is_found_beside_the_project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "my_station.py").write_text(
        "import numpy as np\nclass Mine:\n"
        "    def grab(self, light):\n        return np.full((4, 5), 10 * light, np.uint16)\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    assert take_capture(camera_of("my_station:Mine"), tmp_path / "c", lights=3) == [
        f"light_{light:02d}.png" for light in range(3)
    ]


@pytest.mark.parametrize(
    ("images", "words"),
    [
        ([np.zeros((4, 4), np.float32)], r"grab\(0\) must return grey or RGB pixels"),
        ([np.zeros((4, 4), np.uint8), np.zeros((4, 5), np.uint8)], r"grab\(1\) must be like the first image"),
    ],
)
def test_a_camera_that_fails_leaves_nothing(images: list[np.ndarray], words: str, tmp_path: Path) -> None:
    with pytest.raises(bgars.InputError, match=words):
        take_capture(Broken(*images), tmp_path / "c", lights=len(images))
    assert list(tmp_path.iterdir()) == []


def test_wrong_use_gets_one_line(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    with pytest.raises(bgars.InputError, match="must be a new folder"):
        take_capture(FolderCamera(bgars.sample_capture()), tmp_path / "there", lights=8)
    with pytest.raises(bgars.FileFormatError, match="holds no images"):
        FolderCamera(tmp_path)
    for name, words in {"x": "must be folder:PATH", "no_such:Thing": "cannot be imported"}.items():
        with pytest.raises(bgars.InputError, match=words):
            camera_of(name)
    with pytest.raises(bgars.InputError, match=r"light: must be 0 to 7, as .* holds 8 images, got 8"):
        FolderCamera(bgars.sample_capture()).grab(8)


def test_what_a_driver_raises_is_one_line_that_names_the_light(tmp_path: Path) -> None:
    with pytest.raises(bgars.BgarsError, match=r"camera: grab\(1\) gave no image \(IndexError: tuple index"):
        take_capture(Broken(np.zeros((4, 4), np.uint8)), tmp_path / "part", lights=2)
    assert not (tmp_path / "part").exists()


def test_what_the_rig_names_comes_along_or_is_missed_before_the_first_image(tmp_path: Path) -> None:
    camera = FolderCamera(bgars.sample_capture())
    rig = tmp_path / "rig.toml"
    rig.write_text('[lights]\nangles_deg = "lights/ring.csv"\n')
    with pytest.raises(bgars.InputError, match=r"rig.toml: lights.angles_deg: the file 'lights/ring.csv' must stand"):
        take_capture(camera, tmp_path / "part", lights=8, rig=rig)
    assert not (tmp_path / "part").exists()
    (tmp_path / "lights").mkdir()
    (tmp_path / "lights" / "ring.csv").write_text("".join(f"{45 * light},45\n" for light in range(8)))
    assert take_capture(camera, tmp_path / "part", lights=8, rig=rig)[-1] == "lights/ring.csv"
    elevations = np.degrees(np.arcsin(bgars.read_capture(tmp_path / "part").rig.directions[:, 2]))
    assert np.allclose(elevations, 45)
    rig.write_text('station = "station.toml"\n')
    with pytest.raises(bgars.InputError, match=r"station: 'station\.toml' is not found from"):
        take_capture(camera, tmp_path / "other", lights=8, rig=rig)
