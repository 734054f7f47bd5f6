"""The experiments at a small size: files, columns, the same bits again, and what their numbers mean."""

from __future__ import annotations

import csv
import json
import os
import re
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import bgars
import imageio.v3 as iio
import numpy as np
import pytest
from bgars.normals.methods import METHODS
from shared_work import shared

from experiments import EXPERIMENTS, write_experiments
from experiments.kept import solved
from experiments.measure import measure
from experiments.meshes import shape_residuals_px
from experiments.setting import DIFFUSE, HARDNESS, SPECULAR, Setting

RADIUS_PX = 20
ERROR_COLUMNS = (
    "method,i_d,i_s,hardness,elevation_deg,mean_deg_nz03,median_deg_nz03,p95_deg_nz03,mean_deg_nz01,height_rmse_px,"
    "measured_percent_nz03"
)


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    def made() -> tuple[Path, dict[str, Any]]:
        folder = tmp_path_factory.mktemp("experiments") / "out"
        return folder, write_experiments("all", folder, radius_px=RADIUS_PX)

    return shared(tmp_path_factory, "experiments", made)


def rows_of(folder: Path, name: str) -> list[dict[str, str]]:
    with (folder / f"{name}.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def header_of(folder: Path, name: str) -> str:
    return (folder / f"{name}.csv").read_text(encoding="utf-8").split("\n", 1)[0]


def experiments_command(*arguments: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "experiments", *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        cwd=cwd,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])},
    )


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_every_experiment_leaves_a_figure_a_table_and_words(results: tuple[Path, dict[str, Any]], name: str) -> None:
    folder, summary = results
    figure = iio.imread(folder / f"{name}.png")
    assert min(figure.shape[:2]) > 200
    assert figure[..., :3].std() > 5, "not an empty page"
    assert len(rows_of(folder, name)) >= 5, "a sweep has five values or more"
    facts = summary["experiments"][name]
    assert facts["agrees"] or facts["differs"]
    assert json.loads(json.dumps(facts, allow_nan=False))["rows"]
    assert set(summary["files"]) == {path.name for path in folder.iterdir()}


def test_the_page_shows_every_figure_and_leaves_no_gap(results: tuple[Path, dict[str, Any]]) -> None:
    folder, _ = results
    page = (folder / "experiments.md").read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)]+)\)", page):
        assert (folder / target).is_file(), target
    for name, experiment in EXPERIMENTS.items():
        assert f"## {experiment.title}\n" in page
        assert f"]({name}.png)" in page
        assert f"]({name}.csv)" in page
    assert not re.search(r"\bnan\b|\binf\b|[{}]|None", page)
    assert f"R = {RADIUS_PX} px" in page
    assert page.index("Limits first") < page.index("do not hold") < page.index("Where they hold")


@pytest.mark.parametrize("name", ["fig10", "fig11", "fig12", "elevation"])
def test_error_tables_have_exactly_these_columns(results: tuple[Path, dict[str, Any]], name: str) -> None:
    assert header_of(results[0], name) == ERROR_COLUMNS


@pytest.mark.parametrize(
    ("name", "extra"),
    [
        ("lights", "lights"),
        ("noise", "noise_levels"),
        ("threshold", "threshold"),
        ("fig4", "rise_px,cone_residual_px,spheroid_residual_px"),
        ("fig6", "rise_px,cone_residual_px,spheroid_residual_px"),
    ],
)
def test_other_error_tables_add_columns_at_the_end(results: tuple[Path, dict[str, Any]], name: str, extra: str) -> None:
    assert header_of(results[0], name) == f"{ERROR_COLUMNS},{extra}"


@pytest.mark.parametrize(
    ("name", "column", "values"),
    [
        ("fig10", "i_d", DIFFUSE),
        ("fig11", "i_s", SPECULAR),
        ("fig12", "hardness", HARDNESS),
        ("lights", "lights", range(3, 17)),
        ("elevation", "elevation_deg", range(20, 75, 5)),
        ("noise", "noise_levels", (0, 0.5, 1, 2, 3, 4, 5)),
    ],
)
def test_sweeps_hold_every_method_at_every_value(
    results: tuple[Path, dict[str, Any]], name: str, column: str, values: Iterable[float]
) -> None:
    found = {(row["method"], float(row[column])) for row in rows_of(results[0], name)}
    assert found == {(method, float(value)) for method in METHODS for value in values}


def test_the_same_setting_has_the_same_errors_in_every_table(results: tuple[Path, dict[str, Any]]) -> None:
    folder, _ = results
    base = {"i_d": "0.5", "i_s": "1", "hardness": "40", "elevation_deg": "45"}
    for method in METHODS:
        seen = set()
        for name in ("fig6", "fig10", "fig11", "fig12", "elevation", "lights", "noise"):
            for row in rows_of(folder, name):
                same = row["method"] == method and all(row[key] == value for key, value in base.items())
                if same and row.get("lights", "8") == "8" and row.get("noise_levels", "0") == "0":
                    seen.add((row["mean_deg_nz03"], row["p95_deg_nz03"], row["height_rmse_px"]))
        assert len(seen) == 1


@pytest.mark.parametrize("name", ["fig4", "fig5", "noise", "kept"])
def test_a_second_run_gives_the_same_bits(results: tuple[Path, dict[str, Any]], tmp_path: Path, name: str) -> None:
    summary = write_experiments(name, tmp_path / "again", radius_px=RADIUS_PX)
    for file in summary["files"]:
        if not file.endswith(".md"):
            assert (tmp_path / "again" / file).read_bytes() == (results[0] / file).read_bytes(), file


def test_the_rank_plot_cuts_where_the_rule_says(results: tuple[Path, dict[str, Any]]) -> None:
    rows = rows_of(results[0], "fig5")
    for case in ("best", "worst", "bright"):
        ranks = [row for row in rows if row["case"] == case]
        grey = np.array([float(row["grey"]) for row in ranks])
        assert (np.diff(grey) >= 0).all()
        over = [index for index, gap in enumerate(np.diff(grey)) if gap > 50 and index + 1 >= 3]
        kept = over[0] + 1 if over else len(grey)
        assert [row["kept"] for row in ranks] == ["1"] * kept + ["0"] * (len(grey) - kept)
        for row in ranks:
            assert row["lit"] == "1" or float(row["grey"]) == 0.0, "an attached shadow is black"


def test_height_rmse_is_over_the_silhouette_with_the_mean_removed() -> None:
    setting = Setting()
    capture, truth = setting.photograph(RADIUS_PX)
    result = measure(capture, truth, setting, method="lambertian")
    np.testing.assert_array_equal(np.isfinite(result.height_px), truth.mask)
    difference_px = (result.height_px.astype(np.float64) - truth.height_px)[truth.mask]
    expected = np.sqrt(np.mean((difference_px - difference_px.mean()) ** 2))
    assert result.height_rmse_px == pytest.approx(expected, rel=1e-5)


def test_a_matte_ball_without_shadows_is_recovered() -> None:
    setting = Setting(i_d=1.0, i_s=0.0, elevation_deg=70.0)
    capture, truth = setting.photograph(40)
    result = measure(capture, truth, setting, method="lambertian")
    assert result.median_deg_nz03 < 0.3
    assert result.unsolved == 0


def test_a_pixel_without_a_solution_counts_as_facing_the_camera() -> None:
    setting = Setting(i_d=1.0)
    capture, truth = setting.photograph(RADIUS_PX)
    field = bgars.estimate_normals(capture, method="specular-filter")
    result = measure(capture, truth, setting, method="specular-filter")
    assert result.unsolved == (~field.mask & truth.mask).sum() > 0
    assert np.isfinite(result.height_px[~field.mask & truth.mask]).all()


def test_cones_and_balls_are_told_apart() -> None:
    y, x = np.mgrid[-29.5:30, -29.5:30]
    r_px = np.hypot(x, y)
    ball = np.where(r_px < 30, np.sqrt(np.maximum(900 - r_px**2, 0)), np.nan).astype(np.float32)
    cone = np.where(r_px < 30, 45 - 1.5 * r_px, np.nan).astype(np.float32)
    flat_ball = ball * np.float32(0.6) + np.float32(7)
    assert shape_residuals_px(cone, 30)[0] < 1e-4 < shape_residuals_px(cone, 30)[1]
    for surface in (ball, flat_ball):
        assert shape_residuals_px(surface, 30)[1] < 1e-4 < shape_residuals_px(surface, 30)[0]


def test_least_squares_over_chosen_lights_is_numpys() -> None:
    random = np.random.default_rng(3)
    directions = bgars.LightRig.ring(8).directions
    values = random.uniform(1, 255, (8, 40))
    use = random.random((8, 40)) < 0.6
    otherwise = np.tile([0.0, 0.0, 1.0], (40, 1))
    found = solved(values, use, directions, otherwise)
    for pixel in range(40):
        chosen = use[:, pixel]
        expected = otherwise[pixel]
        if chosen.sum() >= 3:
            solution = np.linalg.lstsq(directions[chosen], values[chosen, pixel], rcond=None)[0]
            if solution[2] > 0:
                expected = solution / np.linalg.norm(solution)
        np.testing.assert_allclose(found[pixel], expected, atol=1e-9)


def test_the_command_prints_json_and_links_from_a_page_elsewhere(tmp_path: Path) -> None:
    (tmp_path / "docs").mkdir()
    run = experiments_command(
        *("fig9", "-o", "docs/images/x", "--page", "docs/x.md", "--radius-px", 12, "--json"), cwd=tmp_path
    )
    assert run.returncode == 0, run.stderr
    assert run.stderr == "", "quiet in pipes"
    summary = json.loads(run.stdout)
    assert summary["radius_px"] == 12
    assert summary["files"] == ["fig9.png", "fig9.csv"]
    assert [row["hardness"] for row in summary["experiments"]["fig9"]["rows"]] == list(HARDNESS)
    assert "](images/x/fig9.png)" in (tmp_path / "docs" / "x.md").read_text(encoding="utf-8")
    assert sorted(path.name for path in (tmp_path / "docs").iterdir()) == ["images", "x.md"]


def test_a_page_in_the_output_folder_is_one_of_its_files(tmp_path: Path) -> None:
    summary = write_experiments("fig3", tmp_path / "out", radius_px=12, page=tmp_path / "out" / "mine.md")
    assert summary["files"] == ["fig3.png", "fig3.csv", "mine.md"]
    assert "](fig3.png)" in (tmp_path / "out" / "mine.md").read_text(encoding="utf-8")


def test_help_lists_every_experiment_in_a_line() -> None:
    run = experiments_command("--help")
    assert run.returncode == 0
    for name in (*EXPERIMENTS, "all"):
        assert re.search(rf"\b{name}\b", run.stdout), name


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["fig2", "-o", "out"], ["must be one of all, reference, fig3", "noise", "got 'fig2'"]),
        (["fig3", "-o", "out", "--radius-px", "5"], ["radius_px: must lie in [10, 500], got 5"]),
        (["fig3", "-o", "out", "--page", "nowhere/page.md"], ["nowhere/page.md: cannot be written"]),
        (["fig3"], ["output"]),
    ],
)
def test_bad_input_is_exit_code_2_and_leaves_nothing(tmp_path: Path, arguments: list[str], words: list[str]) -> None:
    run = experiments_command(*arguments, cwd=tmp_path)
    assert run.returncode == 2, run.stdout
    for part in words:
        assert part in run.stderr
    assert "Traceback" not in run.stderr
    assert list(tmp_path.iterdir()) == []
