"""Records in a notebook: one line, a thumbnail, a plot."""

from __future__ import annotations

from pathlib import Path

import bgars
import matplotlib as mpl
import numpy as np
import pytest
from judged_parts import write_results, write_study
from report_parts import failing

mpl.use("agg")


@pytest.fixture(scope="module")
def records() -> dict[str, object]:
    capture = bgars.read_capture(bgars.sample_capture())
    field = bgars.estimate_normals(capture, method="lambertian")
    return {
        "Capture": capture,
        "NormalField": field,
        "HeightMap": bgars.integrate_normals(field),
        "PartResult": failing(),
    }


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("Capture", "lights=8, size=256 x 240 px, dtype=uint8, pitch=3.4 um"),
        ("NormalField", "method='lambertian', valid="),
        ("HeightMap", "components=1"),
        ("PartResult", "verdict=fail, balls="),
    ],
)
def test_a_record_is_one_short_line_a_picture_and_a_plot(records: dict[str, object], name: str, words: str) -> None:
    record = records[name]
    assert words in repr(record)
    assert len(repr(record)) < 200
    html = record._repr_html_()  # type: ignore[attr-defined]
    assert html.count("data:image/png;base64,") == 1
    assert len(html) < 200_000
    axes = record.plot()  # type: ignore[attr-defined]
    assert axes.get_title()
    assert record.plot(axes=axes) is axes  # type: ignore[attr-defined]
    mpl.pyplot.close("all")


def test_records_of_arrays_are_one_line_without_their_numbers() -> None:
    capture = bgars.read_capture(bgars.sample_capture())
    result = bgars.inspect(capture, surface=True)
    field = bgars.estimate_normals(capture)
    response = bgars.ResponseCurve(np.linspace(0, 1, 99), np.linspace(0, 1, 99))
    _, truth = bgars.simulate(
        bgars.Scene.hemisphere(300.0), capture.rig, bgars.Material(), bgars.Camera(pixel_pitch_um=10.0)
    )
    for record, words in (
        (bgars.shape_images(bgars.integrate_normals(field)), "slope_deg=(240, 256) float32, "),
        (bgars.read_truth(bgars.sample_capture()), "normals=(240, 256, 3) float32, "),
        (truth, "balls=1 entry, setup=SimulationSetup(...)"),
        (result.material, "PartMaterial(parameters="),
        (result.surface, "ball_step_px=1, "),
        (field.reflectance, "ReflectanceFit(balls=1, shape='sphere', loss=0.00"),
        (bgars.evaluate(capture, method="lambertian"), "region='balls, n_z > 0.3', normals=9."),
        (capture.rig, "LightRig(directions=(8, 3) float64, intensities=(8,) float64, "),
        (response, "ResponseCurve(levels=(99,) float64, radiances=(99,) float64, u_radiance=0, source='')"),
    ):
        assert words in repr(record)
        assert len(repr(record)) < 230
        assert "\n" not in repr(record)


def test_records_of_many_parts_are_one_line(tmp_path: Path) -> None:
    scene = bgars.Scene.ball_array(5, 5)
    balls, study = (
        bgars.find_balls(bgars.simulate(scene, bgars.LightRig.ring(4), bgars.Material(), bgars.Camera())[0]),
        bgars.read_study(write_study(tmp_path / "study", placements=2)),
    )
    trend = bgars.process_trend(bgars.read_results([write_results(tmp_path / "results", 40)])[0])
    for record, words in (
        (balls, "FoundBalls(balls=25 entries, missing=(), "),
        (scene, "Scene(balls=25 entries, "),
        (bgars.read_scene("one-ball"), "SimulationSetup(scene=Scene(...), "),
        (study, "runs=18 entries"),
        (bgars.gauge_rr(study), "GaugeStudy(study=Study(...), "),
        (trend, "ProcessTrend("),
        (trend.trends[0], "Trend(characteristic="),
    ):
        assert words in repr(record), repr(record)
        assert len(repr(record)) < 800
        assert "\n" not in repr(record)


def test_normals_of_others_are_evaluated_as_one_s_own_are() -> None:
    capture = bgars.read_capture(bgars.sample_capture())
    field = bgars.estimate_normals(capture, method="lambertian")
    own = bgars.evaluate(capture, method="lambertian")
    for given in (field.normals, 3.0 * field.normals.astype(np.float16), lambda _: field, field):
        found = bgars.evaluate(capture, method=given)
        assert found.normals.mean_deg == pytest.approx(own.normals.mean_deg, abs=0.02)
        assert found.board is not None
    assert bgars.evaluate(capture, method=field.normals).measured is None
    with pytest.raises(bgars.InputError, match=r"method: normals must be numbers of shape \(240, 256, 3\)"):
        bgars.evaluate(capture, method=field.normals[:9])


@pytest.mark.parametrize("direction", [(0, 0, 0), (1, 0), (0, np.nan, 1)])
def test_a_light_without_a_direction_relights_nothing(records: dict[str, object], direction: object) -> None:
    with pytest.raises(bgars.InputError, match="direction: must be three finite numbers"):
        records["NormalField"].relight(direction)  # type: ignore[attr-defined]


@pytest.mark.parametrize("direction", ["up", (0, 0, 1j), [[1], [2, 3]]])
def test_what_are_no_numbers_relight_nothing(records: dict[str, object], direction: object) -> None:
    with pytest.raises(bgars.InputError, match="direction: must be"):
        records["NormalField"].relight(direction)  # type: ignore[attr-defined]


@pytest.mark.parametrize("light", [8, -9, 1.5, "0", None, True])
def test_a_light_that_is_not_there_is_not_drawn(records: dict[str, object], light: object) -> None:
    with pytest.raises(bgars.InputError, match="light: must be a whole number from 0 to 7, got"):
        records["Capture"].plot(light)  # type: ignore[attr-defined]


def test_an_array_is_no_height_map(tmp_path: Path) -> None:
    heights = np.zeros((4, 4), np.float32)
    calls = [
        bgars.mesh_from_height,
        bgars.shape_images,
        lambda given: bgars.simplified_mesh(given, max_error_um=1.0),
        lambda given: bgars.write_height(given, tmp_path / "h.npy"),
        lambda given: bgars.write_points(given, tmp_path / "p.xyz"),
    ]
    for call in calls:
        with pytest.raises(bgars.InputError, match=r"must be a HeightMap.* got ndarray"):
            call(heights)
    with pytest.raises(bgars.InputError, match=r"mesh: must be a trimesh\.Trimesh or a HeightMap, got ndarray"):
        bgars.write_mesh(heights, tmp_path / "m.ply")
    with pytest.raises(bgars.InputError, match=r"field: must be a NormalField.* got ndarray"):
        bgars.mesh_from_height(bgars.HeightMap.from_array(heights), np.ones((4, 4, 3)))
    nothing = bgars.HeightMap.from_array(np.full((4, 4), np.nan))
    assert np.isnan(nothing.summary()["height_range_px"]).all()
    with pytest.raises(bgars.InputError, match="has no valid pixel to write to"):
        bgars.write_points(nothing, tmp_path / "p.xyz")
    assert list(tmp_path.iterdir()) == []
