"""A plain installation works; what needs more says in one line what to install."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import bgars
import pytest

WITHOUT = """
import sys
class Absent:
    def find_spec(self, name, *_):
        if name.partition(".")[0] in ABSENT:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name.partition(".")[0])
sys.meta_path.insert(0, Absent())
import importlib.util
found = importlib.util.find_spec
importlib.util.find_spec = lambda name, *a: None if name in ABSENT else found(name, *a)
"""


def run_without(code: str, *packages: str) -> subprocess.CompletedProcess[str]:
    """Run code where some packages, by default matplotlib and plotly, are not installed."""
    absent = f"ABSENT = {set(packages or ('matplotlib', 'plotly'))!r}"
    return subprocess.run([sys.executable, "-c", absent + WITHOUT + code], capture_output=True, text=True, check=False)


def command(*arguments: object) -> str:
    return f"sys.argv = {['bgars', *map(str, arguments)]!r}\nfrom bgars.cli import main\nmain()"


def test_reconstruct_leaves_out_the_picture_and_says_so(tmp_path: Path) -> None:
    run = run_without(command("reconstruct", bgars.sample_capture(), "-o", tmp_path / "out"))
    assert run.returncode == 0, run.stderr
    assert run.stderr == "warning: overview.png is left out: it needs matplotlib: pip install 'bgars[report]'\n"
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        *("mesh.ply", "normals.png", "height.tif", "height.npy", "summary.json")
    }


def test_inspect_judges_without_pictures_and_page(tmp_path: Path) -> None:
    run = run_without(command("inspect", bgars.sample_capture(), "-o", tmp_path / "out"))
    assert run.returncode == 1, run.stderr
    assert run.stderr.count("pip install 'bgars[report]'") == 2
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"result.json", "balls.csv"}


def test_what_cannot_do_without_says_what_to_install(tmp_path: Path) -> None:
    run = run_without(command("grr", tmp_path, "-o", tmp_path / "out"))
    assert run.returncode == 2
    assert run.stderr.strip() == "error: this command needs matplotlib: pip install 'bgars[report]'"
    run = run_without("import bgars\nbgars.write_overview")
    assert "bgars.write_overview needs matplotlib: pip install 'bgars[report]'" in run.stderr


STORE = "store: needs pyarrow, which is not installed; install it with: pip install 'bgars[store]'"
MQTT, AMQP = ("--mqtt", "mqtt://host/topic"), ("--amqp", "amqp://host/queue")


@pytest.mark.parametrize(
    ("absent", "arguments", "told"),
    [
        ("pyarrow", ("query", "{store}", "select 1"), STORE),
        ("pyarrow", ("batch", bgars.sample_capture(), "-o", "{store}"), STORE),
        ("pyarrow", ("store", "export", "{store}", "sqlite://"), STORE),
        ("duckdb", ("query", "{store}", "select 1"), "pip install 'bgars[store]'"),
        ("sqlalchemy", ("store", "export", "{store}", "sqlite://"), "pip install 'bgars[sql]'"),
        ("paho", ("send", "{store}", *MQTT), "pip install 'bgars[mqtt]'"),
        ("proton", ("send", "{store}", *AMQP), "pip install 'bgars[amqp]'"),
        ("zxingcpp", ("batch", bgars.sample_capture(), "-o", "{store}", "--serial-from", "code"), "bgars[codes]'"),
    ],
)
def test_a_command_of_the_line_names_its_extra_in_one_line(
    tmp_path: Path, absent: str, arguments: tuple[str, ...], told: str
) -> None:
    bgars.open_store(tmp_path / "store", create=True)
    run = run_without(command(*(str(each).format(store=tmp_path / "store") for each in arguments)), absent)
    assert (run.returncode, run.stdout) == (2, "")
    assert told in run.stderr
    assert run.stderr.count("\n") == 1
