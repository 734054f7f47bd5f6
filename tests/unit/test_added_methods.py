"""Methods that others add: registered in a program, or by a package's entry point."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import bgars
import numpy as np
import pytest
from bgars.io import formats
from bgars.normals import methods
from bgars.normals.methods import ALL_METHODS, METHODS, TABLE
from bgars.pipelines.normals import RUNNERS

MODULE = """
import numpy as np

def upward(capture, *, mask, progress=None):
    return np.tile(np.float32([0, 0, 2]), (*capture.mask.shape, 1))
"""


@pytest.fixture
def registered(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(methods, "_registered", {})


@pytest.fixture(scope="module")
def capture() -> bgars.Capture:
    return bgars.read_capture(bgars.sample_capture())


def upward(capture: bgars.Capture) -> np.ndarray[Any, Any]:
    return np.tile(np.float32([0, 0, 2]), (*capture.mask.shape, 1))


def test_each_method_of_the_table_has_a_function() -> None:
    assert set(RUNNERS) == set(TABLE) == set(ALL_METHODS) > set(METHODS)


@pytest.mark.usefixtures("registered")
def test_a_registered_function_is_a_method_like_others(capture: bgars.Capture) -> None:
    bgars.register_method("upward", upward)
    mask = np.zeros(capture.mask.shape, bool)
    mask[10:40, 10:40] = True
    field = bgars.estimate_normals(capture, method="upward", mask=mask)
    assert field.method == "upward"
    assert field.mask.sum() == (mask & capture.mask).sum(), "pixels outside the mask are taken off"
    assert np.allclose(field.normals[field.mask], [0, 0, 1])
    assert bgars.evaluate(capture, method="upward").method == "upward"
    result = bgars.reconstruct(capture, method="upward")
    assert np.ptp(result.height.height[result.height.mask]) < 1e-3
    assert bgars.inspect(capture, method="upward").method == "upward"


def a_field(shape: tuple[int, int], normals: np.ndarray[Any, Any], **others: Any) -> bgars.NormalField:  # noqa: ANN401
    ones, every = np.ones(shape, np.float32), np.ones(shape, bool)
    given = {"albedo": ones, "mask": every, "confidence": ones, "is_measured": every, "lights_kept": ones} | others
    return bgars.NormalField(normals, **given, method="")


@pytest.mark.usefixtures("registered")
def test_a_field_of_others_has_unit_normals_or_none_and_the_pitch(capture: bgars.Capture) -> None:
    shape = capture.mask.shape
    given = np.zeros((*shape, 3), np.float32)
    given[100:, :, 2] = 2.0
    given[200:, 0] = np.nan
    hidden = np.broadcast_to(given.sum(axis=2, keepdims=True) == 0, given.shape)
    for made in (a_field(shape, given), np.ma.masked_array(np.where(hidden, [1, 0, 0], given), mask=hidden)):
        bgars.register_method("sloppy", lambda _, made=made: made, replace=True)
        field = bgars.estimate_normals(capture, method="sloppy")
        assert field.mask.sum() == (shape[0] - 100) * shape[1] - (shape[0] - 200)
        assert np.allclose(field.normals[field.mask], [0, 0, 1])
        assert np.isnan(field.normals[~field.mask]).all()
        assert field.pixel_pitch_um == capture.pixel_pitch_um
    none = a_field(shape, np.zeros((*shape, 3)))
    assert bgars.evaluate(capture, method=none).normals.mean_deg > 30.0, "no normal is no perfect one"
    with pytest.raises(bgars.InputError, match=r"albedo must have shape \(240, 256\), got \(2, 2\)"):
        bgars.evaluate(capture, method=a_field(shape, given, albedo=np.ones((2, 2))))


def test_some_normals_that_face_away_do_not_end_an_evaluation(capture: bgars.Capture) -> None:
    normals = bgars.read_truth(bgars.sample_capture()).normals.copy()
    normals[120, 128] *= -1
    found = bgars.evaluate(capture, method=normals)
    assert found.ball_height_rmse_um is not None
    assert found.normals.mean_deg > 0.0


def test_the_angle_to_no_normal_is_that_to_the_vertical_and_of_no_truth_nan() -> None:
    slanted = np.float32([0.6, 0.0, 0.8])
    estimate = np.ma.masked_array([slanted, [0, 0, 0], slanted, slanted], mask=np.eye(4, 3, -2, bool))
    errors = bgars.angular_error_deg(estimate, np.stack([slanted, slanted, slanted, 0 * slanted]))
    np.testing.assert_allclose(errors, [0.0, 36.87, 36.87, np.nan], atol=0.01)
    assert bgars.angular_error_deg([[0, 0, 1]], [[0, 0, 1]]).tolist() == [0.0]
    with pytest.raises(bgars.InputError, match=r"shapes that fit, got \(2, 3\) and \(4, 3\)"):
        bgars.angular_error_deg(np.ones((2, 3)), np.ones((4, 3)))
    with pytest.raises(bgars.InputError, match=r"truth: must have shape \(..., 3\), got \(4, 2\)"):
        bgars.angular_error_deg(np.ones((4, 3)), np.ones((4, 2)))


@pytest.mark.usefixtures("registered")
def test_a_function_is_given_the_options_that_it_names(capture: bgars.Capture) -> None:
    told: dict[str, Any] = {}

    def curious(capture: bgars.Capture, *, threshold: float = 3.0, threads: int | None = None, **rest: object) -> Any:  # noqa: ANN401
        told.update(threshold=threshold, threads=threads, **rest)
        return bgars.estimate_normals(capture, method="robust-filter")

    bgars.register_method("curious", curious)
    field = bgars.estimate_normals(capture, method="curious", threshold=7, threads=1, keep_sets=True)
    assert field.method == "curious"
    assert (told["threshold"], told["threads"], told["keep_sets"]) == (7.0, 1, True)
    bgars.register_method("upward", upward)
    with pytest.raises(bgars.InputError, match="threshold: the method upward does not take it"):
        bgars.estimate_normals(capture, method="upward", threshold=7)


@pytest.mark.usefixtures("registered")
@pytest.mark.parametrize(
    ("name", "function", "words"),
    [
        ("reflectance", upward, "name: reflectance is a method of bgars"),
        ("My Method", upward, "made of lower-case letters, digits and hyphens, got 'My Method'"),
        ("mine", 3, "function: must be callable, got int"),
    ],
)
def test_what_cannot_be_registered_is_refused(name: str, function: Any, words: str) -> None:  # noqa: ANN401
    with pytest.raises(bgars.InputError, match=words):
        bgars.register_method(name, function)


@pytest.mark.usefixtures("registered")
def test_an_unknown_name_is_answered_with_all_names(capture: bgars.Capture) -> None:
    bgars.register_method("upward", upward)
    with pytest.raises(bgars.InputError, match="reflectance, blind, upward; got 'upwards'"):
        bgars.estimate_normals(capture, method="upwards")
    bgars.register_method("upward", upward)
    with pytest.raises(
        bgars.InputError, match="name: upward is the name of another function; replace=True replaces it"
    ):
        bgars.register_method("upward", lambda _: np.zeros((3, 3, 3)))
    bgars.register_method("upward", lambda _: np.zeros((3, 3, 3)), replace=True)
    with pytest.raises(bgars.InputError, match=r"method: normals must be numbers of shape .* got float64"):
        bgars.estimate_normals(capture, method="upward")


def command(folder: Path, *arguments: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "bgars", *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"PYTHONPATH": str(folder), "COLUMNS": "200"},
    )


def test_a_package_adds_a_method_to_the_command_line(tmp_path: Path) -> None:
    (tmp_path / "theirs.py").write_text(MODULE, encoding="utf-8")
    info = tmp_path / "theirs-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: theirs\nVersion: 1.0\n", encoding="utf-8")
    points = "[bgars.methods]\nupward = theirs:upward\nbroken = theirs:nothing\nblind = theirs:upward\n"
    (info / "entry_points.txt").write_text(points, encoding="utf-8")
    run = command(tmp_path, "normals", bgars.sample_capture(), "-o", tmp_path / "out", "--method", "upward", "--json")
    assert run.returncode == 0, run.stderr
    assert '"method": "upward"' in run.stdout
    run = command(tmp_path, "inspect", "--help")
    assert "Added by others: broken, upward." in " ".join(run.stdout.replace("│", " ").split())
    run = command(tmp_path, "normals", bgars.sample_capture(), "-o", tmp_path / "b", "-m", "broken")
    assert run.returncode == 2
    assert "method: broken (theirs:nothing) cannot be loaded" in run.stderr
    run = command(tmp_path, "normals", bgars.sample_capture(), "-o", tmp_path / "b", "-m", "magic")
    assert run.returncode == 2
    assert "blind, broken, upward; got 'magic'" in " ".join(run.stderr.replace("│", " ").split())
    assert not (tmp_path / "b").exists()


def test_an_entry_point_that_cannot_be_called_is_said(
    capture: bgars.Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    info = tmp_path / "data-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: data\nVersion: 1.0\n", encoding="utf-8")
    (info / "entry_points.txt").write_text("[bgars.methods]\nconstant = math:pi\n", encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(bgars.InputError, match=r"method: constant \(math:pi\) must be callable, got float"):
        bgars.estimate_normals(capture, method="constant")


def test_a_line_of_each_table_is_a_method(capture: bgars.Capture, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(TABLE, "median-filter", methods.NormalsMethod("median-filter", "as CONTRIBUTING.md has it."))
    monkeypatch.setitem(RUNNERS, "median-filter", lambda capture, **_: bgars.estimate_normals(capture, method="blind"))
    assert bgars.estimate_normals(capture, method="median-filter").method == "blind"
    with pytest.raises(bgars.InputError, match="threshold: only the method specular-filter uses it"):
        bgars.estimate_normals(capture, method="median-filter", threshold=3)


def test_a_line_of_the_table_is_a_file_format(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def write(_: object, normals: Any, path: Path) -> None:  # noqa: ANN401
        np.savetxt(path, normals.reshape(-1, 3), delimiter=",")

    normals = np.float32([[[0.6, 0.0, 0.8], [0.0, 0.0, 1.0]]])
    with pytest.raises(bgars.InputError):
        bgars.write_normals(normals, tmp_path / "n.csv")
    monkeypatch.setitem(formats.NORMAL_FORMATS, ".csv", write)
    bgars.write_normals(normals, tmp_path / "n.csv")
    assert np.allclose(np.loadtxt(tmp_path / "n.csv", delimiter=","), normals[0])
