"""Many captures into one store: each once, whatever is killed, in whatever order and number of processes."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import bgars
import imageio.v3 as iio
import numpy as np
import patient_batch
import pytest
from bgars.cli.app import app
from bgars.line import job
from bgars.line.folders import capture_folders
from bgars.line.local_pool import share_cores
from bgars.pipelines.inspect import inspected
from bgars.records.part_identity import PartIdentity
from line_captures import RECIPE, captures, copy_capture
from typer.testing import CliRunner

KEPT = "select serial, result_json from results order by serial"


def kept(store: Path) -> dict[str, dict]:
    """Every result without its time."""
    rows = bgars.open_store(store).query(KEPT).to_pylist()
    assert len({row["serial"] for row in rows}) == len(rows), "nothing twice"
    return {row["serial"]: json.loads(row["result_json"]) | {"inspected_utc": ""} for row in rows}


def start_batch(go: Path, *arguments: object) -> subprocess.Popen[str]:
    """Start the command; its parts, but A0, wait until there is the file `go`."""
    command = [sys.executable, patient_batch.__file__, "batch", *map(str, arguments)]
    environment = {**os.environ, patient_batch.GO: str(go)}
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment)


def parts_of(store: Path) -> int:
    return len(list((store / "parts").rglob("*.parquet")))


def wait_for_parts(store: Path, count: int) -> None:
    deadline = time.monotonic() + 120
    while parts_of(store) < count:
        assert time.monotonic() < deadline
        time.sleep(0.02)


def test_two_processes_give_what_one_gives_in_another_order(tmp_path: Path) -> None:
    folders = captures(tmp_path / "in", "A1", "A2", "A3")
    recipe = tmp_path / "part.toml"
    recipe.write_text(RECIPE)
    one = bgars.inspect_many(folders, recipe, store=tmp_path / "one", processes=1, threads=2)
    two = bgars.inspect_many(folders[::-1], recipe, store=tmp_path / "two", processes=2, threads=1)
    assert (one.inspected, two.inspected, two.processes, two.threads) == (3, 3, 2, 1)
    assert kept(tmp_path / "one") == kept(tmp_path / "two")
    assert list(kept(tmp_path / "one")) == ["A1", "A2", "A3"]
    again = bgars.inspect_many([tmp_path / "in"], recipe, store=tmp_path / "one", processes=1)
    assert (again.inspected, again.known) == (0, 3)


def test_failures_are_kept_and_stop_nothing(tmp_path: Path) -> None:
    good, cut, empty = captures(tmp_path / "in", "good", "cut", "nothing")
    light = cut / "light_03.png"
    light.write_bytes(light.read_bytes()[:500])
    for path in empty.iterdir():
        path.unlink()
    told = []
    done = bgars.inspect_many(
        [empty, cut, good], store=tmp_path / "store", processes=1, progress=lambda now: told.append(now.done)
    )
    assert (done.inspected, len(done.failures), told) == (1, 2, [1, 2, 3])
    reasons = bgars.open_store(tmp_path / "store").query("select serial, reason from failures order by serial")
    assert reasons["serial"].to_pylist() == ["cut", "nothing"]
    assert "light_03.png" in reasons["reason"][0].as_py()
    light.write_bytes((good / "light_03.png").read_bytes())
    again = bgars.inspect_many([cut, good], store=tmp_path / "store", processes=1)
    assert (again.inspected, again.known) == (1, 1)
    assert bgars.open_store(tmp_path / "store").query("select serial from failures")["serial"].to_pylist() == [
        "nothing"
    ]


def test_files_that_change_meanwhile_give_no_result(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = copy_capture(tmp_path / "part")

    def meddling(*arguments: object, **options: object) -> bgars.PartResult:
        with (folder / "capture.toml").open("a") as file:
            file.write("\n# changed\n")
        return inspected(*arguments, **options)

    monkeypatch.setattr(job, "inspected", meddling)
    (outcome,) = job.run_job(job.Job(str(folder)))
    assert outcome.result is None
    assert "changed while they were read" in outcome.reason


def test_a_run_that_is_killed_goes_on_where_it_was(tmp_path: Path) -> None:
    captures(tmp_path / "in", *(f"A{n}" for n in range(5)))
    store = tmp_path / "store"
    running = start_batch(tmp_path / "go", tmp_path / "in", "-o", store, "--processes", 2)
    wait_for_parts(store, 1)
    children = [int(pid) for pid in Path(f"/proc/{running.pid}/task/{running.pid}/children").read_text().split()]
    running.kill()
    running.communicate()
    assert parts_of(store) == 1
    done = bgars.inspect_many([tmp_path / "in"], store=store, processes=1)
    assert (done.inspected, done.known) == (4, 1)
    assert len(kept(store)) == 5
    deadline = time.monotonic() + 120
    while any(Path(f"/proc/{pid}").exists() for pid in children):
        assert time.monotonic() < deadline, "its processes go with it"
        time.sleep(0.05)


def test_a_process_that_is_killed_costs_nothing(tmp_path: Path) -> None:
    captures(tmp_path / "in", *(f"A{n}" for n in range(5)))
    store = tmp_path / "store"
    running = start_batch(tmp_path / "go", tmp_path / "in", "-o", store, "--processes", 2, "--json")
    wait_for_parts(store, 1)
    children = Path(f"/proc/{running.pid}/task/{running.pid}/children").read_text().split()
    workers = [pid for pid in map(int, children) if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()]
    os.kill(workers[0], signal.SIGKILL)
    (tmp_path / "go").touch()
    out, err = running.communicate(timeout=200)
    assert "Traceback" not in err
    told = json.loads(out)
    assert (told["inspected"], told["failures"]) == (5, [])
    assert len(kept(store)) == 5


@pytest.mark.parametrize(("ended_by", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_end_by_ctrl_c_or_sigterm_is_clean(tmp_path: Path, ended_by: signal.Signals, code: int) -> None:
    captures(tmp_path / "in", *(f"A{n}" for n in range(6)))
    store = tmp_path / "store"
    running = start_batch(tmp_path / "go", tmp_path / "in", "-o", store, "--processes", 2)
    wait_for_parts(store, 1)
    running.send_signal(ended_by)
    (tmp_path / "go").touch()
    _, err = running.communicate(timeout=120)
    assert running.returncode == code
    assert "Traceback" not in err
    assert "leaked" not in err
    assert err.endswith("interrupted; nothing half-written stays behind\n")
    assert 1 <= len(kept(store)) < 6


def test_the_program_expands_patterns(tmp_path: Path) -> None:
    captures(tmp_path / "in", "A1", "A2", "B1")
    assert [path.name for path in capture_folders([str(tmp_path / "in" / "A*")])] == ["A1", "A2"]
    assert [path.name for path in capture_folders([tmp_path / "in", tmp_path / "in" / "B1"])] == ["A1", "A2", "B1"]
    with pytest.raises(bgars.InputError, match="no folder matches this pattern"):
        capture_folders([tmp_path / "C*"])
    with pytest.raises(bgars.FileFormatError, match="no such folder"):
        capture_folders([tmp_path / "C"])
    with pytest.raises(bgars.InputError, match="folders: must be at least one capture"):
        capture_folders([])
    bgars.open_store(tmp_path / "in" / "A-store", create=True)
    for given in (tmp_path / "in", tmp_path / "in" / "*"):
        assert [path.name for path in capture_folders([given])] == ["A1", "A2", "B1"]


def test_a_mistyped_folder_leaves_no_store(tmp_path: Path) -> None:
    run = CliRunner().invoke(app, ["batch", str(tmp_path / "nothing"), "-o", str(tmp_path / "store")])
    assert isinstance(run.exception, bgars.FileFormatError)
    assert list(tmp_path.iterdir()) == []


def test_bad_numbers_and_recipes_are_refused_before_any_work(tmp_path: Path) -> None:
    folder = copy_capture(tmp_path / "in")
    with pytest.raises(bgars.InputError, match="processes: must be a whole number of 1 or more, got 0"):
        bgars.inspect_many([folder], processes=0)
    with pytest.raises(bgars.FileFormatError, match=r"none\.toml"):
        bgars.inspect_many([folder], tmp_path / "none.toml")
    assert share_cores(1, None, 1) == (1, 1)
    assert share_cores(9, 3, None)[0] == 3


def test_names_tell_serial_lot_and_place(tmp_path: Path) -> None:
    folder = tmp_path / "L7" / "SN12_3-4"
    folder.mkdir(parents=True)
    naming = bgars.Naming("{lot}/{serial}_{position}", PartIdentity(station="S1"))
    serial, identity = naming.of_name(folder)
    assert (serial, identity.known()) == ("SN12", {"lot": "L7", "position": "3-4", "station": "S1"})
    with pytest.raises(bgars.InputError, match="its name must follow the pattern"):
        bgars.Naming("{lot}-{serial}").of_name(tmp_path / "L7")
    for pattern, words in {"SN": r"must hold \{serial\}", "{serial}{who}": "got {who}"}.items():
        with pytest.raises(bgars.InputError, match=words):
            bgars.Naming(pattern)


def test_the_side_file_goes_before_the_name(tmp_path: Path) -> None:
    folder = copy_capture(tmp_path / "folder")
    with (folder / "capture.toml").open("a") as file:
        file.write('\n[part]\nserial = "SN99"\nlot = "L3"\noperator = "ada"\n')
    result = bgars.inspect_many([folder], processes=1).results[0]
    assert (result.serial, result.identity.lot, result.identity.operator) == ("SN99", "L3", "ada")
    assert result.identity.captured_utc.endswith("Z")
    csv = result.to_csv().splitlines()
    assert csv[0].endswith("part_serial,part_lot,part_capture,part_inspected_utc,part_round")
    assert ",SN99,L3,folder," in csv[1]


def with_codes(folder: Path, *codes: tuple[str, str, int]) -> bgars.Capture:
    """The sample with codes (text, kind, column) at its upper edge."""
    reader = pytest.importorskip("zxingcpp")
    copy_capture(folder)
    for path in sorted(folder.glob("light_*.png")):
        image = iio.imread(path)
        for text, kind, col in codes:
            code = np.asarray(reader.create_barcode(text, getattr(reader.BarcodeFormat, kind)).to_image(scale=3))
            image[: code.shape[0], col : col + code.shape[1]] = (code // 2)[:, : image.shape[1] - col]
        iio.imwrite(path, image)
    return bgars.read_capture(folder)


def test_a_code_in_the_images_is_the_serial_number(tmp_path: Path) -> None:
    naming, one = bgars.Naming("code"), ("SN-4711", "DataMatrix", 0)
    for name, codes in (("one", (one,)), ("twice", (one, ("SN-4711", "QRCode", 120)))):
        assert naming.of_capture(tmp_path / name, with_codes(tmp_path / name, *codes), "") == "SN-4711"
    with pytest.raises(bgars.InputError, match="no DataMatrix or QR code can be read"):
        naming.of_capture(tmp_path, bgars.read_capture(bgars.sample_capture()), "")


def test_codes_that_differ_are_no_serial_number(tmp_path: Path) -> None:
    capture = with_codes(tmp_path / "part", ("SN-4712", "DataMatrix", 0), ("SN-4711", "DataMatrix", 120))
    with pytest.raises(bgars.InputError, match=r"part: its images show several codes.*: 'SN-4711', 'SN-4712'"):
        bgars.Naming("code").of_capture(tmp_path / "part", capture, "")
    assert bgars.Naming("code").of_capture(tmp_path / "part", capture, "SN-1") == "SN-1", "capture.toml names it"


def test_a_bar_code_is_no_serial_number(tmp_path: Path) -> None:
    capture = with_codes(tmp_path / "part", ("12", "ITF", 0))
    with pytest.raises(bgars.InputError, match="no DataMatrix or QR code can be read"):
        bgars.Naming("code").of_capture(tmp_path / "part", capture, "")


def test_the_command_says_what_it_did(tmp_path: Path) -> None:
    folder = copy_capture(tmp_path / "A1")
    run = CliRunner().invoke(
        app, ["batch", str(folder), "-o", str(tmp_path / "s"), "--lot", "L1", "--processes", "1", "--json"]
    )
    told = json.loads(run.output)
    assert (run.exit_code, told["inspected"], told["verdicts"]["undecided"]) == (1, 1, 1)
    run = CliRunner().invoke(app, ["batch", str(folder), "-o", str(tmp_path / "s"), "--lot", "L1"])
    assert run.exit_code == 0, "nothing new that does not pass"
    assert "1 were in the store" in run.output
    assert bgars.open_store(tmp_path / "s").query("select lot from parts")["lot"].to_pylist() == ["L1"]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"method": "magic"}, "method: must be one of"),
        ({"naming": "serial"}, r"naming: must be a Naming, such as .*, got 'serial'"),
        ({"processes": 1.5}, r"processes: must be a whole number of 1 or more, got 1\.5"),
        ({"threads": True}, "threads: must be a whole number"),
        ({"store": 5}, "store: must be a path, got 5"),
        ({"recipe": 5}, "recipe: must be a path, got 5"),
        ({"folders": [5]}, "folders: must be paths, got 5"),
        ({"folders": 5}, "folders: must be paths, got 5"),
    ],
)
def test_wrong_arguments_are_refused_before_the_first_capture(options: dict[str, object], words: str) -> None:
    with pytest.raises(bgars.InputError, match=words):
        bgars.inspect_many(**{"folders": [bgars.sample_capture()], **options})


def test_one_folder_needs_no_list_and_what_became_of_it_is_one_line(tmp_path: Path) -> None:
    copy_capture(tmp_path / "in" / "P0")
    done = bgars.inspect_many(str(tmp_path / "in"), store=tmp_path / "store", processes=1)
    assert repr(done).startswith("Batch(total=1, pass=0, fail=0, undecided=1, known=0, failures=0, seconds=")
    shown = bgars.open_store(tmp_path / "store")._repr_html_()
    assert "<td style='text-align:left'>1 (all inspections)</td>" in shown
