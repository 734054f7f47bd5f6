"""Results to a broker: at least once, in order, over restarts of both sides; a real broker where there is one."""

from __future__ import annotations

import json
import shutil
import socket
import subprocess
import threading
import time
from dataclasses import replace
from pathlib import Path

import bgars
import pytest
from bgars.cli.app import app
from bgars.line import send
from bgars.line.send import Mqtt, Sender
from stored_parts import filled_store, part
from typer.testing import CliRunner

client = pytest.importorskip("paho.mqtt.client", reason="paho-mqtt is not installed (pip install 'bgars[mqtt]')")


class Channel:
    """A broker that can be away."""

    name = "test://broker/topic"

    def __init__(self) -> None:
        self.got: list[str] = []
        self.is_away = False

    def send(self, text: str) -> None:
        if self.is_away:
            raise OSError("Connection refused")
        self.got.append(json.loads(text)["serial"])

    def close(self) -> None:
        pass


def test_everything_is_sent_once_in_order_and_what_comes_later_too(tmp_path: Path) -> None:
    store, channel = filled_store(tmp_path / "store", 3), Channel()
    Sender(store, channel).run(follow=False)
    assert channel.got == ["SN0000", "SN0001", "SN0002"]
    store.append(part(3))
    store.compact()
    Sender(store, channel).run(follow=False)
    assert channel.got[3:] == ["SN0003"]


def test_a_broker_that_is_away_gets_everything_when_it_is_back(tmp_path: Path) -> None:
    store, channel, told = filled_store(tmp_path / "store", 2), Channel(), []
    channel.is_away = True
    with pytest.raises(bgars.FileFormatError, match="Connection refused; 0 results sent, the others wait"):
        Sender(store, channel).run(follow=False)
    sender = Sender(store, channel, say=told.append)
    running = threading.Thread(target=sender.run, kwargs={"follow": True, "poll_s": 0.02})
    running.start()
    wait_until(lambda: told)
    channel.is_away = False
    store.append(part(2))
    deadline = time.monotonic() + 60
    while len(channel.got) < 3 and time.monotonic() < deadline:
        time.sleep(0.02)
    sender.is_stopping = True
    running.join()
    assert channel.got == ["SN0000", "SN0001", "SN0002"]
    assert told == ["test://broker/topic: Connection refused; tried again"], "said once"


def test_a_part_that_comes_late_with_a_lower_number_is_sent(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another process took its number earlier and wrote its file later."""
    store, channel = filled_store(tmp_path / "store", 1), Channel()
    Sender(store, channel).run(follow=False)
    number = store.last_sequence() - 1000
    monkeypatch.setattr(store, "_next_sequence", lambda: number)
    store.append(part(1))
    Sender(store, channel).run(follow=False)
    assert channel.got == ["SN0000", "SN0001"]


@pytest.mark.parametrize(
    ("url", "words"),
    [
        ("http://x/y", "must be mqtt://HOST/TOPIC"),
        ("mqtt://host", "must be mqtt://HOST/TOPIC"),
        ("mqtt://ada:secret@host/topic", "go into BGARS_MQTT_USER"),
        ("mqtt://host/line/+/results", r"must be without \+, # and \?"),
        ("mqtt://host/line/#", r"must be without \+, # and \?"),
    ],
)
def test_addresses_are_checked_and_hold_no_password(url: str, words: str) -> None:
    with pytest.raises(bgars.InputError, match=words) as caught:
        Mqtt(url)
    assert "secret" not in str(caught.value)


def test_topics_that_look_alike_as_file_names_are_remembered_apart(tmp_path: Path) -> None:
    store = filled_store(tmp_path / "store", 1)
    (store.folder / "sent").mkdir()
    former = store.folder / "sent" / "mqtt___h_1883_line_results.json"
    former.write_text(json.dumps(dict.fromkeys(store.known(), store.last_sequence())))
    got = {}
    for topic in ("line/results", "line_results", "x" * 300):
        channel = Channel()
        channel.name = f"mqtt://h:1883/{topic}"
        Sender(store, channel).run(follow=False)
        Sender(store, channel).run(follow=False)
        got[topic] = channel.got
    assert got == {"line/results": [], "line_results": ["SN0000"], "x" * 300: ["SN0000"]}, "the first took the old file"
    assert not former.exists()


def test_a_store_in_which_nothing_changes_is_not_queried_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store, asked = filled_store(tmp_path / "store", 1), []
    query = store.query
    monkeypatch.setattr(store, "query", lambda sql: asked.append(sql) or query(sql))
    sender = Sender(store, Channel())
    assert [sender.step() for _ in range(4)] == [1, 0, 0, 0]
    assert len(asked) == 4, "twice with two questions: what there is, and that there is nothing more"
    store.append(part(1))
    assert sender.step() == 1


class Broker:
    """mosquitto, started and killed by the test."""

    def __init__(self, folder: Path) -> None:
        found = shutil.which("mosquitto", path="/usr/sbin:/usr/bin:/usr/local/sbin:/usr/local/bin")
        if found is None:
            pytest.skip("mosquitto is not installed (apt install mosquitto)")
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        config = folder / "mosquitto.conf"
        config.write_text(f"listener {self.port} 127.0.0.1\nallow_anonymous true\n")
        self.command = [found, "-c", str(config)]
        self.got: list[dict] = []

    def start(self) -> None:
        self.process = subprocess.Popen(self.command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.listener = client.Client(client.CallbackAPIVersion.VERSION2)
        self.listener.on_message = lambda _client, _data, message: self.got.append(json.loads(message.payload))
        deadline = time.monotonic() + 120
        while True:
            try:
                self.listener.connect("127.0.0.1", self.port)
                break
            except OSError:
                assert time.monotonic() < deadline
                time.sleep(0.05)
        self.listener.subscribe("line/results", qos=1)
        self.listener.loop_start()
        time.sleep(0.5)

    def kill(self) -> None:
        self.listener.loop_stop()
        self.listener.disconnect()
        self.process.kill()
        self.process.wait()


def test_a_real_broker_gets_every_result_over_its_restart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(send, "ACK_S", 2.0)
    broker = Broker(tmp_path)
    store = filled_store(tmp_path / "store", 3)
    url = f"mqtt://127.0.0.1:{broker.port}/line/results"
    broker.start()
    run = CliRunner().invoke(app, ["send", str(store.folder), "--mqtt", url, "--json"])
    assert json.loads(run.output)["sent"] == 3
    sender = Sender(store, Mqtt(url), is_cfx=True, say=lambda _line: None)
    running = threading.Thread(target=sender.run, kwargs={"follow": True, "poll_s": 0.05})
    running.start()
    wait_until(lambda: sender.sent == 3)
    broker.kill()
    store.append(part(3))
    time.sleep(0.5)
    broker.start()
    wait_until(lambda: sender.sent == 4)
    sender.is_stopping = True
    running.join()
    time.sleep(0.3)
    broker.kill()
    assert [told["serial"] for told in broker.got[:3]] == ["SN0000", "SN0001", "SN0002"]
    units = [told["MessageBody"]["InspectedUnits"][0]["UnitIdentifier"] for told in broker.got[3:]]
    assert list(dict.fromkeys(units)) == ["SN0000", "SN0001", "SN0002", "SN0003"]
    assert broker.got[-1]["MessageName"] == "CFX.Production.TestAndInspection.UnitsInspected"


def wait_until(holds: object) -> None:
    deadline = time.monotonic() + 60
    while not holds():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def test_an_outbox_of_many_parts_is_read_at_once(tmp_path: Path) -> None:
    store = filled_store(tmp_path / "store", 1)
    for number in range(1, 60):
        own = (("a.png", f"{number:064x}"),)
        store.append(replace(part(0), serial=f"SN{number:04d}", files=own))
    sender = Sender(store, channel := Channel())
    assert sender.step() == 60
    assert channel.got == [f"SN{number:04d}" for number in range(60)]
