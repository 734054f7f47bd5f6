"""Results over AMQP 1.0 to a real RabbitMQ, with user and password, over a power cut of the broker."""

from __future__ import annotations

import json
import os
import shutil
import signal
import socket
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import bgars
import pytest
from bgars.line import amqp
from bgars.line.amqp import Amqp
from bgars.line.send import Sender
from stored_parts import filled_store, part

utils = pytest.importorskip("proton.utils", reason="python-qpid-proton is not installed (pip install 'bgars[amqp]')")

CONFIG = """
listeners.tcp.1 = 127.0.0.1:{port}
default_user = ada
default_pass = s3cret
"""
NODE = "/queue/results"


class RabbitMq:
    """A RabbitMQ of Debian with its plugin for AMQP 1.0, in a folder of its own."""

    def __init__(self, folder: Path) -> None:
        server = Path("/usr/lib/rabbitmq/bin/rabbitmq-server")
        if not server.exists() or shutil.which("erl") is None:
            pytest.skip("RabbitMQ is not installed (apt install rabbitmq-server)")
        self.port, distribution, self.mapper = (free_port() for _ in range(3))
        (folder / "plugins").write_text("[rabbitmq_amqp1_0].\n")
        (folder / "rabbit.conf").write_text(CONFIG.format(port=self.port))
        self.log = folder / "out.log"
        self.server = server
        self.environment = os.environ | {
            "HOME": str(folder),
            "RABBITMQ_NODENAME": f"bgars{self.port}@localhost",
            "RABBITMQ_DIST_PORT": str(distribution),
            "ERL_EPMD_PORT": str(self.mapper),
            "ERL_EPMD_RELAXED_COMMAND_CHECK": "1",
            "RABBITMQ_MNESIA_BASE": str(folder / "data"),
            "RABBITMQ_LOG_BASE": str(folder / "log"),
            "RABBITMQ_PID_FILE": str(folder / "pid"),
            "RABBITMQ_ENABLED_PLUGINS_FILE": str(folder / "plugins"),
            "RABBITMQ_CONFIG_FILE": str(folder / "rabbit.conf"),
            "RABBITMQ_CONF_ENV_FILE": "/dev/null",
            "RABBITMQ_SERVER_ADDITIONAL_ERL_ARGS": "+S 1:1",
        }

    def start(self) -> None:
        with self.log.open("ab") as log:
            self.process = subprocess.Popen(
                [str(self.server)], env=self.environment, stdout=log, stderr=log, start_new_session=True
            )
        deadline = time.monotonic() + 150
        while True:
            try:
                socket.create_connection(("127.0.0.1", self.port), 1).close()
                return
            except OSError:
                assert self.process.poll() is None, self.log.read_text()
                assert time.monotonic() < deadline, self.log.read_text()
                time.sleep(0.2)

    def kill(self) -> None:
        """As a power cut does."""
        os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()

    def end(self) -> None:
        self.kill()
        epmd = shutil.which("epmd")
        if epmd is not None:  # the name server that Erlang leaves behind, at our own port
            subprocess.run([epmd, "-port", str(self.mapper), "-kill"], check=False, capture_output=True)

    def received(self, count: int) -> list[str]:
        connection = utils.BlockingConnection(
            f"amqp://127.0.0.1:{self.port}",
            user="ada",
            password="s3cret",
            allow_insecure_mechs=True,
            allowed_mechs="PLAIN",
            timeout=30,
        )
        receiver = connection.create_receiver(f"/amq{NODE}", credit=count)
        serials = []
        for _ in range(count):
            message = receiver.receive(timeout=30)
            assert message.properties["cfx-message"].endswith("UnitsInspected")
            units = json.loads(bytes(message.body))["MessageBody"]["InspectedUnits"]
            serials.append(units[0]["UnitIdentifier"])
            receiver.accept()
        connection.close()
        return serials


def free_port() -> int:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port: int = free.getsockname()[1]
        return port


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[RabbitMq]:
    (tmp_path / "rabbit").mkdir()
    made = RabbitMq(tmp_path / "rabbit")
    try:
        made.start()
        yield made
    finally:
        made.end()


def test_rabbitmq_has_every_result_after_a_power_cut(
    tmp_path: Path, broker: RabbitMq, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(amqp.USER, "ada")
    monkeypatch.setenv(amqp.PASSWORD, "wrong")
    monkeypatch.setattr(amqp, "ACK_S", 30.0)
    store = filled_store(tmp_path / "store", 2)
    url = f"amqp://127.0.0.1:{broker.port}/{NODE}"
    with pytest.raises(bgars.FileFormatError, match=r"0 results sent, the others wait") as caught:
        Sender(store, Amqp(url), is_cfx=True).run(follow=False)
    assert "wrong" not in str(caught.value)
    monkeypatch.delenv(amqp.USER)
    with pytest.raises(bgars.FileFormatError, match=r"\(the broker wants a user: BGARS_AMQP_USER"):
        Sender(store, Amqp(url), is_cfx=True).run(follow=False)
    monkeypatch.setenv(amqp.USER, "ada")
    monkeypatch.setenv(amqp.PASSWORD, "s3cret")
    sender = Sender(store, Amqp(url), is_cfx=True)
    assert sender.step() == 2
    broker.kill()
    store.append(part(2))
    with pytest.raises(OSError, match=r"refused|disconnected"):
        sender.step()
    broker.start()
    assert sender.step() == 1
    sender.channel.close()
    assert broker.received(3) == ["SN0000", "SN0001", "SN0002"]
