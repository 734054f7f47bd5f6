"""Wrong use of the commands of a line: refused before the first part, with one line, and nothing is left."""

from __future__ import annotations

import http.client
import os
import sys
from pathlib import Path

import bgars
import pytest
from bgars.line import notify
from bgars.line.inbox import Inbox
from bgars.line.notify import Notifier
from bgars.line.pages import page_name
from bgars.line.send import Mqtt
from bgars.line.watch import Watch
from line_captures import RECIPE, copy_capture
from test_calibrate import bgars_command


def test_serial_numbers_that_look_alike_as_file_names_have_pages_of_their_own() -> None:
    serials = ["SN_1", "SN/1", "SN'1", "SN\n1", "index", "A", "A.round2", "", "x" * 300, "x" * 301]
    pages = [page_name(serial) for serial in serials] + [page_name("A", 2), "index.html"]
    assert len(set(pages)) == len(pages)
    assert all(len(page) < 90 for page in pages)


@pytest.fixture
def inbox(tmp_path: Path) -> Path:
    (tmp_path / "in").mkdir()
    return tmp_path / "in"


def watching(inbox: Path, **options: Path) -> Watch:
    store = bgars.open_store(inbox.parent / "store", create=True)
    places = {"done": inbox / "_done", "failed": inbox / "_failed"}
    return Watch(Inbox(inbox, count=1, trigger="", settle_s=0.0), store, **{**places, **options})


@pytest.mark.parametrize("place", [".", "done", "done/day", "../in/x"])
@pytest.mark.parametrize("which", ["done", "failed"])
def test_parts_are_not_moved_to_where_they_arrive(inbox: Path, which: str, place: str) -> None:
    with pytest.raises(bgars.InputError, match="would be taken for a part"):
        watching(inbox, **{which: inbox / place})
    assert list(inbox.glob("[!_]*")) == []


@pytest.mark.parametrize("place", ["_done/of/today", ".done", "../done"])
def test_parts_may_be_moved_out_of_sight_or_out_of_the_inbox(inbox: Path, place: str) -> None:
    assert watching(inbox, done=inbox / place).done.is_dir()


def test_a_rig_that_no_capture_could_use_is_refused_before_it_is_copied(inbox: Path) -> None:
    (inbox.parent / "part.toml").write_text(RECIPE, encoding="utf-8")
    with pytest.raises(bgars.InputError, match=r"part\.toml: unknown key 'name'"):
        watching(inbox, rig=inbox.parent / "part.toml")


@pytest.mark.parametrize("name", ["a/b", "../ready", ".."])
def test_a_trigger_is_a_name(inbox: Path, name: str) -> None:
    with pytest.raises(bgars.InputError, match="--trigger: must be the name of a file"):
        Inbox(inbox, count=1, trigger=name, settle_s=0.0)


@pytest.mark.parametrize("port", ["99999", "0"])
def test_a_port_that_cannot_be_is_refused(port: str) -> None:
    with pytest.raises(bgars.InputError, match="--tcp: must be HOST:PORT"):
        Notifier(tcp=f"plc:{port}")


@pytest.mark.parametrize(
    "receiver",
    [
        {"url": "http://plc/a b"},
        {"url": "http:///result"},
        {"url": f"http://{'x' * 64}/result"},
        {"url": "http://plc/größe"},
        {"tcp": f"{'x' * 64}:2000"},
        {"command": " "},
        {"command": "''"},
    ],
)
def test_a_receiver_that_cannot_be_is_refused_before_the_first_part(receiver: dict[str, str]) -> None:
    with pytest.raises(bgars.InputError, match=r"^--(post|tcp|on-result): must"):
        Notifier(**receiver)


@pytest.mark.parametrize("error", [http.client.BadStatusLine("hello"), ValueError("embedded null byte"), KeyError()])
def test_no_receiver_stops_a_line(monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    def post(*_: object) -> None:
        raise error

    monkeypatch.setattr(notify, "_post", post)
    (problem,) = Notifier(url="http://plc/result").send({"serial": "A", "verdict": "pass"}, "line")
    assert problem.startswith("--post http://plc/result: ")
    assert problem.endswith(str(error) or type(error).__name__)


def test_a_serial_number_is_one_printable_line(tmp_path: Path) -> None:
    (tmp_path / "SN1").mkdir()
    (tmp_path / "SN1" / "capture.toml").write_text('[part]\nserial = "A\\u0000B"\n', encoding="utf-8")
    with pytest.raises(bgars.InputError, match=r"serial: must be one printable line, got 'A\\x00B'"):
        bgars.Naming().of_name(tmp_path / "SN1")


@pytest.mark.skipif(os.name == "nt" or sys.platform == "darwin", reason="names there are text")
def test_a_folder_whose_name_is_no_text_is_a_failure_of_its_part_alone(tmp_path: Path) -> None:
    good, bad = copy_capture(tmp_path / "in" / "SN1"), tmp_path / "in" / os.fsdecode(b"SN\xff")
    good.rename(bad)
    listed = copy_capture(tmp_path / "in" / "SN2")
    (listed / "filenames.txt").unlink()
    (listed / "light_00.png").rename(listed / os.fsdecode(b"light_00\xff.png"))
    done = bgars.inspect_many([tmp_path / "in"], store=tmp_path / "store", processes=1)
    assert (done.inspected, len(done.failures)) == (0, 2)
    rows = bgars.open_store(tmp_path / "store").query("select serial, capture_folder, reason from failures").to_pylist()
    told = {Path(row["capture_folder"]).name: (row["serial"], row["reason"]) for row in rows}
    assert told[r"SN\udcff"] == ("", f"{tmp_path}/in/SN\\udcff: its name must be UTF-8")
    assert told["SN2"][1].endswith(r"light_00\udcff.png: its name must be UTF-8")


@pytest.mark.parametrize("url", ["mqtt://user:secret@host:99999/topic", "mqtt://[::1/topic"])
def test_an_address_that_is_none_is_refused_without_its_password(url: str) -> None:
    with pytest.raises(bgars.InputError, match="mqtt: is no address") as refused:
        Mqtt(url)
    assert "secret" not in str(refused.value)
    with pytest.raises(bgars.InputError, match="--post: is no address"):
        Notifier(url=url.replace("mqtt", "http"))


@pytest.mark.parametrize(
    "options",
    [
        ["nothing*"],
        ["nothing"],
        [".", "--recipe", "nothing.toml"],
        [".", "--processes", "99999999999"],
        [".", "--threads", "2000"],
        [".", "--round", "99999999999999999999"],
    ],
)
def test_wrong_use_of_batch_leaves_no_store(tmp_path: Path, options: list[str]) -> None:
    run = bgars_command("batch", tmp_path / options[0], *options[1:], "-o", tmp_path / "store")
    assert run.code == 2, run.stdout
    assert list(tmp_path.iterdir()) == []


def test_adding_no_result_leaves_no_store(tmp_path: Path) -> None:
    run = bgars_command("store", "add", tmp_path / "store", tmp_path / "nothing")
    assert (run.code, list(tmp_path.iterdir())) == (2, [])
