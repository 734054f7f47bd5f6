"""The same bits: for any threads, tiles and files."""

from __future__ import annotations

import csv
import json
import math
import re
from dataclasses import replace
from pathlib import Path

import bgars
import numpy as np
import pytest
from test_cli import bgars_command

RIG = bgars.LightRig.ring(5, elevation_deg=50.0, intensities=[1, 0.9, 1.05, 0.97, 1.1])
NEAR = bgars.LightRig.from_positions(
    [[30000.0, 0.0, 30000.0], [-20000.0, 25000.0, 31000.0], [-18000.0, -26000.0, 29000.0]], intensities=[1, 0.9, 1.1]
)


def scene() -> bgars.Scene:
    return bgars.Scene.ball_array(
        2,
        3,
        jitter=bgars.Jitter(5.0, 3.0, 4.0),
        defects={"A2": bgars.Defect.missing(), "A3": bgars.Defect.clipped(30.0), "B1": bgars.Defect.flattened()},
        bridges=[bgars.Bridge("B2", "B3")],
        board=bgars.Board(
            material=bgars.Material(i_d=0.1, i_s=0.05, roughness=0.3),
            tilt_x_deg=0.3,
            bow_um=10.0,
            bow_radius_um=2000.0,
            texture=bgars.Texture(0.2, 300.0, 4),
        ),
        seed=2,
    )


MATERIAL = bgars.Material(
    i_d=0.45,
    i_s=0.8,
    hardness=60.0,
    second_lobe=bgars.Lobe(0.1, 0.4, "ggx"),
    fresnel="schlick",
    variation=bgars.Variation(0.1, 0.1, 0.05),
)
NOISY = bgars.Camera(
    pixel_pitch_um=20.0,
    bit_depth=12,
    full_well_e=9000.0,
    read_noise_levels=60.0,
    black_level=500.0,
    supersample=2,
    blur_px=0.7,
)


def same(first: tuple[bgars.Capture, bgars.SimulatedTruth], second: tuple[bgars.Capture, bgars.SimulatedTruth]) -> None:
    np.testing.assert_array_equal(first[0].images, second[0].images)
    for name in ("normals", "height_px", "ball_ids", "lit"):
        np.testing.assert_array_equal(getattr(first[1], name), getattr(second[1], name))
    assert first[1].balls == second[1].balls


@pytest.mark.parametrize("rig", [RIG, NEAR], ids=["far", "near"])
def test_threads_and_tiles_change_no_bit(rig: bgars.LightRig) -> None:
    reference = bgars.simulate(scene(), rig, MATERIAL, NOISY, seed=7, threads=1)
    for threads, tile_rows in ((2, None), (3, 1), (1, 7), (4, 50)):
        again = bgars.simulate(scene(), rig, MATERIAL, NOISY, seed=7, threads=threads, tile_rows=tile_rows)
        same(reference, again)


def test_another_seed_is_another_noise_on_the_same_truth() -> None:
    first = bgars.simulate(scene(), RIG, MATERIAL, NOISY, seed=7)
    second = bgars.simulate(scene(), RIG, MATERIAL, NOISY, seed=8)
    assert (first[0].images != second[0].images).mean() > 0.5
    np.testing.assert_array_equal(first[1].normals, second[1].normals)


def test_progress_ends_at_one_and_an_error_in_it_stops_the_work() -> None:
    seen: list[float] = []
    bgars.simulate(scene(), RIG, MATERIAL, NOISY, progress=seen.append, tile_rows=10)
    assert seen == sorted(seen)
    assert seen[-1] == 1.0

    def stop(_: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        bgars.simulate(scene(), RIG, MATERIAL, NOISY, progress=stop, tile_rows=1)


CAMERAS = {
    "12 bit, noise": NOISY,
    "8 bit, gamma": bgars.Camera(pixel_pitch_um=20.0, gamma=2.2, black_level=9.0),
    "table": bgars.Camera(
        pixel_pitch_um=20.0, response_table=((0.0, 0.0), (90.0, 0.1), (255.0, 1.0)), saturation=230.0
    ),
    "16 bit": bgars.Camera(pixel_pitch_um=23.7, bit_depth=16, shape=(90, 101)),
}


@pytest.mark.parametrize("rig", [RIG, NEAR], ids=["far", "near"])
@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS)
def test_round_trip_through_a_capture_folder(tmp_path: Path, rig: bgars.LightRig, camera: bgars.Camera) -> None:
    made, truth = bgars.simulate(scene(), rig, MATERIAL, camera, seed=3)
    files = bgars.write_simulation(made, truth, tmp_path / "part")
    assert set(files) == {path.name for path in (tmp_path / "part").iterdir()}
    read = bgars.read_capture(tmp_path / "part")
    np.testing.assert_array_equal(read.images, made.images)
    assert read.images.dtype == made.images.dtype
    for name in ("pixel_pitch_um", "black_level", "saturation", "full_scale"):
        assert getattr(read, name) == pytest.approx(getattr(made, name)), name
    if made.response is None:
        assert read.response is None
    else:
        np.testing.assert_allclose(read.response, made.response, atol=0.01)
    np.testing.assert_allclose(read.rig.directions, rig.directions, atol=1e-12)
    if rig.positions_um is not None:
        np.testing.assert_allclose(read.rig.positions_um, rig.positions_um)
    for light in range(len(rig)):
        ours, theirs = (
            r.intensities[light] * (1.0 if r.intensity_distance_um is None else r.intensity_distance_um[light] ** 2)
            for r in (rig, read.rig)
        )
        assert ours == pytest.approx(theirs)

    known = bgars.read_truth(tmp_path / "part")
    np.testing.assert_array_equal(known.normals, truth.normals)
    np.testing.assert_array_equal(known.ball_ids, truth.ball_ids)
    np.testing.assert_allclose(known.height_um, truth.height_um, rtol=1e-6)
    with np.load(tmp_path / "part" / "gt.npz") as arrays:
        for light in range(len(rig)):
            np.testing.assert_array_equal((arrays["lit"] >> light) & 1, truth.lit[light])

    setup = bgars.read_scene(tmp_path / "part" / "scene.json")
    same((made, truth), bgars.simulate(setup.scene, setup.rig, setup.material, setup.camera, seed=setup.seed))


def test_rigs_of_any_kind_come_back_to_the_bit(tmp_path: Path) -> None:
    rigs = [
        bgars.LightRig.from_angles(np.random.default_rng(0).uniform([0, 20], [360, 90], (9, 2))),
        bgars.LightRig.from_positions(NEAR.positions_um, intensity_distance_um=41_234.5),  # type: ignore[arg-type]
    ]
    for index, rig in enumerate(rigs):
        made, truth = bgars.simulate(bgars.Scene.ball(), rig, MATERIAL, bgars.Camera(bit_depth=16, pixel_pitch_um=30.0))
        bgars.write_simulation(made, truth, tmp_path / str(index))
        again = bgars.read_scene(tmp_path / str(index) / "scene.json")
        np.testing.assert_array_equal(again.rig.directions, rig.directions)
        same((made, truth), bgars.simulate(again.scene, again.rig, again.material, again.camera, seed=again.seed))


@pytest.mark.parametrize("rig", [RIG, NEAR], ids=["far", "near"])
@pytest.mark.parametrize("distance_mm", [math.inf, 151.5])
def test_what_is_known_of_lights_scale_and_camera_travels_along(
    tmp_path: Path, rig: bgars.LightRig, distance_mm: float
) -> None:
    u_deg = np.linspace(0.05, 0.1, len(rig))
    made, truth = bgars.simulate(bgars.Scene.ball(), rig.with_u_deg(u_deg), MATERIAL, bgars.Camera())
    told = replace(made, pixel_pitch_u_um=0.0123, camera_distance_mm=distance_mm)
    bgars.write_simulation(told, truth, tmp_path / "part")
    read = bgars.read_capture(tmp_path / "part")
    assert read.pixel_pitch_u_um == 0.0123
    assert read.camera_distance_mm == distance_mm
    np.testing.assert_array_equal(read.rig.u_deg, u_deg)
    np.testing.assert_array_equal(bgars.read_scene(tmp_path / "part" / "scene.json").rig.u_deg, u_deg)
    bgars.write_simulation(made, truth, tmp_path / "plain")
    plain = bgars.read_capture(tmp_path / "plain")
    assert plain.pixel_pitch_u_um is None
    assert plain.camera_distance_mm is None, "not stated"


def test_an_albedo_map_travels_along(tmp_path: Path) -> None:
    board = bgars.Board(albedo_map=np.random.default_rng(0).uniform(0.5, 1.5, (30, 40)))
    made = bgars.simulate(bgars.Scene.plane(board=board), RIG, MATERIAL, bgars.Camera(bit_depth=16, shape=(30, 40)))
    bgars.write_simulation(*made, tmp_path / "part")
    setup = bgars.read_scene(tmp_path / "part" / "scene.json")
    same(made, bgars.simulate(setup.scene, setup.rig, setup.material, setup.camera))


def test_truth_in_memory_and_from_the_folder_judge_alike(tmp_path: Path) -> None:
    made, truth = bgars.simulate(bgars.Scene.ball(), RIG, MATERIAL, bgars.Camera())
    bgars.write_simulation(made, truth, tmp_path / "part")
    in_memory = bgars.evaluate(made, truth=truth)
    from_folder = bgars.evaluate(bgars.read_capture(tmp_path / "part"))
    assert in_memory.normals == from_folder.normals
    assert in_memory.ball_height_rmse_um == pytest.approx(from_folder.ball_height_rmse_um, rel=1e-3)


def test_the_ball_table_is_a_csv_and_a_json(tmp_path: Path) -> None:
    made, truth = bgars.simulate(scene(), RIG, MATERIAL, bgars.Camera(pixel_pitch_um=20.0))
    bgars.write_simulation(made, truth, tmp_path)
    with (tmp_path / "balls.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["name"] for row in rows] == [ball.name for ball in truth.balls]
    assert rows[1]["x_um"] == ""
    assert float(rows[0]["top_um"]) == truth.balls[0].top_um
    values = json.loads((tmp_path / "truth.json").read_text(encoding="utf-8"))
    assert values["seating_coplanarity_um"] == truth.seating_coplanarity_um
    assert values["ball_table"][0]["aspect_ratio"] == 1.0


@pytest.mark.parametrize("name", sorted(set(bgars.named_recipes()) - {"array-10x10"}))
def test_named_recipes_are_judged_and_come_back(tmp_path: Path, name: str) -> None:
    setup = bgars.read_scene(name)
    camera = replace(setup.camera, supersample=1)
    made = bgars.simulate(setup.scene, setup.rig, setup.material, camera, seed=setup.seed)
    bgars.write_simulation(*made, tmp_path)
    errors = bgars.evaluate(bgars.read_capture(tmp_path), method="robust-filter").normals
    assert errors.median_deg < 2.0
    again = bgars.read_scene(tmp_path / "scene.json")
    same(made, bgars.simulate(again.scene, again.rig, again.material, again.camera, seed=again.seed))


def test_the_command_writes_what_it_says_and_repeats_itself(tmp_path: Path) -> None:
    run = bgars_command("simulate", "hemisphere", "-o", tmp_path / "part", "--json")
    assert run.returncode == 0, run.stderr
    assert run.stderr == "", "quiet in pipes"
    summary = json.loads(run.stdout)
    assert set(summary["files"]) == {path.name for path in (tmp_path / "part").iterdir()}
    again = bgars_command("simulate", tmp_path / "part" / "scene.json", "-o", tmp_path / "again")
    assert again.returncode == 0, again.stderr
    for path in (tmp_path / "part").iterdir():
        assert (tmp_path / "again" / path.name).read_bytes() == path.read_bytes(), path.name


def test_every_named_recipe_parses_and_help_lists_it() -> None:
    shown = " ".join(bgars_command("simulate", "--help").stdout.split())
    for name, description in bgars.named_recipes().items():
        assert description.endswith("."), name
        assert name in shown
        assert len(bgars.read_scene(name).scene.balls) >= 1


def test_an_own_recipe_and_another_seed(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(
        'seed = 4\n[scene]\nkind = "ball_array"\nrows = 2\ncols = 2\n[scene.defects]\nB2 = { kind = "missing" }\n'
        "[camera]\npixel_pitch_um = 25.0\nread_noise_levels = 2.0\n",
        encoding="utf-8",
    )
    assert bgars_command("simulate", tmp_path / "mine.toml", "-o", tmp_path / "a").returncode == 0
    run = bgars_command("--threads", "1", "simulate", tmp_path / "mine.toml", "-o", tmp_path / "b", "--seed", 5)
    assert run.returncode == 0
    assert "3 of 4 balls (B2 missing)" in run.stdout
    a, b = (bgars.read_capture(tmp_path / name).images for name in "ab")
    assert (a != b).any()
    assert json.loads((tmp_path / "b" / "scene.json").read_text(encoding="utf-8"))["seed"] == 5


def test_the_guide_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = (Path(__file__).parents[2] / "docs" / "simulator.md").read_text(encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    (code,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    exec(code, {})
    assert len(bgars.read_capture(tmp_path / "own_part").images) == 8
    assert not (tmp_path / "part").exists(), "the part that every page inspects is not replaced"
    (recipe,) = re.findall(r"```toml\n(.*?)```", text, re.DOTALL)
    (tmp_path / "recipe.toml").write_text(recipe, encoding="utf-8")
    assert len(bgars.read_scene(tmp_path / "recipe.toml").scene.balls) == 25


def test_a_failing_write_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made, truth = bgars.simulate(bgars.Scene.ball(), RIG, MATERIAL, bgars.Camera(pixel_pitch_um=30.0))

    def full_disk(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "savez_compressed", full_disk)
    with pytest.raises(bgars.FileFormatError, match="No space left"):
        bgars.write_simulation(made, truth, tmp_path / "part")
    assert list(tmp_path.iterdir()) == []


def test_numbers_of_numpy_are_numbers(tmp_path: Path) -> None:
    camera = bgars.Camera(pixel_pitch_um=np.float32(20.0), shape=(np.int64(40), np.int64(50)), supersample=np.int64(2))
    scene, rig, material = bgars.Scene.hemisphere(300.0), bgars.LightRig.ring(8), bgars.Material(i_d=np.float64(0.5))
    capture, truth = bgars.simulate(scene, rig, material, camera, seed=np.int64(3))
    bgars.write_simulation(capture, truth, tmp_path / "a")
    again = bgars.read_scene(tmp_path / "a" / "scene.json")
    images = bgars.simulate(again.scene, again.rig, again.material, again.camera, seed=again.seed)[0].images
    np.testing.assert_array_equal(images, capture.images)
