"""A wheel, installed in a clean environment, runs the demo."""

from __future__ import annotations

import subprocess
import sys
import venv
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def run(*command: object, cwd: Path) -> str:
    result = subprocess.run(list(map(str, command)), cwd=cwd, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


@pytest.mark.slow
@pytest.mark.timeout(1500)
def test_the_wheel_installs_and_runs_the_demo(tmp_path: Path) -> None:
    run(sys.executable, "-m", "pip", "wheel", "--no-deps", "--wheel-dir", tmp_path / "dist", ROOT, cwd=tmp_path)
    wheels = list((tmp_path / "dist").glob("bgars-*.whl"))
    assert len(wheels) == 1
    assert "abi3" in wheels[0].name
    venv.create(tmp_path / "clean")
    python = tmp_path / "clean" / "bin" / "python"
    install = ("install", "--quiet", "--no-compile", f"{wheels[0]}[report]")
    run(sys.executable, "-m", "pip", "--python", python, *install, cwd=tmp_path)
    output = run(tmp_path / "clean" / "bin" / "bgars", "demo", "-o", "demo", cwd=tmp_path)
    assert "overview.png" in output
    assert (tmp_path / "demo" / "mesh.ply").stat().st_size > 100_000
    templates = "bgars.studies.pages; print(bgars.studies.pages._environment().list_templates())"
    assert "grr.html" in run(python, "-c", f"import {templates}", cwd=tmp_path)
    typed = run(
        python,
        "-c",
        "import bgars, pathlib; print((pathlib.Path(bgars.__file__).parent / 'py.typed').exists())",
        cwd=tmp_path,
    )
    assert typed.strip() == "True"
