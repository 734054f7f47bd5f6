"""The examples for cameras run, on the simulators that come with the makers' libraries."""

from __future__ import annotations

import importlib.util
import os
import socket
import subprocess
import sys
import threading
from pathlib import Path

import imageio.v3 as iio
import pytest
from line_captures import copy_capture

EXAMPLES = Path(__file__).parents[2] / "examples"


def need(*packages: str) -> None:
    for package in packages:
        if importlib.util.find_spec(package) is None:
            pytest.skip(f"{package} is not installed")


def take(folder: Path, camera: str, *more: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run the command where the examples lie, as a user does."""
    command = [sys.executable, "-m", "bgars", "capture", camera, "-o", str(folder), "--lights", "3", *more]
    return subprocess.run(
        command, cwd=EXAMPLES, env=os.environ | environment, capture_output=True, text=True, timeout=120, check=False
    )


def test_pylon_takes_a_capture_with_its_emulator(tmp_path: Path) -> None:
    need("pypylon")
    run = take(tmp_path / "part", "pylon_station:Station", PYLON_CAMEMU="1")
    assert run.returncode == 0, run.stderr
    images = [iio.imread(path) for path in sorted((tmp_path / "part").glob("*.png"))]
    assert [image.shape for image in images] == [(1040, 1024)] * 3
    assert {image.dtype.name for image in images} == {"uint16"}


def test_a_gentl_producer_takes_a_capture_with_a_virtual_camera(tmp_path: Path) -> None:
    need("harvesters", "genicam")
    run = take(tmp_path / "part", "genicam_station:Station")
    assert run.returncode == 0, run.stderr
    images = [iio.imread(path) for path in sorted((tmp_path / "part").glob("*.png"))]
    assert len(images) == 3
    assert all(image.shape[:2] == (400, 400) for image in images)


def test_a_folder_takes_the_next_part_with_every_start(tmp_path: Path) -> None:
    parts = tmp_path / "parts"
    for name in ("a", "b"):
        copy_capture(parts / name)
    first = sorted((parts / "b").glob("light*.png"))[0]
    iio.imwrite(first, 255 - iio.imread(first))
    for name in ("a", "b"):
        run = take(tmp_path / name, "folder_station:Station", PARTS=str(parts))
        assert run.returncode == 0, run.stderr
        shown = iio.imread(sorted((parts / name).glob("light*.png"))[0])
        assert (iio.imread(tmp_path / name / "light_00.png") == shown).all()


def test_a_light_is_off_whatever_happens(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(EXAMPLES))
    from led_controller import TextLights  # noqa: PLC0415 - beside the project

    heard: list[str] = []
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve() -> None:
            link, _ = server.accept()
            with link:
                while line := link.recv(100):
                    heard.append(line.decode())
                    link.sendall(b"OK\n")

        controller = threading.Thread(target=serve)
        controller.start()
        lights = TextLights("127.0.0.1", server.getsockname()[1])
        with pytest.raises(ZeroDivisionError), lights.on(3):
            _ = 1 / 0
        lights.close()
        controller.join()
    assert heard == ["ON 3\n", "OFF 3\n"]
