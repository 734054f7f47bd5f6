"""A result on its way to a line: a command, an HTTP server, a PLC."""

from __future__ import annotations

import json
import os
import shlex
import shutil
import socket
import subprocess
import urllib.request
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from bgars.errors import InputError
from bgars.line.credentials import split_address
from bgars.store.append import write_durably
from bgars.version import __version__

if TYPE_CHECKING:
    from collections.abc import Iterator

    from bgars.records.part_identity import PartIdentity
    from bgars.records.part_result import PartResult

__all__ = ["Notifier", "failure_message", "message"]

TIMEOUT_S = 5.0
COMMAND_S = 30.0


@dataclass(frozen=True)
class Notifier:
    """Where results are told.

    Attributes
    ----------
    command : str
        Program and arguments; it gets the message on its standard input, and SERIAL, VERDICT in its environment as
        BGARS_SERIAL, BGARS_VERDICT. No shell.
    url : str
        HTTP server that gets the message by POST.
    line_file : str
        File that holds the line of the last result.
    tcp : str
        HOST:PORT that gets the line of each result.
    """

    command: str = ""
    url: str = ""
    line_file: str = ""
    tcp: str = ""

    def __post_init__(self) -> None:
        """Refuse what cannot be reached, before the first part."""
        if self.url and split_address(self.url, "--post").scheme not in {"http", "https"}:
            msg = f"--post: must be an http:// or https:// address, got {self.url!r}"
            raise InputError(msg)
        if self.url and not _is_url(self.url):
            msg = (
                f"--post: must be a host and a path without spaces, in ASCII (%20 is a space), got {_bare(self.url)!r}"
            )
            raise InputError(msg)
        if self.tcp:
            host, _, port = self.tcp.rpartition(":")
            if not _is_host(host) or not port.isdecimal() or not 0 < int(port) < 1 << 16:
                msg = f"--tcp: must be HOST:PORT, got {self.tcp!r}"
                raise InputError(msg)
        if self.command:
            try:
                words = shlex.split(self.command)
            except ValueError as error:
                msg = f"--on-result: is no command ({error}), got {self.command!r}"
                raise InputError(msg) from None
            if not words or not words[0]:
                msg = f"--on-result: must name a program, got {self.command!r}"
                raise InputError(msg)
            if shutil.which(words[0]) is None:
                msg = f"--on-result: {words[0]}: no such program, or it may not be run"
                raise InputError(msg)

    def send(self, values: dict[str, Any], line: str) -> list[str]:
        """Send a message, and its line; return what went wrong, one line each: the line goes on."""
        problems = []
        for name, action in self._actions(values, line):
            try:
                action()
            except Exception as error:  # an answer that is no HTTP, too: no receiver stops a line
                told = " ".join(str(error).split())
                problems.append(f"{name}: {told or type(error).__name__}")
        return problems

    def _actions(self, values: dict[str, Any], line: str) -> Iterator[Any]:
        if self.line_file:
            yield "--result-file", lambda: write_durably(Path(self.line_file), f"{line}\n".encode())
        if self.tcp:
            yield f"--tcp {self.tcp}", lambda: _send_line(self.tcp, line)
        if self.url:
            yield f"--post {_bare(self.url)}", lambda: _post(self.url, values)
        if self.command:
            yield "--on-result", lambda: _run(self.command, values)


def message(result: PartResult, folder: Path) -> dict[str, Any]:
    """What a line needs of a result."""
    return {
        "serial": result.serial,
        **result.identity.known(),
        "part": result.name,
        "verdict": result.verdict,
        "reasons": list(result.reasons),
        "inspected_utc": result.inspected_utc,
        "balls": len(result.balls),
        "failed_balls": [ball.name for ball in result.balls if ball.verdict == "fail"],
        "folder": str(folder),
        "version": result.version,
    }


def failure_message(
    serial: str, folder: Path, reason: str, *, part: str, identity: PartIdentity, inspected_utc: str
) -> dict[str, Any]:
    """What a line needs of a part that could not be inspected: its verdict is "error"."""
    return {
        "serial": serial,
        **identity.known(),
        "part": part,
        "verdict": "error",
        "reasons": [reason],
        "inspected_utc": inspected_utc,
        "balls": None,
        "failed_balls": [],
        "folder": str(folder),
        "version": __version__,
        "reason": reason,
    }


def _send_line(address: str, line: str) -> None:
    host, _, port = address.rpartition(":")
    with socket.create_connection((host, int(port)), TIMEOUT_S) as connection:
        connection.sendall(f"{line}\n".encode())


def _post(url: str, values: dict[str, Any]) -> None:
    request = urllib.request.Request(
        url, json.dumps(values).encode(), {"Content-Type": "application/json"}, method="POST"
    )
    with urllib.request.urlopen(request, timeout=TIMEOUT_S):
        pass


def _run(command: str, values: dict[str, Any]) -> None:
    told = {"BGARS_SERIAL": str(values["serial"]), "BGARS_VERDICT": str(values["verdict"])}
    subprocess.run(
        shlex.split(command),
        input=json.dumps(values).encode(),
        env={**os.environ, **told},
        timeout=COMMAND_S,
        check=True,
        stdout=subprocess.DEVNULL,
    )


def _is_host(host: str) -> bool:
    """Whether names of hosts look like this."""
    try:
        return bool(host.encode("idna")) and host.isprintable() and " " not in host
    except UnicodeError:  # an empty label, or one of more than 63 characters
        return False


def _is_url(url: str) -> bool:
    """Whether a request can be made of an address."""
    parts = urlsplit(url)
    path = f"{parts.path}?{parts.query}"
    return _is_host(parts.hostname or "") and path.isascii() and path.isprintable() and " " not in path


def _bare(url: str) -> str:
    """The address without user, password and query, which must not come into a log."""
    parts = urlsplit(url)
    return f"{parts.scheme}://{parts.hostname or ''}{f':{parts.port}' if parts.port else ''}{parts.path}"
