"""Heights for surface metrology, read back by the readers of other projects and by the letter of the formats."""

from __future__ import annotations

import hashlib
import re
import shutil
import subprocess
import xml.etree.ElementTree as ET
import zipfile
from pathlib import Path

import bgars
import numpy as np
import pytest
from bgars.io import areal_files
from bgars.io.areal_files import AREAL_PACKAGES
from bgars.io.height import HEIGHT_FORMATS

PITCH_UM = 5.0
HEIGHTS_UM = np.add.outer(10.0 * np.arange(20), np.arange(30)).astype(np.float32)
HEIGHTS_UM[2, 25:27] = np.nan
"""Rises downward in the image, ten times as steep as to the right; two invalid pixels."""
UP_M = HEIGHTS_UM[::-1] * 1e-6
"""As a format with y upward holds it: the lowest row of the image first."""


@pytest.fixture
def height() -> bgars.HeightMap:
    return bgars.HeightMap.from_array(HEIGHTS_UM, pixel_pitch_um=PITCH_UM)


@pytest.mark.parametrize("suffix", [".gsf", ".GSF"])
def test_gsf(height: bgars.HeightMap, tmp_path: Path, suffix: str) -> None:
    gsffile = pytest.importorskip("gsffile")
    path = tmp_path / f"h{suffix}"
    bgars.write_height(height, path)
    assert [found.name for found in tmp_path.iterdir()] == [path.name]
    # gwyddion.net/documentation/user-guide-en/gsf.html: 1 to 4 NUL up to a multiple of 4, then rows from the top.
    content = path.read_bytes()
    header, _, _ = content.partition(b"\0")
    fields = dict(line.split(" = ") for line in header.decode().splitlines()[1:])
    assert header.startswith(b"Gwyddion Simple Field 1.0\n")
    assert float(fields["XReal"]) == pytest.approx(30 * 5e-6)
    assert float(fields["YReal"]) == pytest.approx(20 * 5e-6)
    assert (fields["XYUnits"], fields["ZUnits"]) == ("m", "m")
    start = len(header) + 4 - len(header) % 4
    values = np.frombuffer(content[start:], "<f4").reshape(int(fields["YRes"]), int(fields["XRes"]))
    np.testing.assert_allclose(values, HEIGHTS_UM * 1e-6, rtol=1e-6)
    np.testing.assert_array_equal(gsffile.read_gsf(path.rename(tmp_path / "lower.gsf"))[0], values)


def test_sdf(height: bgars.HeightMap, tmp_path: Path) -> None:
    sdfio = pytest.importorskip("sdfio")
    bgars.write_height(height, tmp_path / "h.sdf")
    read = sdfio.read(tmp_path / "h.sdf")
    np.testing.assert_allclose(read.data, UP_M, atol=1e-12)
    np.testing.assert_allclose(read.x_axis, np.arange(30) * 5e-6)
    np.testing.assert_allclose(read.y_axis, np.arange(20) * 5e-6)
    # ISO 25178-71: 81 bytes of header before the points; the smallest int32 marks what was not measured.
    content = (tmp_path / "h.sdf").read_bytes()
    assert content.startswith(b"bISO-1.0bgars")
    points = np.frombuffer(content[81:][: 4 * UP_M.size], "<i4").reshape(UP_M.shape)
    np.testing.assert_array_equal(points == np.iinfo(np.int32).min, np.isnan(UP_M))


def test_x3p(height: bgars.HeightMap, tmp_path: Path) -> None:
    x3pio = pytest.importorskip("x3pio")
    bgars.write_height(height, tmp_path / "h.x3p")
    layer = x3pio.read(tmp_path / "h.x3p").layers[0]
    np.testing.assert_allclose(layer.z, UP_M, rtol=1e-6)
    np.testing.assert_allclose(layer.points()[-1, -1], [29 * 5e-6, 19 * 5e-6, UP_M[-1, -1]], rtol=1e-6)
    # ISO 25178-72: a ZIP of main.xml, its checksum, and the points as little-endian numbers.
    with zipfile.ZipFile(tmp_path / "h.x3p") as archive:
        main, data = archive.read("main.xml"), archive.read("bindata/data.bin")
        assert archive.read("md5checksum.hex").split()[0].decode() == hashlib.md5(main).hexdigest()
    fields = {element.tag: element.text for element in ET.fromstring(main).iter()}
    assert (fields["SizeX"], fields["SizeY"], fields["SizeZ"]) == ("30", "20", "1")
    assert float(str(fields["Increment"])) == 1.0  # the last of three, that of z: metres
    assert fields["MD5ChecksumPointData"] == hashlib.md5(data).hexdigest()
    np.testing.assert_allclose(np.frombuffer(data, "<f4").reshape(20, 30), UP_M, rtol=1e-6)
    assert fields["Manufacturer"] == "bgars"


@pytest.mark.parametrize("suffix", [".sdf", ".x3p"])
@pytest.mark.filterwarnings("ignore")
def test_another_program_reads_the_same_surface(height: bgars.HeightMap, tmp_path: Path, suffix: str) -> None:
    surfalize = pytest.importorskip("surfalize")
    pytest.importorskip(AREAL_PACKAGES[suffix])
    bgars.write_height(height, tmp_path / f"h{suffix}")
    surface = surfalize.Surface.load(tmp_path / f"h{suffix}")
    np.testing.assert_allclose(surface.data, UP_M * 1e6, atol=1e-4)
    assert surface.step_x == pytest.approx(PITCH_UM)


@pytest.mark.skipif(shutil.which("gwyddion") is None, reason="Gwyddion is not installed (apt-get install gwyddion)")
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("suffix", AREAL_PACKAGES)
def test_gwyddion_opens_it(height: bgars.HeightMap, tmp_path: Path, suffix: str) -> None:
    gwyfile = pytest.importorskip("gwyfile")
    pytest.importorskip(AREAL_PACKAGES[suffix])
    bgars.write_height(height, tmp_path / f"h{suffix}")
    converted = tmp_path / "h.gwy"
    subprocess.run(["gwyddion", f"--convert-to-gwy={converted}", tmp_path / f"h{suffix}"], check=True)
    opened = gwyfile.load(str(converted))
    # It has the first row at the top always, though SDF and X3P have y upward: docs/files.md says so.
    expected = HEIGHTS_UM * np.float32(1e-6) if suffix == ".gsf" else UP_M
    invalid = np.isnan(expected)
    np.testing.assert_array_equal(opened["/0/mask"].data > 0, invalid)
    np.testing.assert_allclose(opened["/0/data"].data[~invalid], expected[~invalid], atol=1e-11)
    assert opened["/0/data"].xreal == pytest.approx(30 * 5e-6)
    assert opened["/0/data"].yreal == pytest.approx(20 * 5e-6)


@pytest.mark.parametrize("suffix", AREAL_PACKAGES)
def test_what_cannot_be_written_is_said(suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / f"h{suffix}"
    pytest.importorskip(AREAL_PACKAGES[suffix])
    with pytest.raises(bgars.InputError, match=rf"{suffix} holds metres, which need a pixel pitch"):
        bgars.write_height(bgars.HeightMap.from_array(HEIGHTS_UM), path)
    with pytest.raises(bgars.InputError, match="has no valid pixel"):
        bgars.write_height(bgars.HeightMap.from_array(np.full((2, 2), np.nan), pixel_pitch_um=1.0), path)
    monkeypatch.setattr(areal_files, "missing", lambda *names: names)
    words = f"{suffix} needs {AREAL_PACKAGES[suffix]}: pip install 'bgars[areal]'"
    with pytest.raises(bgars.InputError, match=re.escape(words)):
        bgars.write_height(bgars.HeightMap.from_array(HEIGHTS_UM, pixel_pitch_um=PITCH_UM), path)
    assert not list(tmp_path.iterdir())


def test_an_unknown_suffix_lists_all(height: bgars.HeightMap, tmp_path: Path) -> None:
    with pytest.raises(bgars.InputError, match=re.escape(f"must end in {', '.join(HEIGHT_FORMATS)}; got '.bmp'")):
        bgars.write_height(height, tmp_path / "h.bmp")
