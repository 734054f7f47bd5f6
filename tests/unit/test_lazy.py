"""`import bgars` and the list of commands load nothing that they do not need."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import bgars
import pytest

HEAVY = {"numpy", "matplotlib", "trimesh", "scipy", "plotly", "imageio", "tifffile", "PIL", "jinja2"}


def loaded_by(code: str) -> set[str]:
    """Names of the packages in memory after a fresh interpreter ran some code."""
    told = f"{code}\nimport sys; print('loaded', *sorted({{name.partition('.')[0] for name in sys.modules}}))"
    run = subprocess.run([sys.executable, "-c", told], capture_output=True, text=True, check=True)
    return set(run.stdout.splitlines()[-1].split())


def test_import_loads_no_other_package() -> None:
    assert not loaded_by("import bgars") & (HEAVY | {"typer", "rich", "pydantic"})


@pytest.mark.parametrize("argument", ["--version", "--help"])
def test_the_list_of_commands_loads_no_estimator(argument: str) -> None:
    call = f"""
import contextlib, sys
from bgars.cli import main
sys.argv = ["bgars", "{argument}"]
with contextlib.suppress(SystemExit):
    main()
"""
    assert not loaded_by(call) & HEAVY


def test_every_public_name_can_be_had_and_is_what_type_checkers_see() -> None:
    stub = ast.parse(Path(bgars.__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
    names = [alias.name for node in stub.body if isinstance(node, ast.ImportFrom) for alias in node.names]
    assert sorted(names) == sorted(set(names)) == dir(bgars) == bgars.__all__
    for name in names:
        assert getattr(bgars, name) is not None
    loaded_by("import bgars; assert bgars.normals.METHODS and bgars._bgars.DEBUG_BUILD is False")
    with pytest.raises(AttributeError, match="no_such_name"):
        bgars.no_such_name  # noqa: B018


def test_a_function_is_not_replaced_by_a_module_of_its_name() -> None:
    loaded_by(
        "import bgars.pipelines.evaluate, bgars.simulate.scene, bgars.records.findings, bgars.pipelines.inspect;"
        "assert callable(bgars.evaluate) and callable(bgars.simulate) and callable(bgars.check)"
    )


def test_ordinary_parts_need_no_scipy(tmp_path: Path) -> None:
    call = f"""
import contextlib, sys
from bgars.cli.app import main
for name in ("inspect", "reconstruct"):
    sys.argv = ["bgars", name, {str(bgars.sample_capture())!r}, "-o", {str(tmp_path)!r} + "/" + name, "--json"]
    with contextlib.suppress(SystemExit):
        main()
import bgars
# Enough of a part for its lights to be tried in every order, and for a layout.
scene, rig, camera = bgars.Scene.ball_array(2, 3), bgars.LightRig.ring(8), bgars.Camera(pixel_pitch_um=20.0)
layout = bgars.BallLayout(rows=2, cols=3, pitch_um=1000.0)
bgars.inspect(bgars.simulate(scene, rig, bgars.Material(), camera)[0], bgars.PartRecipe("part", layout))
print()
print("loaded", *({{"scipy.fft", "scipy.ndimage", "scipy.optimize", "scipy.spatial"}} & set(sys.modules)))
"""
    run = subprocess.run([sys.executable, "-c", call], capture_output=True, text=True, check=True)
    assert run.stdout.splitlines()[-1] == "loaded"
    assert {path.name for path in tmp_path.iterdir()} == {"inspect", "reconstruct"}
