"""Pictures of an inspection: drawn for any part, the same each time, and the outline is where shadows are."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import bgars
import imageio.v3 as iio
import numpy as np
import pytest
from bgars.inspection.judge import judge_part
from bgars.report.figures.histograms import histogram_figure
from bgars.report.figures.part import thinned
from bgars.report.figures.process import PictureProcess
from bgars.report.figures.shadow_outline import shadow_outline_um
from matplotlib.path import Path as Outline
from synthetic_parts import measured_part

CAMERA = bgars.Camera(pixel_pitch_um=25.0)
RIG = bgars.LightRig.ring(4)
DRAWING = "bgars.report.figures.part_drawing"


def inspected(scene: bgars.Scene, recipe: bgars.PartRecipe | None = None) -> tuple[bgars.PartResult, bgars.Capture]:
    capture, truth = bgars.simulate(scene, RIG, bgars.Material(), CAMERA)
    return judge_part(*measured_part(truth), recipe, pixel_pitch_um=25.0), capture


@pytest.mark.parametrize(
    "scene",
    [
        bgars.Scene.ball(600.0, height_um=500.0),
        bgars.Scene.ball_array(
            3, 3, defects={"B2": bgars.Defect.missing()}, bridges=[bgars.Bridge("C2", "C3", radius_um=100.0)]
        ),
    ],
    ids=["one ball", "missing and bridged"],
)
def test_pictures_are_drawn_and_the_same_each_time(tmp_path: Path, scene: bgars.Scene) -> None:
    result, capture = inspected(scene)
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        files = bgars.write_part_pictures(result, capture, tmp_path / name)
    assert set(files) == {path.name for path in (tmp_path / "one").iterdir()}
    for name in files:
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()
        picture = iio.imread(tmp_path / "one" / name)
        assert min(picture.shape[:2]) > 500
        assert picture[..., :3].std() > 5


def test_pictures_of_another_capture_are_refused(tmp_path: Path) -> None:
    result, capture = inspected(bgars.Scene.ball(600.0, height_um=500.0))
    with pytest.raises(bgars.InputError, match="must have the 4 lights"):
        bgars.write_part_pictures(result, replace(capture, images=capture.images[:3]), tmp_path)
    with pytest.raises(bgars.InputError, match="pixel_pitch_um"):
        bgars.write_part_pictures(result, replace(capture, pixel_pitch_um=None), tmp_path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("near", [False, True])
@pytest.mark.parametrize("flattened", [False, True])
def test_the_outline_is_the_shadow_of_the_simulator(near: bool, flattened: bool) -> None:
    """Beyond the silhouette, on the far side of the light, a pixel is dark exactly when it is inside the outline."""
    defect = bgars.Defect.flattened(0.9, 1.05) if flattened else None
    scene = bgars.Scene.ball(600.0, height_um=500.0, x_um=150.0, y_um=-80.0, defect=defect)
    rig = bgars.LightRig.from_positions(RIG.directions * 6000.0) if near else RIG
    _, truth = bgars.simulate(scene, rig, bgars.Material(), replace(CAMERA, pixel_pitch_um=10.0))
    ball = scene.balls[0]
    rows, cols = truth.mask.shape
    x_um = (np.arange(cols) + 0.5 - cols / 2) * 10.0
    y_um = (rows / 2 - np.arange(rows) - 0.5) * 10.0
    grid = np.stack(np.meshgrid(x_um, y_um), axis=2).reshape(-1, 2)
    for light in range(4):
        outline = shadow_outline_um(
            np.array([ball.x_um, ball.y_um, ball.centre_z_um]),
            ball.radius_um,
            ball.aspect_ratio,
            rig.positions_um[light] if rig.positions_um is not None else rig.directions[light],
            np.zeros(2),
            is_position=near,
        )
        assert outline is not None
        inside = Outline(outline).contains_points(grid).reshape(rows, cols)
        away = (grid - [ball.x_um, ball.y_um]).reshape(rows, cols, 2) @ -rig.directions[light, :2] > 0
        board = (truth.ball_ids == 0) & away
        assert inside[board].sum() > 500
        wrong = inside[board] == truth.lit[light][board]
        assert wrong.mean() < 0.001


def test_a_process_of_their_own_draws_the_same_pictures(tmp_path: Path) -> None:
    result, capture = inspected(bgars.Scene.ball(600.0, height_um=500.0))
    for name in ("here", "beside", "after all"):
        (tmp_path / name).mkdir()
    files = bgars.write_part_pictures(result, capture, tmp_path / "here")
    with PictureProcess(DRAWING) as painter:
        painter.start(DRAWING, "draw_part_pictures", result, thinned(capture), tmp_path / "beside")
        painter.finish()
    with PictureProcess(DRAWING) as painter:
        assert painter._process is not None
        painter._process.kill()
        painter.start(DRAWING, "draw_part_pictures", result, thinned(capture), tmp_path / "after all")
        painter.finish()
    for name in files:
        assert (tmp_path / "here" / name).read_bytes() == (tmp_path / "beside" / name).read_bytes()
        assert (tmp_path / "here" / name).read_bytes() == (tmp_path / "after all" / name).read_bytes()


def test_the_process_ends_with_what_started_it() -> None:
    with pytest.raises(RuntimeError), PictureProcess(DRAWING) as painter:
        raise RuntimeError
    assert painter._process is not None
    assert painter._process.poll() is not None


def test_the_shaded_band_of_histograms_is_explained_where_there_is_one() -> None:
    recipe = bgars.read_part_recipe(bgars.sample_part_recipe())
    result, _ = inspected(bgars.Scene.ball_array(5, 5), recipe)
    legends = histogram_figure(result).legends
    assert [text.get_text() for text in legends[0].get_texts()] == ["undecided: nearer to a limit than U"]
    without, _ = inspected(bgars.Scene.ball(600.0, height_um=500.0))
    assert not histogram_figure(without).legends
