"""Lights of a ring behind a controller that takes lines of text over TCP: change the two words to your controller's.

from led_controller import TextLights
lights = TextLights("192.168.0.7", 5000)
with lights.on(3):
    ...expose...
"""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import contextmanager

SWITCH_ON, SWITCH_OFF = "ON {light}\n", "OFF {light}\n"
ANSWER = b"OK"
TIMEOUT_S = 2.0


class TextLights:
    """Switches one light on while something is exposed; it is off whatever happens."""

    def __init__(self, host: str, port: int) -> None:
        self.link = socket.create_connection((host, port), TIMEOUT_S)

    @contextmanager
    def on(self, light: int) -> Iterator[None]:
        self._say(SWITCH_ON.format(light=light))
        try:
            yield
        finally:
            self._say(SWITCH_OFF.format(light=light))

    def close(self) -> None:
        self.link.close()

    def _say(self, line: str) -> None:
        """Send a line and wait for its answer: only then does the light burn."""
        self.link.sendall(line.encode("ascii"))
        answer = self.link.recv(100)
        if not answer.startswith(ANSWER):
            msg = f"LED controller: answered {answer!r} to {line!r}"
            raise OSError(msg)
