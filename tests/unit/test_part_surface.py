"""The surface of an inspected part: true to the simulator, apart from the readings, kept and drawn as it is."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import bgars
import numpy as np
import pytest
from bgars.cli.app import app
from bgars.io.surface_file import surface_bytes
from bgars.report.html.mesh import unpacked
from bgars.report.html.page import page_text
from bgars.report.html.source import PageSource, read_page_source
from bgars.report.html.surface import OUTERMOST
from typer.testing import CliRunner

CLIPPED_UM = 60.0


@cache
def inspected() -> tuple[bgars.PartResult, bgars.Capture, bgars.SimulatedTruth]:
    scene = bgars.Scene.ball_array(
        3,
        3,
        jitter=bgars.Jitter(8.0, 4.0, 5.0),
        seed=3,
        board=bgars.Board(bgars.Material.matte(0.35)),
        defects={"B2": bgars.Defect.clipped(CLIPPED_UM), "C3": bgars.Defect.missing()},
    )
    capture, truth = bgars.simulate(
        scene, bgars.LightRig.ring(8), bgars.Material(), bgars.Camera(pixel_pitch_um=15.0), seed=1
    )
    return bgars.inspect(capture, surface=True), capture, truth


def surface() -> bgars.PartSurface:
    found = inspected()[0].surface
    assert found is not None
    return found


def scene_of(source: PageSource) -> dict[str, dict[str, object]]:
    match = re.search(r'id="scene-data">(.*?)</script>', page_text(source))
    assert match is not None
    return {trace["name"]: trace for trace in json.loads(match[1])["data"]}


def test_heights_are_those_of_the_simulator() -> None:
    truth = inspected()[2]
    found = surface()
    step = found.ball_step_px
    error_um = (found.ball_height_um - truth.height_um[::step, ::step])[found.ball_measured]
    assert error_um.size > 8 * 900, "all balls but the missing one are there"
    assert abs(np.median(error_um)) < 1.0
    assert np.sqrt(np.mean(error_um**2)) < 4.0
    step = found.board_step_px
    error_um = found.board_height_um - truth.height_um[::step, ::step]
    assert np.nanmax(np.abs(error_um)) < 3.0
    assert 0.5 < np.isfinite(found.board_height_um).mean() < 0.9, "the foot of a ball is left out"


def test_no_reading_depends_on_it() -> None:
    result, capture, _ = inspected()
    plain = bgars.inspect(capture)
    assert plain.surface is None
    assert plain.to_json() == result.to_json()
    assert "surface" not in result.to_dict()


def test_places_without_a_height_are_left_out() -> None:
    """In the map where no ball is; in the view also a ball whose height is not known: it would float freely."""
    result = inspected()[0]
    found = surface()

    def at(x_um: float, y_um: float) -> float:
        row, col = found.shape_px[0] / 2 - 0.5 - y_um / 15.0, x_um / 15.0 + found.shape_px[1] / 2 - 0.5
        return float(found.ball_height_um[round(row), round(col)])

    first, missing = result.balls[0], next(ball for ball in result.balls if ball.name == "C3")
    assert np.isfinite(at(first.x_um, first.y_um))
    assert not missing.present
    assert np.isnan(at(1000.0, -1000.0))
    unknown = replace(first, top_um=np.nan, centre_z_um=np.nan)
    source = PageSource(replace(result, balls=(unknown, *result.balls[1:])).to_dict(), surface=found)
    x, y = (unpacked(scene_of(source)["balls, integrated normals"][axis]) for axis in "xy")  # type: ignore[arg-type]
    assert np.hypot(x - first.x_um, y - first.y_um).min() > first.diameter_um / 2
    one = inspected()[0].balls[1]
    assert np.hypot(x - one.x_um, y - one.y_um).min() < 1.0


def test_the_page_draws_the_height_map() -> None:
    """Tops of round balls stand where the result says, the clipped one is flat, its edge is told as a prior."""
    result = inspected()[0]
    traces = scene_of(PageSource(result.to_dict(), surface=surface()))
    mesh = traces["balls, integrated normals"]
    drawn = [ball for ball in result.balls if ball.present]
    x, y, z = (unpacked(mesh[axis]).reshape(len(drawn), -1) for axis in "xyz")  # type: ignore[arg-type]
    tops = [ball.top_um for ball in drawn]
    np.testing.assert_allclose(z.max(axis=1), tops, atol=3.0)
    flat = next(at for at, ball in enumerate(drawn) if ball.name == "B2")
    off = np.hypot(x - x[:, :1], y - y[:, :1]) / np.array([[ball.diameter_um / 2] for ball in drawn])
    assert off.max() == pytest.approx(OUTERMOST, abs=1e-3)
    near = (off[flat] < 0.3) & (z[flat] > 0)
    assert np.ptp(z[flat][near]) < 5.0, "flat"
    assert all(np.ptp(z[at][off[at] < 0.3]) > 8.0 for at in range(len(drawn)) if at != flat), "round"
    assert {"board, integrated normals", "from a prior, not measured"} <= set(traces)
    assert traces["fitted spheroids"]["visible"] == "legendonly"
    faces = np.stack([unpacked(mesh[axis]) for axis in "ijk"])  # type: ignore[arg-type]
    assert faces.max() < z.size


def test_without_a_surface_the_page_says_so() -> None:
    result = inspected()[0]
    text = page_text(PageSource(result.to_dict()))
    assert "No integrated surface is stored with this result" in text
    assert "integrated normals" not in text
    assert "a sample every 15 µm" in page_text(PageSource(result.to_dict(), surface=surface()))


@cache
def written() -> tuple[str, dict[str, bytes]]:
    import tempfile  # noqa: PLC0415 - once for all tests

    result, capture, _ = inspected()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        bgars.write_report(result, folder / "report.html", capture=capture)
        files = {path.name: path.read_bytes() for path in folder.iterdir()}
    return result.to_json(), files


def folder_of(place: Path) -> Path:
    text, files = written()
    (place / "result.json").write_text(text, encoding="utf-8")
    for name, content in files.items():
        (place / name).write_bytes(content)
    return place


def test_the_page_is_written_again_from_the_kept_surface(tmp_path: Path) -> None:
    folder = folder_of(tmp_path)
    first = (folder / "report.html").read_bytes()
    bgars.write_report(folder, folder / "again.html")
    assert (folder / "again.html").read_bytes() == first
    again = read_page_source(folder).surface
    assert again is not None
    assert surface_bytes(again) == (folder / "surface.npz").read_bytes()


def test_the_surface_of_another_inspection_is_not_taken(tmp_path: Path) -> None:
    folder = folder_of(tmp_path)
    (folder / "surface.npz").write_bytes(surface_bytes(replace(surface(), pixel_pitch_um=14.0)))
    assert read_page_source(folder).surface is None
    (folder / "surface.npz").unlink()
    assert read_page_source(folder).surface is None
    assert read_page_source(folder).warnings == (), "taken away on purpose"


def test_the_command_says_that_it_draws_no_surface(tmp_path: Path) -> None:
    folder = folder_of(tmp_path)
    file = folder / "surface.npz"
    file.write_bytes(file.read_bytes()[:-9])
    run = CliRunner().invoke(app, ["report", str(folder)])
    assert run.exit_code == 0, run.output
    words = f"warning: {file}: is not the file that report.json names: cut off, or of another inspection"
    assert words in run.output
    warned = json.loads(CliRunner().invoke(app, ["report", str(folder), "--json"]).output)["warnings"]
    assert len(warned) == 1
    assert warned[0].endswith("the 3-D view shows spheroids instead of the surface")


SPOILT: dict[str, Callable[[bytes], bytes]] = {
    "cut": lambda content: content[: len(content) // 2],
    "empty": lambda _: b"",
    "text": lambda _: b"no zip at all",
    "a pitch of zero": lambda _: surface_bytes(replace(surface(), pixel_pitch_um=0.0)),
    "a step that does not fit": lambda _: surface_bytes(replace(surface(), ball_step_px=7)),
    "another kind of number": lambda _: surface_bytes(
        replace(surface(), ball_height_um=surface().ball_height_um.astype(np.float64))  # type: ignore[arg-type]
    ),
}


@pytest.mark.parametrize("name", list(SPOILT))
def test_a_spoilt_surface_is_refused_by_name(name: str, tmp_path: Path) -> None:
    """Its checksum is right: somebody made it so."""
    from hashlib import sha256  # noqa: PLC0415

    folder = folder_of(tmp_path)
    path = folder / "surface.npz"
    path.write_bytes(SPOILT[name](path.read_bytes()))
    side = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    side["surface"]["sha256"] = sha256(path.read_bytes()).hexdigest()
    (folder / "report.json").write_text(json.dumps(side), encoding="utf-8")
    with pytest.raises(bgars.FileFormatError, match=r"surface\.npz: "):
        bgars.write_report(folder, folder / "again.html")
    assert not (folder / "again.html").exists()
