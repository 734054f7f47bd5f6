"""The albedo of red, green and blue, by normals of their luminance."""

from __future__ import annotations

import json
from pathlib import Path

import bgars
import numpy as np
import pytest
import tifffile
from bgars.cli.app import app
from typer.testing import CliRunner

COLOURS = np.float32([[[0.5, 0.2, 0.1], [0.1, 0.4, 0.3]]]).repeat(24, axis=0).repeat(12, axis=1)
"""(24, 24, 3): two colours side by side."""


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    """A coloured cylinder under 8 lights, two of which make a white highlight on every pixel."""
    rig = bgars.LightRig.ring(8, elevation_deg=60)
    slant = np.linspace(-0.4, 0.4, 24)
    normals = np.stack([np.sin(slant), np.zeros(24), np.cos(slant)], axis=-1)[np.newaxis]
    for index, light in enumerate(rig.directions):
        levels = COLOURS * (normals @ light)[..., np.newaxis] + (0.4 if index in (1, 4) else 0.0)
        tifffile.imwrite(tmp_path / f"l{index}.tif", np.round(levels * 65535).astype(np.uint16), photometric="rgb")
    (tmp_path / "capture.toml").write_text("[lights]\nring = { count = 8, elevation_deg = 60.0 }\n")
    return tmp_path


def test_each_channel_has_its_albedo_whatever_the_highlights(capture: Path, tmp_path: Path) -> None:
    field = bgars.estimate_normals(bgars.read_capture(capture), method="robust-filter")
    albedo = bgars.colour_albedo(capture, field)
    np.testing.assert_allclose(albedo, COLOURS, rtol=0.01)
    red = bgars.estimate_normals(bgars.read_capture(capture, channel="red"), method="robust-filter")
    np.testing.assert_allclose(bgars.colour_albedo(capture, red, channel="red"), COLOURS, rtol=0.01)
    other = bgars.estimate_normals(bgars.read_capture(bgars.sample_capture()), method="lambertian")
    with pytest.raises(bgars.InputError, match=r"shape of the images \(24, 24\), got \(240, 256\)"):
        bgars.colour_albedo(capture, other)
    for command in ("normals", "reconstruct"):
        out = tmp_path / command
        asked = [command, str(capture), "-o", str(out), "-m", "robust-filter", "--colour", "--force", "--json"]
        run = CliRunner().invoke(app, asked)
        assert run.exit_code == 0, run.output
        assert "albedo_rgb.tif" in json.loads(run.stdout)["files"]
        np.testing.assert_array_equal(tifffile.imread(out / "albedo_rgb.tif"), albedo)
