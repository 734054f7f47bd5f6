"""Checks of captures: each fault found and named, good captures silent, commands that stop before a number."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import bgars
import imageio.v3 as iio
import numpy as np
import pytest
from bgars.checks.evidence import critical_t, paired_t
from bgars.checks.hypotheses import alternatives
from bgars.line.job import Job, run_job
from bgars.normals.noise_floor import without_background
from bgars.pipelines.check import checked_beside
from bgars.records.plain_arrays import every_pixel
from bgars.surface.flatten import find_bow, flattened
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter


@pytest.fixture(scope="module")
def relief() -> bgars.Capture:
    """A matt relief with texture and noise under a ring of eight lights."""
    random = np.random.default_rng(3)
    y, x = np.mgrid[:200, :240].astype(np.float64)
    p = 0.5 * np.cos(x / 11.0) * np.cos(y / 17.0) + 0.2 * np.cos((x + y) / 8.0)
    q = 0.5 * 11.0 / 17.0 * np.sin(x / 11.0) * np.sin(y / 17.0) - 0.2 * np.cos((x + y) / 8.0)
    normal = np.stack([-p, -q, np.ones_like(p)]) / np.sqrt(1.0 + p**2 + q**2)
    rig = bgars.LightRig.ring(8, elevation_deg=50.0)
    texture = 0.55 + 0.12 * np.sin(x / 2.3) * np.cos(y / 3.1)
    light = np.maximum(np.tensordot(rig.directions, normal, axes=(1, 0)), 0.0) * texture
    images = np.clip(np.rint(255.0 * light + random.normal(0.0, 0.8, light.shape)), 0, 255).astype(np.uint8)
    return bgars.Capture(images, rig, every_pixel((200, 240)), saturation=255.0)


@pytest.fixture(scope="module")
def balls() -> bgars.Capture:
    """Shiny balls on a textured board."""
    board = bgars.Board(texture=bgars.Texture(contrast=0.3, scale_um=150.0))
    scene = bgars.Scene.ball_array(3, 3, board=board)
    camera = bgars.Camera(full_well_e=15000.0, read_noise_levels=0.5, blur_px=0.7)
    rig = bgars.LightRig.ring(8, elevation_deg=45.0)
    return bgars.simulate(scene, rig, bgars.Material(i_d=0.3, i_s=0.5, hardness=25), camera, seed=2)[0]


def with_lights(capture: bgars.Capture, directions: NDArray[np.float64]) -> bgars.Capture:
    return replace(capture, rig=bgars.LightRig.from_directions(directions))


def kinds(capture: bgars.Capture) -> list[str]:
    return [finding.kind for finding in bgars.check(capture).told]


def test_good_captures_are_silent(relief: bgars.Capture, balls: bgars.Capture) -> None:
    assert kinds(relief) == []
    assert kinds(balls) == []
    assert repr(bgars.check(relief)) == "Findings(nothing found)"


@pytest.mark.parametrize("name", ["relief", "balls"])
@pytest.mark.parametrize(
    ("change", "kind"),
    [
        (lambda lights: lights * [1, -1, 1], "handedness"),
        (lambda lights: lights * [-1, 1, 1], "handedness"),
        (lambda lights: np.roll(lights, 1, axis=0), "order"),
        (lambda lights: lights[[3, 1, 2, 0, 4, 5, 6, 7]], "order"),
        (lambda lights: lights * [1, 1, -1], "below-surface"),
    ],
    ids=["y down", "x mirrored", "shifted", "swapped", "z negative"],
)
def test_wrong_tables_are_named(name: str, change: object, kind: str, request: pytest.FixtureRequest) -> None:
    capture: bgars.Capture = request.getfixturevalue(name)
    findings = bgars.check(with_lights(capture, change(capture.rig.directions)))  # type: ignore[operator]
    assert [each.kind for each in findings.geometry_errors] == [kind]


def test_cast_shadows_tell_a_half_turn(balls: bgars.Capture) -> None:
    assert kinds(with_lights(balls, balls.rig.directions * [-1, -1, 1])) == ["order"]


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_any_order_of_the_images_is_found(seed: int, relief: bgars.Capture) -> None:
    order = np.random.default_rng(seed).permutation(8)
    told = bgars.check(replace(relief, images=relief.images[order])).told
    assert [each.kind for each in told] == ["order"]
    # Image `i` shows light `order[i]`: the table fits the images in the order that undoes it, or, where nothing casts a
    # shadow, in that after half a turn.
    undone = np.argsort(order)
    fitting = [", ".join(f"image {index}" for index in each) for each in (undone, np.roll(undone, 4))]
    assert any(each in told[0].message for each in fitting)


def test_one_line_of_the_table_with_a_wrong_sign(relief: bgars.Capture) -> None:
    lights = relief.rig.directions.copy()
    lights[1] *= [1, -1, 1]
    told = bgars.check(with_lights(relief, lights)).told
    assert told[0].image is None
    assert "image 1 shows its light on the other side in y" in told[0].message


def test_of_a_capture_that_is_clipped_nothing_else_is_said(balls: bgars.Capture) -> None:
    bright = np.clip(balls.images * 30.0, 0, 255).astype(np.uint8)
    assert kinds(with_lights(replace(balls, images=bright), balls.rig.directions * [1, -1, 1])) == ["clipped"]


def spoilt(capture: bgars.Capture, index: int, change: object) -> bgars.Capture:
    levels = capture.images.astype(np.float64)
    levels[index] = change(levels)  # type: ignore[operator]
    return replace(capture, images=np.clip(np.rint(levels), 0, 255).astype(np.uint8))


def moved(levels: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.roll(levels[5], 1, axis=1)


def rows_of_the_next(levels: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.concatenate([levels[5, :90], levels[6, 90:]])


def rows_dark(levels: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.concatenate([levels[5, :90], 0.6 * levels[5, 90:]])


def test_a_frame_lit_in_part_is_seen_through_cast_shadows(balls: bgars.Capture) -> None:
    def half_dark(levels: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.concatenate([levels[5, :120], 0.3 * levels[5, 120:]])

    told = bgars.check(spoilt(balls, 5, half_dark)).told
    assert told[0].kind == "half-lit"
    assert told[0].image == 5


def noisy(levels: NDArray[np.float64]) -> NDArray[np.float64]:
    return levels[5] + np.random.default_rng(0).normal(0.0, 8.0, levels[5].shape)


@pytest.mark.parametrize(
    ("change", "kind"),
    [
        (lambda levels: levels[6], "duplicate"),
        (lambda levels: levels[6] + np.random.default_rng(0).normal(0.0, 1.0, levels[6].shape), "duplicate"),
        (lambda levels: 0.0 * levels[5], "lamp-dead"),
        (lambda levels: 0.7 * levels[5], "lamp-uneven"),
        (lambda levels: levels[5, ::-1, ::-1], "orientation"),
        (rows_dark, "half-lit"),
        (rows_of_the_next, "half-lit"),
        (moved, "motion"),
        (noisy, "noise"),
    ],
    ids=["copy", "fired twice", "dead", "dim", "turned", "rows dark", "rows late", "moved", "noisy"],
)
def test_a_fault_of_one_image_is_named_with_its_image(relief: bgars.Capture, change: object, kind: str) -> None:
    told = bgars.check(spoilt(relief, 5, change)).told
    assert told[0].kind == kind
    assert told[0].image in ({5, 6} if kind == "duplicate" else {5})


def test_faults_of_all_images_are_named(relief: bgars.Capture, balls: bgars.Capture) -> None:
    levels = relief.images / 255.0
    assert kinds(replace(relief, images=np.rint(255.0 * levels ** (1 / 2.2)).astype(np.uint8))) == ["response"]
    assert "dark" in kinds(replace(relief, images=np.rint(14.0 * levels).astype(np.uint8)))
    assert "clipped" in kinds(replace(relief, images=np.clip(600.0 * levels, 0, 255).astype(np.uint8)))
    bright = np.clip(balls.images + 0.3 * balls.images.max(axis=0), 0, 255).astype(np.uint8)
    assert "ambient" in kinds(replace(balls, images=bright))


def test_noise_that_falls_with_light_tells_a_curve(balls: bgars.Capture) -> None:
    """On shiny balls, where no matt model holds; levels are spread first, so that no comb tells."""
    random = np.random.default_rng(1)
    linear = np.clip((balls.images + random.uniform(-0.5, 0.5, balls.images.shape)) / 255.0, 0.0, 1.0)
    for gamma in (1.8, 2.2):
        told = bgars.check(replace(balls, images=np.rint(255.0 * linear ** (1.0 / gamma)).astype(np.uint8))).told
        assert [each.kind for each in told] == ["response"]
        assert "noise of dark parts" in told[0].message
    constant = np.clip(balls.images + random.normal(0.0, 2.0, balls.images.shape), 0, 255)
    assert "response" not in kinds(replace(balls, images=np.rint(constant).astype(np.uint8)))


def test_a_stated_response_is_no_fault(balls: bgars.Capture) -> None:
    random = np.random.default_rng(1)
    linear = np.clip((balls.images + random.uniform(-0.5, 0.5, balls.images.shape)) / 255.0, 0.0, 1.0)
    encoded = np.rint(255.0 * linear ** (1.0 / 2.2)).astype(np.uint8)
    table = (np.arange(256) / 255.0).astype(np.float32) ** np.float32(2.2)
    assert kinds(replace(balls, images=encoded, response=table)) == []


@pytest.mark.parametrize("levels", [4, 10])
def test_a_small_veil_is_the_lower_end_of_shadows(balls: bgars.Capture, levels: int) -> None:
    told = bgars.check(replace(balls, images=np.minimum(balls.images, 255 - levels) + np.uint8(levels))).told
    assert [each.kind for each in told] == ["ambient"]
    lit = np.median(np.median(balls.images, axis=0))
    assert told[0].value == pytest.approx(levels / lit, rel=0.4)


def test_a_blurred_image_is_named(balls: bgars.Capture) -> None:
    levels = balls.images.astype(np.float64)
    levels[2] = gaussian_filter(levels[2], 1.2)
    levels[2] += np.random.default_rng(0).normal(0.0, 0.8, levels[2].shape)
    told = bgars.check(replace(balls, images=np.clip(np.rint(levels), 0, 255).astype(np.uint8))).told
    assert [(each.kind, each.image) for each in told] == [("focus", 2)]


def test_python_checks_before_any_number(balls: bgars.Capture) -> None:
    mirrored = with_lights(balls, balls.rig.directions * [1, -1, 1])
    for function in (bgars.reconstruct, bgars.inspect):
        with pytest.raises(bgars.InputError, match=r"lights on the other side in y.*check=False continues"):
            function(mirrored)
    assert bgars.reconstruct(mirrored, method="robust-filter", check=False).field.mask.any()


def test_what_is_found_is_warned_of_and_kept_with_the_part(balls: bgars.Capture) -> None:
    veiled = replace(balls, images=np.minimum(balls.images, 245) + np.uint8(10))
    with pytest.warns(bgars.CaptureWarning, match="ambient: the deepest shadows still have") as told:
        result = bgars.inspect(veiled, method="robust-filter")
    assert {warning.filename for warning in told} == {__file__}
    assert result.warnings[0].startswith("capture: ambient: the deepest shadows")
    assert not any("ambient" in each for each in bgars.inspect(veiled, method="robust-filter", check=False).warnings)


def test_a_batch_keeps_findings_with_the_part_and_refuses_wrong_lights(balls: bgars.Capture, tmp_path: Path) -> None:
    veiled = np.minimum(balls.images, 245) + np.uint8(10)
    for name, sign in (("veiled", 1), ("mirrored", -1)):
        folder = tmp_path / name
        folder.mkdir()
        for index, image in enumerate(veiled if sign == 1 else balls.images):
            iio.imwrite(folder / f"{index}.png", image)
        lights = balls.rig.directions * [1, sign, 1]
        rows = ", ".join(str(each.tolist()) for each in lights)
        text = f"pixel_pitch_um = 10.0\n[lights]\ndirections = [{rows}]\n"
        (folder / "capture.toml").write_text(text, encoding="utf-8")
    (kept,) = run_job(Job(str(tmp_path / "veiled"), method="robust-filter"))
    assert kept.result is not None
    assert kept.result.warnings[0].startswith("capture: ambient")
    (refused,) = run_job(Job(str(tmp_path / "mirrored"), method="robust-filter"))
    assert refused.result is None
    assert refused.is_input
    assert "lights on the other side in y" in refused.reason


def test_a_flat_field_is_no_evidence() -> None:
    random = np.random.default_rng(0)
    images = np.clip(np.rint(120.0 + random.normal(0.0, 1.0, (8, 100, 100))), 0, 255).astype(np.uint8)
    rig = bgars.LightRig.ring(8)
    for lights in (rig.directions, rig.directions * [1, -1, 1], rig.directions[::-1]):
        capture = bgars.Capture(images, bgars.LightRig.from_directions(lights), every_pixel((100, 100)))
        assert bgars.check(capture).errors == ()


def test_a_lying_table_stops_commands(tmp_path: Path) -> None:
    folder = tmp_path / "capture"
    folder.mkdir()
    source = Path(bgars.sample_capture())
    for path in source.iterdir():
        if path.is_file():
            (folder / path.name).write_bytes(path.read_bytes())
    lights = np.loadtxt(folder / "light_directions.txt")
    np.savetxt(folder / "light_directions.txt", lights * [1, 1, -1])

    def run(*words: object) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "bgars", *map(str, words)], capture_output=True, text=True, check=False
        )

    checked = run("check", folder, "--json", "-o", tmp_path / "page.html")
    assert checked.returncode == 1
    found = json.loads(checked.stdout)["findings"]
    assert (found[0]["kind"], found[0]["severity"]) == ("below-surface", "error")
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "What to do" in page
    assert "<script" not in page
    stopped = run("normals", folder, "-o", tmp_path / "out")
    assert stopped.returncode == 2
    assert "below the surface" in stopped.stderr
    assert not (tmp_path / "out").exists()
    assert run("check", tmp_path / "nowhere").returncode == 2


def test_tables_that_look_the_same_are_tried_once() -> None:
    ring = bgars.LightRig.ring(8).directions
    told = [each.told for each in alternatives(ring, [f"image {k}" for k in range(8)], [])]
    # Of eight turns of a ring, half are a half turn away from another, and one is the given table; so with its mirrors.
    assert len(told) == len(set(told)) == 6


def test_the_t_test_keeps_its_rate_of_false_alarms() -> None:
    random = np.random.default_rng(5)
    alarms = 0
    for _ in range(4000):
        t, tiles = paired_t(random.normal(size=20), np.ones(20))
        alarms += t > critical_t(tiles)
    assert alarms <= 12


def test_a_bow_is_said_and_taken_off() -> None:
    y, x = np.mgrid[:300, :300].astype(np.float64) - 150.0
    random = np.random.default_rng(1)
    dome = bgars.HeightMap.from_array(-(x**2 + y**2) / 1500.0 + random.normal(0.0, 0.2, x.shape))
    bow = find_bow(dome)
    assert bow is not None
    assert bow.height_px > 0
    assert "--flatten quadratic" in str(bow)
    flat = flattened(dome, "quadratic")
    assert float(flat.height_px.std()) < 0.25
    assert find_bow(flat) is None
    sphere = bgars.HeightMap.from_array(np.sqrt(170.0**2 - np.minimum(x**2 + y**2, 160.0**2)))
    assert find_bow(sphere) is None


def test_black_background_is_not_measured(relief: bgars.Capture) -> None:
    images = relief.images.copy()
    images[:, :, :80] = np.random.default_rng(0).integers(0, 3, (8, 200, 80))
    capture = replace(relief, images=images)
    field = without_background(bgars.estimate_normals(capture, method="lambertian"), capture)
    assert field.is_measured[:, :80].mean() < 0.05
    assert field.is_measured[:, 82:].mean() > 0.99


@pytest.mark.parametrize("threads", [1, None])
def test_what_the_check_refuses_comes_before_what_the_work_says(threads: int | None) -> None:
    capture = bgars.read_capture(bgars.sample_capture())
    done: list[bgars.Findings] = []

    def refuse(findings: bgars.Findings) -> tuple[str, ...]:
        done.append(findings)
        raise bgars.InputError("images: in another order")

    def fail() -> None:
        raise bgars.InputError("balls: none")

    with pytest.raises(bgars.InputError, match="in another order"):
        checked_beside(capture, refuse, fail, threads=threads)
    assert done == [bgars.check(capture)]
    with pytest.raises(bgars.InputError, match="balls: none"):
        checked_beside(capture, lambda _: (), fail, threads=threads)
    assert checked_beside(capture, lambda _: ("told",), lambda: 7, threads=threads) == (("told",), 7)
    assert checked_beside(capture, None, lambda: 7, threads=threads) == ((), 7)
