"""Parts that come into an inbox: each once, none lost."""

from __future__ import annotations

import errno
import http.server
import json
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import bgars
import pytest
from bgars.cli.app import app
from bgars.line import job
from bgars.line.inbox import Inbox
from bgars.line.inbox_lock import watched
from bgars.line.notify import Notifier
from bgars.line.watch import Watch
from bgars.store import append
from killed_watch import RIG, command, drop, instant, kill_often
from line_captures import copy_capture
from typer.testing import CliRunner


@pytest.fixture
def inbox(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(job, "inspected", instant)
    folder = tmp_path / "in"
    folder.mkdir()
    (tmp_path / "rig.toml").write_text(RIG)
    return folder


def watch(
    inbox: Path, *, count: int | None = 4, trigger: str = "", settle_s: float = 0.0, files: str = "", **options: object
) -> Watch:
    store = bgars.open_store(inbox.parent / "store", create=True)
    told: list[str] = []
    made = Watch(
        Inbox(inbox, count=count, trigger=trigger, settle_s=settle_s, files=files),
        store,
        rig=inbox.parent / "rig.toml",
        done=inbox / "_done",
        failed=inbox / "_failed",
        say=told.append,
        **options,
    )
    made.told = told
    return made


def serials(inbox: Path, table: str = "parts") -> list[str]:
    store = bgars.open_store(inbox.parent / "store")
    return store.query(f"select serial from {table} order by sequence")["serial"].to_pylist()


def names(folder: Path, pattern: str) -> list[str]:
    return sorted(path.name for path in folder.glob(pattern))


def test_a_complete_part_is_inspected_kept_and_moved(inbox: Path) -> None:
    drop(inbox, "P1", 1)
    drop(inbox, "P2", 2)
    (inbox / "P2" / "img3.png").unlink()
    made = watch(inbox)
    assert made.step()
    assert serials(inbox) == ["P1"]
    assert names(inbox, "_done/*/*") == ["P1"]
    assert (inbox / "P2").is_dir(), "three of four images"
    assert not made.step()
    where = bgars.open_store(inbox.parent / "store").query("select capture_folder from parts")["capture_folder"]
    assert (Path(where[0].as_py()) / "capture.toml").read_text() == RIG


def test_a_part_is_taken_when_it_stopped_changing(inbox: Path) -> None:
    drop(inbox, "P1", 1)
    made = watch(inbox, settle_s=0.3)
    assert not made.step()
    (inbox / "P1" / "more.txt").write_text("a")
    time.sleep(0.35)
    assert not made.step(), "it changed at this look"
    time.sleep(0.35)
    assert made.step()


def test_a_trigger_file_needs_no_settling(inbox: Path) -> None:
    drop(inbox, "P1", 1)
    made = watch(inbox, settle_s=1e9, trigger="ready")
    assert not made.step()
    (inbox / "P1" / "ready").touch()
    assert made.step()


def test_files_in_the_inbox_itself_become_a_folder_each(inbox: Path) -> None:
    drop(inbox, "P1", 1)
    for path in list((inbox / "P1").iterdir()):
        path.rename(inbox / f"SN7_{path.name}")
    (inbox / "P1").rmdir()
    (inbox / "SN8_img0.png").write_bytes(b"one of four")
    gathering = inbox / ".gathering-SN7"
    gathering.mkdir()
    (inbox / "SN7_img0.png").rename(gathering / "SN7_img0.png")  # where a kill left it
    made = watch(inbox, files="{serial}_{image}.png")
    assert made.step()
    assert serials(inbox) == ["SN7"]
    assert names(inbox, "_done/*/SN7/*.png") == [f"SN7_img{light}.png" for light in range(4)]
    assert (inbox / "SN8_img0.png").is_file()
    with pytest.raises(bgars.InputError, match="--files: must hold"):
        watch(inbox, files="{serial}.png")


def test_what_stays_incomplete_or_unreadable_is_moved_with_its_reason(inbox: Path) -> None:
    drop(inbox, "P1", 1)
    (inbox / "P1" / "img3.png").unlink()
    drop(inbox, "P2", 2)
    (inbox / "P2" / "img3.png").write_bytes((inbox / "P2" / "img3.png").read_bytes()[:40])
    made = watch(inbox, patience_s=0.2)
    made.step()
    assert names(inbox, "_failed/*/*") == [], "a copy may still be under way"
    deadline = time.monotonic() + 120
    while len(names(inbox, "_failed/*/*")) < 2 and time.monotonic() < deadline:
        made.step()
        time.sleep(0.05)
    assert sorted(serials(inbox, "failures")) == ["P1", "P2"]
    reasons = " ".join(made.told)
    assert "incomplete: 3 of 4 images" in reasons
    assert "img3.png" in reasons
    assert serials(inbox) == []


def test_a_half_written_image_that_is_completed_is_a_good_part(inbox: Path) -> None:
    drop(inbox, "P1", 1)
    image = inbox / "P1" / "img3.png"
    whole = image.read_bytes()
    image.write_bytes(whole[:40])
    made = watch(inbox, patience_s=60.0)
    assert not made.step()
    image.write_bytes(whole)
    assert made.step()
    assert serials(inbox) == ["P1"]
    assert names(inbox, "_failed/*/*") == []


def test_a_full_disk_stops_nothing_for_good(inbox: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drop(inbox, "P1", 1)
    made = watch(inbox)

    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(append.os, "fsync", full)
        assert not made.step()
        assert not made.step()
    assert len([line for line in made.told if "No space left on device" in line]) == 1, "said once"
    assert (inbox / "P1").is_dir()
    assert made.step()
    assert serials(inbox) == ["P1"]


def test_a_part_that_was_kept_but_not_moved_is_told_again_and_kept_once(
    inbox: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drop(inbox, "P1", 1)
    made = watch(inbox, notifier=Notifier(line_file=str(inbox.parent / "line")))
    with monkeypatch.context() as patch:
        patch.setattr(Path, "rename", lambda *_: (_ for _ in ()).throw(OSError(errno.EACCES, "Permission denied")))
        made.step()
    assert (inbox / "P1").is_dir()
    (inbox.parent / "line").unlink()
    again = watch(inbox, notifier=Notifier(line_file=str(inbox.parent / "line")))
    assert again.step()
    assert serials(inbox) == ["P1"]
    assert "serial=P1" in (inbox.parent / "line").read_text()
    assert names(inbox, "_done/*/*") == ["P1"]


def test_duplicates_are_kept_once_and_overwrite_nothing(inbox: Path) -> None:
    made = watch(inbox)
    for seed in (1, 1, 2):
        drop(inbox, "P1", seed)
        assert made.step()
    assert serials(inbox) == ["P1", "P1"], "the same images once; others are the next round"
    assert names(inbox, "_done/*/*") == ["P1", "P1.2", "P1.3"]


def test_a_clock_that_is_set_back_is_said_and_keeps_the_order(inbox: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drop(inbox, "P1", 1)
    watch(inbox).step()
    monkeypatch.setattr(time, "time_ns", lambda: 10**18)
    monkeypatch.setattr(time, "time", lambda: 1e9)
    made = watch(inbox)
    assert "clock: it is" in made.told[0]
    drop(inbox, "P0", 2)
    assert made.step()
    assert serials(inbox) == ["P1", "P0"]


def test_an_inbox_that_is_away_for_a_while_is_looked_at_again(inbox: Path) -> None:
    drop(inbox, "P1", 1)
    made = watch(inbox)
    away = inbox.rename(inbox.parent / "away")
    assert not made.step()
    assert not made.step()
    assert len(made.told) == 1
    away.rename(inbox)
    assert made.step()


def test_results_are_told_to_a_command_a_server_a_file_and_a_plc(inbox: Path, tmp_path: Path) -> None:
    got: list[dict] = []

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            got.append(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
            self.send_response(204)
            self.end_headers()

        def log_message(self, *_: object) -> None:
            pass

    server = http.server.HTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    plc = socket.create_server(("127.0.0.1", 0))
    script = tmp_path / "on_result.py"
    script.write_text(
        "import sys, os, pathlib\npathlib.Path(sys.argv[1]).write_text(sys.stdin.read() + os.environ['BGARS_VERDICT'])"
    )
    drop(inbox, "P1", 1)
    notifier = Notifier(
        command=f"{sys.executable} {script} {tmp_path / 'told'}",
        url=f"http://127.0.0.1:{server.server_port}/results",
        line_file=str(tmp_path / "line"),
        tcp=f"127.0.0.1:{plc.getsockname()[1]}",
    )
    try:
        made = watch(inbox, notifier=notifier)
        assert made.step()
        connection, _ = plc.accept()
        with connection, connection.makefile() as lines:
            line = lines.readline()
    finally:
        server.shutdown()
        thread.join()
        server.server_close()
        plc.close()
    assert [told["serial"] for told in got] == ["P1"]
    assert line == (tmp_path / "line").read_text()
    assert "serial=P1" in line
    assert "verdict=pass" in line
    assert json.loads((tmp_path / "told").read_text().removesuffix("pass"))["verdict"] == "pass"
    drop(inbox, "P2", 2)
    assert made.step(), "nobody listens any more: the line goes on"
    assert sum("P2: --" in line for line in made.told) == 2


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"url": "ftp://x"}, "--post: must be an http"),
        ({"tcp": "plc"}, "--tcp: must be HOST:PORT"),
        ({"command": "a 'b"}, "--on-result: is no command"),
        ({"command": "no-such-program --fast"}, "--on-result: no-such-program: no such program"),
        ({"command": str(Path(__file__))}, "test_watch.py: no such program, or it may not be run"),
    ],
)
def test_what_cannot_be_told_is_refused_at_the_start(options: dict[str, str], words: str) -> None:
    with pytest.raises(bgars.InputError, match=words):
        Notifier(**options)


def test_a_second_watch_is_refused(inbox: Path) -> None:
    with watched(inbox), pytest.raises(bgars.InputError, match="another bgars watch works on it"), watched(inbox):
        pass
    with pytest.raises(bgars.FileFormatError, match="no such folder"), watched(inbox / "none"):
        pass


@pytest.mark.parametrize("option", ["-o", "--done", "--failed"])
@pytest.mark.parametrize("place", ["results", "results/deep", "."])
def test_no_folder_of_the_watch_lies_among_the_parts(inbox: Path, option: str, place: str) -> None:
    options = {"-o": inbox.parent / "store"} | {option: inbox / place}
    run = CliRunner().invoke(app, ["watch", str(inbox), *(str(word) for pair in options.items() for word in pair)])
    assert "would be taken for a part, as every folder in" in str(run.exception)
    assert list(inbox.iterdir()) == []


def test_sigterm_finishes_the_part_at_hand(tmp_path: Path) -> None:
    inbox = tmp_path / "in"
    inbox.mkdir()
    for name in ("A1", "A2", "A3"):
        copy_capture(inbox / name)
    line = [sys.executable, "-m", "bgars", "watch", inbox, "-o", tmp_path / "store", "--settle", "0", "--poll", "0.02"]
    running = subprocess.Popen([*map(str, line)], stdout=subprocess.PIPE, text=True)
    assert running.stdout is not None
    assert "serial=A1" in running.stdout.readline()
    running.send_signal(signal.SIGTERM)
    out, _ = running.communicate(timeout=60)
    assert running.returncode == 0
    kept = bgars.open_store(tmp_path / "store").query("select serial from parts order by serial")["serial"].to_pylist()
    assert kept in (["A1"], ["A1", "A2"])
    assert len(out.splitlines()) == len(kept) - 1
    assert names(inbox, "_done/*/*") == kept
    assert shutil.which("sh")


@pytest.mark.timeout(300)
def test_kills_at_random_times_lose_nothing_and_double_nothing(tmp_path: Path) -> None:
    """A short one; `make kills` does 200."""
    inbox = tmp_path / "in"
    inbox.mkdir()
    for at, (waiting, done, _) in enumerate(kill_often(inbox, tmp_path / "store", 5, 30), 1):
        assert waiting + done == 30 * min(at, 5) // 5
    assert (waiting, done) == (0, 30)
    assert command(inbox, tmp_path / "store")
