"""Results over AMQP 1.0: at least once, in order, over restarts of the broker, by TLS, no password in any log."""

from __future__ import annotations

import json
import shutil
import subprocess
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import bgars
import pytest
from amqp_broker import AmqpBroker
from bgars.cli.app import app
from bgars.line import amqp
from bgars.line.amqp import Amqp
from bgars.line.credentials import credentials
from bgars.line.send import Sender
from stored_parts import filled_store, part
from typer.testing import CliRunner

pytest.importorskip("proton", reason="python-qpid-proton is not installed (pip install 'bgars[amqp]')")


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[AmqpBroker]:
    made = AmqpBroker(tmp_path)
    made.start()
    yield made
    made.kill()


def units(broker: AmqpBroker) -> list[str]:
    return [json.loads(row[1])["MessageBody"]["InspectedUnits"][0]["UnitIdentifier"] for row in broker.got]


def test_the_command_sends_what_endpoints_of_cfx_choose_by(tmp_path: Path, broker: AmqpBroker) -> None:
    store = filled_store(tmp_path / "store", 2)
    url = f"amqp://127.0.0.1:{broker.port}/line3.results"
    for expected in (2, 0):
        run = CliRunner().invoke(app, ["send", str(store.folder), "--amqp", url, "--cfx", "--json"])
        assert json.loads(run.output)["sent"] == expected, "once"
    assert units(broker) == ["SN0000", "SN0001"]
    node, text, properties, content_type, durable = broker.got[0]
    assert (node, durable) == ("line3.results", True)
    assert content_type == 'application/json; charset="utf-8"'
    assert properties == {
        "cfx-topic": "CFX.Production.TestAndInspection",
        "cfx-message": "CFX.Production.TestAndInspection.UnitsInspected",
    }
    assert json.loads(text)["MessageName"] == properties["cfx-message"]


def test_a_broker_that_restarts_gets_what_it_missed_in_order(
    tmp_path: Path, broker: AmqpBroker, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(amqp, "ACK_S", 5.0)
    store = filled_store(tmp_path / "store", 2)
    told: list[str] = []
    channel = Amqp(f"amqp://127.0.0.1:{broker.port}/results")
    sender = Sender(store, channel, is_cfx=True, say=told.append)
    running = threading.Thread(target=sender.run, kwargs={"follow": True, "poll_s": 0.05})
    running.start()
    try:
        wait_until(lambda: sender.sent == 2)
        broker.kill()
        store.append(part(2))
        store.append(part(3))
        wait_until(lambda: told)
        broker.start()
        wait_until(lambda: sender.sent == 4)
    finally:
        sender.is_stopping = True
        running.join()
    assert list(dict.fromkeys(units(broker))) == ["SN0000", "SN0001", "SN0002", "SN0003"]
    assert len(told) == 1, "said once"
    assert "tried again" in told[0]


def test_a_link_that_was_dropped_in_a_quiet_hour_is_no_failure(tmp_path: Path, broker: AmqpBroker) -> None:
    store = filled_store(tmp_path / "store", 1)
    sender = Sender(store, Amqp(f"amqp://127.0.0.1:{broker.port}/results"), is_cfx=True)
    assert sender.step() == 1
    broker.kill()
    broker.start()
    store.append(part(1))
    assert sender.step() == 1
    sender.channel.close()
    assert units(broker) == ["SN0000", "SN0001"]


def test_tls_needs_an_authority_that_is_trusted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if shutil.which("openssl") is None:
        pytest.skip("openssl is not installed")
    certificate, key = tmp_path / "own.pem", tmp_path / "own.key"
    subprocess.run(
        [
            *("openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=127.0.0.1"),
            *("-addext", "subjectAltName=DNS:localhost,IP:127.0.0.1", "-keyout", str(key), "-out", str(certificate)),
        ],
        check=True,
        capture_output=True,
    )
    monkeypatch.setattr(amqp, "ACK_S", 5.0)
    broker = AmqpBroker(tmp_path, certificate=certificate, key=key)
    broker.start()
    store = filled_store(tmp_path / "store", 1)
    url = f"amqps://localhost:{broker.port}/results"
    try:
        with pytest.raises(bgars.FileFormatError, match="0 results sent, the others wait in the store"):
            Sender(store, Amqp(url)).run(follow=False)
        assert broker.got == []
        monkeypatch.setenv(amqp.CA_FILE, str(certificate))
        Sender(store, Amqp(url)).run(follow=False)
    finally:
        broker.kill()
    assert [json.loads(row[1])["serial"] for row in broker.got] == ["SN0000"]
    (tmp_path / "empty.pem").write_text("no certificate")
    monkeypatch.setenv(amqp.CA_FILE, str(tmp_path / "empty.pem"))
    with pytest.raises(bgars.InputError, match=r"BGARS_AMQP_CA_FILE: .*empty.pem: must hold certificates"):
        Amqp(url)
    monkeypatch.setenv(amqp.CA_FILE, str(tmp_path / "gone.pem"))
    with pytest.raises(bgars.InputError, match="BGARS_AMQP_CA_FILE: no such file"):
        Amqp(url)


@pytest.mark.parametrize(
    ("url", "words"),
    [
        ("http://x/y", "must be amqp://HOST/NODE"),
        ("amqp://host", "must be amqp://HOST/NODE"),
        ("amqp://ada:secret@host/results", "go into BGARS_AMQP_USER"),
        ("amqp://ada:secret#1@host/results", "is no address"),
        ("amqp://ada:s/secret@host/results", "is no address"),
        ("amqp://ada:12/secret@host/results", "go into BGARS_AMQP_USER"),
        ("amqp://host/results?secret=1", "must be without # and"),
        ("amqp://host:99999/results", "a port of 1 to 65535"),
    ],
)
def test_addresses_are_checked_and_hold_no_password(url: str, words: str) -> None:
    with pytest.raises(bgars.InputError, match=words) as caught:
        Amqp(url)
    assert "secret" not in str(caught.value)


@pytest.mark.parametrize("answer", ["REJECTED", "RELEASED", "MODIFIED"])
def test_what_the_broker_did_not_take_was_not_sent(tmp_path: Path, broker: AmqpBroker, answer: str) -> None:
    store = filled_store(tmp_path / "store", 1)
    url = f"amqp://127.0.0.1:{broker.port}/{answer}"
    for _ in range(2):
        words = rf"did not take a message, its answer is {answer}; is {answer} full\?; 0 results sent"
        with pytest.raises(bgars.FileFormatError, match=words):
            Sender(store, Amqp(url)).run(follow=False)
    assert not (store.folder / "sent").exists()


def test_a_node_may_begin_with_a_slash() -> None:
    assert Amqp("amqp://host//queue/results").node == "/queue/results"
    assert Amqp("amqp://host/%2Fqueue%2Fresults").node == "/queue/results"


def test_a_password_may_lie_in_a_file_and_stays_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "password"
    file.write_text("s3cret\n")
    monkeypatch.setenv(amqp.USER, "ada")
    monkeypatch.setenv(f"{amqp.PASSWORD}_FILE", str(file))
    assert credentials(amqp.USER, amqp.PASSWORD) == ("ada", "s3cret")
    channel = Amqp("amqp://127.0.0.1:1/results")
    with pytest.raises(OSError, match="refused") as caught:
        channel.send("{}")
    assert "s3cret" not in f"{caught.value}{channel.name}{channel!r}"
    file.unlink()
    with pytest.raises(bgars.InputError, match=r"BGARS_AMQP_PASSWORD_FILE: .*cannot be read"):
        credentials(amqp.USER, amqp.PASSWORD)


def test_a_user_is_never_sent_to_a_broker_that_takes_anybody(
    broker: AmqpBroker, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(amqp.USER, "ada")
    monkeypatch.setenv(amqp.PASSWORD, "s3cret")
    with pytest.raises(OSError, match="Authentication failed") as caught:
        Amqp(f"amqp://127.0.0.1:{broker.port}/results").send("{}")
    assert "s3cret" not in str(caught.value)
    assert broker.got == []


def test_one_broker_is_named(tmp_path: Path) -> None:
    store = filled_store(tmp_path / "store", 1)
    for options in ([], ["--mqtt", "mqtt://h/t", "--amqp", "amqp://h/q"]):
        run = CliRunner().invoke(app, ["send", str(store.folder), *options])
        assert "give one of them" in str(run.exception)


def wait_until(holds: object) -> None:
    deadline = time.monotonic() + 60
    while not holds():
        assert time.monotonic() < deadline
        time.sleep(0.02)
