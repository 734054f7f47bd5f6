"""Rendered reality without a renderer: draws, the camera, what is written, and the figures of the judge."""

from __future__ import annotations

import csv
import hashlib
import json
import sys
from dataclasses import asdict, replace
from pathlib import Path

import bgars
import imageio.v3 as iio
import numpy as np
import pytest
from bgars.io.part_recipe import read_part_recipe

BENCHES = Path(__file__).parents[2] / "benches" / "reality"
sys.path[:0] = [str(BENCHES), str(Path(__file__).parents[2] / "docs")]
import judge  # noqa: E402
import llvm  # noqa: E402
from balls import BallTruth, place_balls  # noqa: E402
from camera import shifted, srgb  # noqa: E402
from deviations import DEVIATIONS  # noqa: E402
from draw import draw  # noqa: E402
from figures import criteria, summarise  # noqa: E402
from lamps import lamp_centroids, lamp_directions  # noqa: E402
from make_reality import END, START, page_with  # noqa: E402
from make_scenes import seeds_of  # noqa: E402
from records import BallRecord, NormalsRecord, Reading, SceneRecord, from_json, to_json  # noqa: E402
from rendered import Rendered  # noqa: E402
from setup_records import Setup  # noqa: E402
from tables import page_lines  # noqa: E402
from write import part_limits_um, write_scene  # noqa: E402

SEEDS = range(1, 401)
PLAIN_SEED = 3


def test_a_seed_is_the_same_part_for_ever() -> None:
    described = [json.dumps(asdict(draw(seed)), sort_keys=True) for seed in SEEDS]
    assert hashlib.sha256("\n".join(described).encode()).hexdigest() == (
        "dd21f7727e7282e5285fe6ea3288779acbee9ecf1bb43b6a683cd5cfa74d6dcd"
    )


def test_every_deviation_is_drawn_and_changes_the_part() -> None:
    drawn = {name for seed in SEEDS for name in draw(seed).deviations}
    assert drawn == set(DEVIATIONS)
    assert len(DEVIATIONS) == 37
    assert all(one.meaning for one in DEVIATIONS.values())


def test_parts_fit_their_images_and_name_their_balls() -> None:
    for seed in SEEDS:
        setup = draw(seed)
        half = setup.view.pixel_mm * setup.view.width / 2, setup.view.pixel_mm * setup.view.height / 2
        for ball in place_balls(setup):
            assert abs(ball.x_mm) + ball.radius_mm < half[0]
            assert abs(ball.y_mm) + ball.radius_mm < half[1]
        names = set(setup.part.ball_names())
        assert names >= {*setup.part.defects, *setup.part.depopulated}
        assert not {*setup.part.defects} & {*setup.part.depopulated}
        assert all(lamp < setup.rig.count for lamp in setup.camera.shifts_px)


def small_part() -> tuple[Setup, Rendered]:
    """A part of coarse pixels, and a stand-in for its radiance: Lambert's balls on a grey board, without shadows."""
    setup = draw(PLAIN_SEED)
    setup.view = replace(setup.view, pixel_mm=4 * setup.view.pixel_mm)
    setup.view.width, setup.view.height = setup.view.width // 4, setup.view.height // 4
    row, col = np.mgrid[0 : setup.view.height, 0 : setup.view.width]
    x_mm = (col + 0.5 - setup.view.width / 2) * setup.view.pixel_mm
    y_mm = (setup.view.height / 2 - row - 0.5) * setup.view.pixel_mm
    z_mm, normals, number = np.zeros(x_mm.shape), np.zeros((*x_mm.shape, 3)), np.zeros(x_mm.shape, np.int16)
    normals[..., 2] = 1.0
    balls = place_balls(setup)
    for ball in balls:
        inside = (x_mm - ball.x_mm) ** 2 + (y_mm - ball.y_mm) ** 2 < ball.radius_mm**2
        off = np.stack([x_mm[inside] - ball.x_mm, y_mm[inside] - ball.y_mm], -1) / ball.radius_mm
        up = np.sqrt(1.0 - (off**2).sum(-1))
        normals[inside] = np.column_stack([off, up])
        z_mm[inside], number[inside] = ball.centre_z_mm + ball.radius_mm * up, ball.number
    nominal, true = lamp_directions(setup)
    radiance = np.maximum(np.einsum("rci,li->lrc", normals, true), 0.0) * np.where(number > 0, 0.1, 0.04)
    truths = [
        BallTruth(ball, ball.centre_z_mm + ball.radius_mm, ball.x_mm, ball.y_mm, 2 * ball.radius_mm) for ball in balls
    ]
    maps = normals.astype(np.float32), z_mm.astype(np.float32), number, number < 0
    return setup, Rendered(radiance.astype(np.float32), *maps, nominal, true, truths)


def test_a_scene_is_written_twice_alike(tmp_path: Path) -> None:
    for name in ("one", "other"):
        write_scene(*small_part(), tmp_path / name)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["one", "other"]
    names = sorted(path.name for path in (tmp_path / "one").iterdir())
    assert {"capture.toml", "part.toml", "balls.csv", "scene.json", "gt.npz", "dark.png", "light_07.png"} <= {*names}
    for name in names:
        if name != "gt.npz":
            assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "other" / name).read_bytes(), name


def test_a_scene_reads_as_a_capture_and_its_truth_agrees(tmp_path: Path) -> None:
    setup, rendered = small_part()
    write_scene(setup, rendered, tmp_path / "3")
    capture = bgars.read_capture(tmp_path / "3")
    assert capture.pixel_pitch_um == pytest.approx(1000 * setup.view.pixel_mm, rel=1e-5)
    np.testing.assert_allclose(capture.rig.directions, rendered.nominal, atol=1e-6)
    recipe = read_part_recipe(tmp_path / "3" / "part.toml")
    assert recipe.limits.diameter_um == pytest.approx(part_limits_um(setup.part)["diameter_um"], abs=0.05)
    with (tmp_path / "3" / "balls.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["name"] for row in rows] == [truth.ball.name for truth in rendered.balls]
    scene = json.loads((tmp_path / "3" / "scene.json").read_text(encoding="utf-8"))
    assert scene["true_light_directions"] == lamp_centroids(setup, rendered.true).tolist()
    deviations = scene["coplanarity"]["seating_dev_mm"]
    assert min(deviations.values()) == pytest.approx(0.0, abs=1e-6)
    assert sum(value < 1e-5 for value in deviations.values()) >= 3


def test_levels_and_faults_are_those_that_were_drawn(tmp_path: Path) -> None:
    setup, rendered = small_part()
    write_scene(setup, rendered, tmp_path / "plain")
    setup.camera.raised_deg, setup.camera.ambient_levels, setup.camera.dark_frame = 1.5, 20.0, False
    write_scene(setup, rendered, tmp_path / "faulty")
    nominal, raised = (np.loadtxt(tmp_path / name / "light_directions.txt") for name in ("plain", "faulty"))
    np.testing.assert_allclose(np.degrees(np.arcsin(raised[:, 2]) - np.arcsin(nominal[:, 2])), 1.5, atol=1e-5)
    board = rendered.ball == 0
    plain, faulty, dark = (
        float(np.median(iio.imread(tmp_path / name)[board]))
        for name in ("plain/light_00.png", "faulty/light_00.png", "faulty/dark.png")
    )
    assert faulty - plain == pytest.approx(20.0, abs=1.0)
    assert dark == pytest.approx(0.006 * 255, abs=1.0)
    assert "dark" not in (tmp_path / "faulty" / "capture.toml").read_text(encoding="utf-8")


def test_a_scene_that_exists_is_not_overwritten_and_nothing_is_left_behind(tmp_path: Path) -> None:
    write_scene(*small_part(), tmp_path / "3")
    with pytest.raises(OSError, match="3"):
        write_scene(*small_part(), tmp_path / "3")
    assert [path.name for path in tmp_path.iterdir()] == ["3"]


def test_the_transfer_function_is_srgb() -> None:
    levels = srgb(np.array([0.0, 0.002, 0.2140411, 1.0]))
    np.testing.assert_allclose(levels, [0.0, 0.02584, 0.5, 1.0], atol=1e-6)


def test_images_are_shifted_to_the_right_and_up() -> None:
    pytest.importorskip("cv2")
    image = np.zeros((9, 9))
    image[4, 4] = 1.0
    assert np.unravel_index(shifted(image, (2.0, 1.0)).argmax(), image.shape) == (3, 6)


def test_llvm_15_is_never_taken() -> None:
    names = "libLLVM-14.so.1 libLLVM-15.so libLLVM.so.19.1 libLLVM-16.so.1 libLLVMSupport.so libLLVM.so"
    paths = [Path("/usr/lib") / name for name in names.split()]
    assert llvm.newest_llvm(paths) == Path("/usr/lib/libLLVM.so.19.1")
    assert llvm.newest_llvm(paths[:2]) is None


def test_without_llvm_nothing_is_rendered_and_the_reason_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
    monkeypatch.setattr(llvm, "PLACES", ())
    with pytest.raises(RuntimeError, match="apt-get install libllvm16"):
        llvm.start_mitsuba()


def test_seeds_are_single_or_ranges() -> None:
    assert seeds_of(["7", "10-12"]) == [7, 10, 11, 12]


def ball(error_um: float, u_um: float | None = 1.0, *, bad: bool = False, verdict: str = "pass") -> BallRecord:
    readings = {name: Reading(error_um, u_um) for name in ("x", "y", "diameter", "top")}
    return BallRecord("A1", "none", bad, present=True, verdict=verdict, readings=readings)


LOST = BallRecord("A2", "none", bad=False, present=False, verdict="fail")
JUDGED = SceneRecord(
    "1",
    (),
    10.0,
    verdict="pass",
    balls=(ball(0.5), ball(-1.5), ball(3.0, verdict="undecided"), ball(0.1, None), LOST),
    coplanarity=Reading(-1.0, 2.0),
    normals={"lambertian": NormalsRecord(9.0), "reflectance": NormalsRecord(1.0, 0.5, 0.68, 0.95)},
    seconds=0.5,
)
REFUSED = SceneRecord("2", ("metal",), 10.0, refused="InputError: too dark")


def test_figures_are_counted_over_the_balls_that_are_there() -> None:
    figures = summarise([JUDGED, REFUSED])
    assert (figures.scenes, figures.plain, figures.refused, figures.balls) == (2, 1, ("2",), 5)
    assert (figures.found, figures.undecided, figures.wrong_fails) == (80.0, 20.0, 1)
    assert figures.coverage["top"] == pytest.approx((100 / 3, 200 / 3))
    assert figures.coverage["coplanarity"] == (100.0, 100.0)
    assert figures.top_error_px[0] == pytest.approx(0.1)
    assert figures.u_top_px == pytest.approx(0.1)
    assert figures.default_worse == ()


def test_what_must_never_be_is_named() -> None:
    passed = replace(JUDGED, balls=(ball(0.5, bad=True),), part_bad=True, invented=("Z9",))
    crashed = replace(REFUSED, scene="3", refused=None, crashed="PanicException: index out of bounds")
    short = {row.name for row in criteria(summarise([passed, crashed])) if not row.met}
    assert short >= {"bad balls passed", "bad parts passed", "balls invented"}
    assert "captures that raise anything but a refusal" in short
    assert "bad balls passed" not in {row.name for row in criteria(summarise([JUDGED])) if not row.met}


def test_nothing_measured_meets_no_bar() -> None:
    met = {row.name: row.met for row in criteria(summarise([REFUSED]))}
    assert not met["top within u / 2u"]
    assert not met["balls found"]
    assert not met["error of tops: median"]


def test_tables_name_deviations_and_reasons() -> None:
    page = "\n".join(page_lines([JUDGED, REFUSED]))
    assert "| metal | Bare metal, exposed for its highlights | 1 | 1 | - |" in page
    assert "| 2 | metal | InputError: too dark |" in page
    assert "nan" not in page


def test_the_table_goes_between_its_marks() -> None:
    page = f"before\n{START}\nold\n{END}\nafter\n"
    assert page_with(["new"], page) == f"before\n{START}\n\nnew\n\n{END}\nafter\n"
    with pytest.raises(ValueError, match="must hold"):
        page_with(["new"], "no marks")
    real = (Path(__file__).parents[2] / "docs" / "accuracy.md").read_text(encoding="utf-8")
    assert "| wanted | measured |" in page_with(page_lines([JUDGED]), real)


def test_records_come_back_from_their_files() -> None:
    for record in (JUDGED, REFUSED):
        assert from_json(to_json(record, "as it was"), "as it was") == record
        assert from_json(to_json(record, "as it was"), "changed") is None


def test_a_kept_record_counts_until_the_scene_changes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene, seen = tmp_path / "scenes" / "1", []
    scene.mkdir(parents=True)
    (scene / "scene.json").write_text("{}", encoding="utf-8")

    def judged(folder: Path, *, normals: bool) -> SceneRecord:
        seen.append((folder.name, normals))
        return JUDGED

    monkeypatch.setattr(judge, "judge_scene", judged)
    found = judge.scenes_in(tmp_path / "scenes")
    for _ in range(2):
        assert list(judge.judge_set(found, keep=tmp_path / "judged")) == [JUDGED]
    assert seen == [("1", True)]
    (scene / "scene.json").write_text('{"other": 1}', encoding="utf-8")
    assert list(judge.judge_set(found, keep=tmp_path / "judged")) == [JUDGED]
    assert len(seen) == 2
    with pytest.raises(FileNotFoundError, match="named 9"):
        judge.scenes_in(tmp_path / "scenes", ["9"])


def test_whatever_a_capture_raises_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_scene(*small_part(), tmp_path / "3")
    for error, kind in ((bgars.InputError("no"), "refused"), (ZeroDivisionError("no"), "crashed")):

        def raising(*_: object, error: Exception = error) -> None:
            raise error

        monkeypatch.setattr(bgars, "inspect", raising)
        record = judge.judge_scene(tmp_path / "3", normals=False)
        assert getattr(record, kind) == f"{type(error).__name__}: no"
        assert not record.judged
