"""Impossible scenes, materials, rigs, cameras and recipes: one message that names field, rule and value."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import bgars
import numpy as np
import pytest
from bgars.pipelines.scene_recipes import schema
from test_cli import bgars_command

RIG = bgars.LightRig.ring(4)
CAMERA = bgars.Camera(pixel_pitch_um=50.0)
FLAT = bgars.LightRig.from_directions([[0.6, 0, 0.8], [-0.6, 0, 0.8], [0.8, 0, -0.6]])
ARRAY = bgars.Scene.ball_array
NAN = float("nan")


def run(scene: bgars.Scene | None = None, rig: bgars.LightRig = RIG, **options: Any) -> None:  # noqa: ANN401
    bgars.simulate(scene or bgars.Scene.ball(), rig, bgars.Material(), CAMERA, **options)


BALL = bgars.Ball(0, 0, 300, 200, name="A")

CASES: list[tuple[Callable[[], object], list[str]]] = [
    (lambda: run(rig=RIG.directions), ["rig: must be a bgars.LightRig, got ndarray"]),  # type: ignore[arg-type]
    (lambda: run("one-ball"), ["scene: must be a bgars.Scene, got str"]),  # type: ignore[arg-type]
    # Scenes
    (lambda: ARRAY(2, 2, pitch_um=599.0), ["scene.balls", "A1 and A2 overlap", "without a bridge", "600", "599"]),
    (lambda: ARRAY(1, 3, pitch_um=550.0, bridges=[bgars.Bridge("A1", "A2")]), ["A2 and A3 overlap", "550"]),
    (lambda: ARRAY(1, 2, height_um=601.0), ["ball A1: centre_z_um", "300", "floats", "301"]),
    (lambda: ARRAY(1, 2, height_um=-5.0), ["scene.height_um", "above 0", "-5"]),
    (lambda: bgars.Ball(0, 0, radius_um=300, centre_z_um=-300), ["centre_z_um", "above the board", "0"]),
    (lambda: bgars.Ball(0, 0, radius_um=0, centre_z_um=0), ["ball A1: radius_um", "above 0", "0"]),
    (lambda: bgars.Ball(NAN, 0, radius_um=1, centre_z_um=0), ["x_um", "finite", "nan"]),
    (lambda: bgars.Ball(0, 0, radius_um=9, centre_z_um=9, aspect_ratio=0.5), ["centre_z_um", "4.5", "9"]),
    (lambda: bgars.Ball(0, 0, radius_um=9, centre_z_um=0, aspect_ratio=-1), ["aspect_ratio", "above 0", "-1"]),
    (
        lambda: bgars.Ball(0, 0, radius_um=9, centre_z_um=5, flat_top_depth_um=9),
        ["flat_top_depth_um", "below 9", "equator", "9"],
    ),
    (lambda: bgars.Scene((bgars.Scene.ball().balls[0],) * 2), ["scene.balls", "different names", "A1"]),
    (lambda: ARRAY(0, 3), ["scene.rows", "1 or more", "0"]),
    (lambda: ARRAY(2, 2.5), ["scene.cols", "whole number", "2.5"]),  # type: ignore[arg-type]
    (lambda: ARRAY(2, 2, defects={"C1": bgars.Defect.missing()}), ["scene.defects", "2 x 2 array", "'C1'"]),
    (lambda: ARRAY(2, 2, defects={"A1": bgars.Defect.flattened(0.3)}), ["ball A1", "above the ball's centre", "-50"]),
    (lambda: ARRAY(2, 2, defects={"A1": bgars.Defect.offset(500, 0)}), ["A1 and A2 overlap", "500"]),
    (lambda: ARRAY(2, 2, defects={"A1": bgars.Defect.clipped(300)}), ["flat_top_depth_um", "equator", "300"]),
    (lambda: ARRAY(2, 2, seed=-1), ["scene.seed", "0 or more", "-1"]),
    (lambda: bgars.Defect.size(0.0), ["defect.scale", "above 0", "0"]),
    (lambda: bgars.Defect("melted"), ["defect.kind", "'missing'", "'melted'"]),  # type: ignore[arg-type]
    (lambda: bgars.Jitter(height_um=-1.0), ["jitter.height_um", "0 or more", "-1"]),
    (lambda: ARRAY(1, 2, bridges=[bgars.Bridge("A1", "B9")]), ["bridge A1-B9", "present", "'B9'"]),
    (
        lambda: ARRAY(1, 2, defects={"A2": bgars.Defect.missing()}, bridges=[bgars.Bridge("A1", "A2")]),
        ["bridge A1-A2", "present", "'A2'"],
    ),
    (lambda: bgars.Bridge("A1", "A1"), ["bridge", "different balls", "A1"]),
    (lambda: bgars.Bridge("A1", "A2", radius_um=-3), ["bridge.radius_um", "above 0", "-3"]),
    (
        lambda: ARRAY(1, 2, bridges=[bgars.Bridge("A1", "A2", 250.0, 400.0)]),
        ["radius_um", "inside ball A1", "100", "250"],
    ),
    (lambda: bgars.Scene.plane(size_um=(0.0, 5.0)), ["scene.size_um[0]", "above 0", "0"]),
    # Boards
    (lambda: bgars.Board(tilt_x_deg=40.0), ["board.tilt_x_deg", "30", "40"]),
    (lambda: bgars.Board(bow_radius_um=0.0), ["board.bow_radius_um", "above 0"]),
    (lambda: bgars.Board(albedo_map=np.full((2, 2), -1.0)), ["board.albedo_map", "0 or more", "-1"]),
    (lambda: bgars.Board(albedo_map=np.full((2, 2), NAN)), ["board.albedo_map", "0 or more", "nan"]),
    (lambda: bgars.Board(albedo_map=np.ones((2, 2)), texture=bgars.Texture()), ["albedo_map", "texture"]),
    (
        lambda: run(bgars.Scene.plane(board=bgars.Board(albedo_map=np.ones((2, 2))))),
        ["albedo_map", "(40, 40)", "(2, 2)"],
    ),
    (lambda: bgars.Texture(contrast=1.5), ["texture.contrast", "[0, 1]", "1.5"]),
    # Materials
    (lambda: bgars.Material(i_d=-0.1), ["material.i_d", "[0, 1]", "-0.1"]),
    (lambda: bgars.Material(i_d=1.1), ["material.i_d", "[0, 1]", "1.1"]),
    (lambda: bgars.Material(i_s=-1), ["material.i_s", "0 or more", "-1"]),
    (lambda: bgars.Material(hardness=0.0), ["material.hardness", "above 0", "0"]),
    (lambda: bgars.Material(roughness=3.0), ["material.roughness", "2 or less", "3"]),
    (lambda: bgars.Material(hardness=40, roughness=0.2), ["material.roughness", "hardness", "0.2"]),
    (lambda: bgars.Material(distribution="phong"), ["material.distribution", "'ggx'", "'phong'"]),  # type: ignore[arg-type]
    (lambda: bgars.Material(masking="x"), ["material.masking", "'smith'", "'x'"]),  # type: ignore[arg-type]
    (lambda: bgars.Material(fresnel="x"), ["material.fresnel", "'schlick'", "'x'"]),  # type: ignore[arg-type]
    (lambda: bgars.Material(f0=0.0), ["material.f0", "above 0", "0"]),
    (lambda: bgars.Lobe(0.1, 0.0), ["material.roughness", "above 0", "0"]),
    (lambda: bgars.Variation(i_d=0.5), ["variation.i_d", "0.3 or less", "0.5"]),
    # Cameras
    (lambda: bgars.Camera(pixel_pitch_um=-1.0), ["camera.pixel_pitch_um", "above 0", "-1"]),
    (lambda: bgars.Camera(shape=(0, 5)), ["camera.shape", "1 or more", "got 0"]),
    (lambda: bgars.Camera(bit_depth=9), ["camera.bit_depth", "8, 10, 12, 16", "9"]),  # type: ignore[arg-type]
    (lambda: bgars.Camera(gain=0.0), ["camera.gain", "above 0"]),
    (lambda: bgars.Camera(full_well_e=0.0), ["camera.full_well_e", "10 or more", "0"]),
    (lambda: bgars.Camera(read_noise_levels=-1.0), ["camera.read_noise_levels", "0 or more"]),
    (lambda: bgars.Camera(gamma=NAN), ["camera.gamma", "finite", "nan"]),
    (lambda: bgars.Camera(black_level=255.0), ["camera.black_level", "saturation (255)", "255"]),
    (lambda: bgars.Camera(saturation=300.0), ["camera.saturation", "255 or less", "300"]),
    (lambda: bgars.Camera(supersample=0), ["camera.supersample", "1 to 32", "0"]),
    (lambda: bgars.Camera(blur_px=99.0), ["camera.blur_px", "10 or less", "99"]),
    (lambda: bgars.Camera(response_table=((0.0, 0.0), (255.0, 0.0))), ["camera.response_table", "grow"]),
    (lambda: bgars.Camera(response_table=((0.0, 0.0), (99.0, 1.0))), ["response_table", "0 to 255", "0 to 99"]),
    (
        lambda: bgars.Camera(response_table=((0.0, 0.0), (255.0, 1.0)), gamma=2.0),
        ["camera.gamma", "response_table", "2"],
    ),
    (lambda: bgars.Camera(pixel_pitch_um=0.01).framed((2000.0, 2000.0)), ["camera.shape", "256 megapixels", "40000"]),
    # Lights
    (lambda: run(rig=FLAT), ["rig.directions[2]", "above the board", "-0.6"]),
    (
        lambda: run(bgars.Scene.ball(board=bgars.Board(tilt_x_deg=30.0)), bgars.LightRig.ring(4, elevation_deg=20.0)),
        ["rig.directions[0]", "upper side", "-0.17"],
    ),
    (
        lambda: run(rig=bgars.LightRig.from_positions([[9e3, 0, 400], [0, 9e3, 900], [-9e3, 0, 900]])),
        ["rig.positions_um[0]", "highest ball (500 um)", "400"],
    ),
    # Arguments
    (lambda: run(seed=-1), ["seed", "0 to", "-1"]),
    (lambda: run(seed=1.5), ["seed", "whole number", "1.5"]),
    (lambda: run(seed="1"), ["seed", "whole number", "'1'"]),
    (lambda: run(threads=1.5), ["threads", "whole number", "1.5"]),
    (lambda: bgars.Camera(shape=5), ["camera.shape", "two whole numbers", "5"]),  # type: ignore[arg-type]
    (lambda: bgars.Camera(gain="1"), ["camera.gain", "finite number", "'1'"]),  # type: ignore[arg-type]
    (lambda: bgars.Camera(full_well_e=1e30), ["camera.full_well_e", "1e+15", "1e+30"]),
    (
        lambda: bgars.Scene((BALL, replace(BALL, name="B")), (bgars.Bridge("A", "B", 100),)),
        ["bridge A-B", "different places"],
    ),
    (lambda: run(threads=0), ["threads", "1 or more", "0"]),
    (lambda: run(tile_rows=0), ["tile_rows", "1 or more", "0"]),
]


@pytest.mark.parametrize(
    ("call", "words"), CASES, ids=[f"{index:02d} {words[0]}" for index, (_, words) in enumerate(CASES)]
)
def test_refused(call: Callable[[], object], words: list[str]) -> None:
    with pytest.raises(bgars.InputError, match=".*".join(re.escape(word) for word in words)):
        call()


def test_bridged_balls_may_overlap() -> None:
    scene = ARRAY(1, 2, pitch_um=550.0, bridges=[bgars.Bridge("A1", "A2")])
    assert [ball.defect for ball in scene.balls] == ["bridged", "bridged"]
    _, truth = bgars.simulate(scene, RIG, bgars.Material(), CAMERA)
    assert {1, 2} <= set(np.unique(truth.ball_ids))


def test_a_missing_ball_takes_no_room() -> None:
    assert len(ARRAY(1, 3, pitch_um=400.0, defects={"A2": bgars.Defect.missing()}).balls) == 3


RECIPES = [
    ("", ["recipe.toml", "scene", "required"]),
    ('[scene]\nkind = "cube"\n', ["scene", "'ball_array'", "kind"]),
    ('[scene]\nkind = "ball_array"\nrows = 2\ncols = 2\npich_um = 9\n', ["unknown key 'scene.pich_um'", "'pitch_um'"]),
    ('[scene]\nkind = "ball_array"\nrows = 2\n', ["scene.cols", "required"]),
    ('[scene]\nkind = "ball"\n[material]\ni_d = "x"\n', ["material.i_d", "number", "'x'"]),
    ('[scene]\nkind = "ball"\n[material]\ni_d = -1.0\n', ["recipe.toml", "material.i_d", "[0, 1]", "-1"]),
    ('[scene]\nkind = "ball"\nheight_um = 900.0\n', ["recipe.toml", "centre_z_um", "floats", "600"]),
    ('[scene]\nkind = "ball"\nboard = { i_d = 0.1, material = {} }\n', ["scene.board", "one of i_d and material"]),
    ('[scene]\nkind = "ball"\nboard = { albedo_map = "no.npy" }\n', ["no.npy", "albedo"]),
    ('[scene]\nkind = "ball"\nboard = { textur = {} }\n', ["unknown key 'scene.board.textur'", "'texture'"]),
    (
        '[scene]\nkind = "ball"\n[rig]\nring = {}\ndirections = [[0, 0, 1]]\n',
        ["rig", "exactly one", "ring and directions"],
    ),
    ('[scene]\nkind = "ball"\n[rig]\nring = { count = 2 }\n', ["count", "3", "2"]),
    ('[scene]\nkind = "ball"\n[rig]\nintensity_distance_um = 2.0\n', ["rig.intensity_distance_um", "positions_um"]),
    (
        '[scene]\nkind = "ball"\n[rig]\npositions_um = [[1, 0, 9], [0, 1, 9], [1, 1, 9]]\n'
        "intensity_distance_um = [1]\n",
        ["rig.intensity_distance_um", "3 lengths", "[1"],
    ),
    ('[scene]\nkind = "ball"\n[material]\nsecond_lobe = { i_s = 0.1 }\n', ["second_lobe", "exactly one of hardness"]),
    (
        '[scene]\nkind = "ball_array"\nrows = 1\ncols = 1\ndefects = { A1 = { kind = "x" } }\n',
        ["scene.defects.A1.kind", "'x'"],
    ),
    (
        '[scene]\nkind = "ball_array"\nrows = 1\ncols = 1\ndefects = { A1 = { kynd = "x" } }\n',
        ["scene.defects.A1.kynd"],
    ),
    ("[scene\n", ["recipe.toml", "not valid TOML"]),
]


@pytest.mark.parametrize(("text", "words"), RECIPES)
def test_recipes(tmp_path: Path, text: str, words: list[str]) -> None:
    path = tmp_path / "recipe.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(bgars.BgarsError) as caught:
        bgars.read_scene(path)
    message = str(caught.value)
    assert "\n" not in message
    for word in words:
        assert word in message, message


@pytest.mark.parametrize(
    ("recipe", "words"),
    [
        ("nonsense", ["nonsense", "one-ball"]),
        ("gone.toml", ["gone.toml", "cannot be read"]),
        ("bad.json", ["bad.json"]),
    ],
)
def test_the_command_refuses_with_exit_code_2_and_leaves_nothing(tmp_path: Path, recipe: str, words: list[str]) -> None:
    (tmp_path / "bad.json").write_text("[1]", encoding="utf-8")
    run = bgars_command("simulate", recipe, "-o", "out", cwd=tmp_path)
    assert run.returncode == 2
    assert all(word in run.stderr for word in words), run.stderr
    assert "Traceback" not in run.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["bad.json"]


@pytest.mark.parametrize(
    ("record", "model"),
    [
        (bgars.Material, schema.MaterialRecipe),
        (bgars.Camera, schema.CameraRecipe),
        (bgars.Board, schema.BoardRecipe),
        (bgars.Ball, schema.OneBallRecipe),
        (bgars.Bridge, schema.BridgeRecipe),
        (bgars.Defect, schema.DefectRecipe),
        (bgars.Jitter, schema.JitterRecipe),
        (bgars.Texture, schema.TextureRecipe),
        (bgars.Variation, schema.VariationRecipe),
        (bgars.Lobe, schema.LobeRecipe),
    ],
)
def test_a_recipe_knows_every_field_of_its_record(record: type, model: type) -> None:
    names = {field.name for field in fields(record)}
    keys = set(model.model_fields)  # type: ignore[attr-defined]
    assert keys - names <= {"i_d", "hardness"}, "short forms only"
    assert names <= keys
    nested = {"material", "texture", "variation", "height", "width"}
    for field in fields(record):
        default = model.model_fields[field.name].default  # type: ignore[attr-defined]
        if isinstance(field.default, (int, float, str, type(None))) and field.name not in nested:
            assert default == field.default, field.name
