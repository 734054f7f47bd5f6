"""A small AMQP 1.0 broker of a single process, made with qpid-proton's reactor: it takes messages and keeps them.

A node of the name ``REJECTED``, ``RELEASED`` or ``MODIFIED`` answers so. It speaks the real protocol over real sockets,
with TLS where a certificate is given, and can be killed and started again at its port.
"""

from __future__ import annotations

import json
import socket
import subprocess
import sys
import time
from pathlib import Path

SERVER = """
import json
import sys
from proton.handlers import MessagingHandler
from proton.reactor import Container

port, kept, certificate, key = sys.argv[1:5]


class Broker(MessagingHandler):
    def on_start(self, event):
        if certificate:
            domain = event.container.ssl.server
            domain.set_credentials(certificate, key, None)
        event.container.listen(f"{'amqps' if certificate else 'amqp'}://127.0.0.1:{port}")

    def on_link_opening(self, event):
        if event.link.is_receiver:
            event.link.target.address = event.link.remote_target.address

    def on_message(self, event):
        message, address = event.message, event.link.remote_target.address
        answer = getattr(event.delivery, address, event.delivery.ACCEPTED)  # REJECTED, RELEASED, MODIFIED as nodes
        event.delivery.update(answer)
        event.delivery.settle()
        with open(kept, "a", encoding="utf-8") as file:
            told = [address, bytes(message.body).decode(), message.properties, message.content_type, message.durable]
            file.write(json.dumps(told) + chr(10))


Container(Broker(auto_accept=False)).run()
"""


class AmqpBroker:
    def __init__(self, folder: Path, *, certificate: Path | None = None, key: Path | None = None) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.kept = folder / "kept.jsonl"
        self.log = folder / "broker.log"
        arguments = [str(self.port), str(self.kept), str(certificate or ""), str(key or "")]
        self.command = [sys.executable, "-c", SERVER, *arguments]

    def start(self) -> None:
        with self.log.open("ab") as log:
            self.process = subprocess.Popen(self.command, stdout=log, stderr=log)
        deadline = time.monotonic() + 60
        while True:
            try:
                socket.create_connection(("127.0.0.1", self.port), 1).close()
                return
            except OSError:
                assert time.monotonic() < deadline, self.log.read_text()
                time.sleep(0.05)

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()

    @property
    def got(self) -> list[list]:
        return [json.loads(line) for line in self.kept.read_text().splitlines()] if self.kept.exists() else []
