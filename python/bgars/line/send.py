"""Results of a store to a message broker: at least once, in order, over restarts of either side.

The store is the outbox: what was sent is remembered beside it, and what was not is sent when the broker answers again.
"""

from __future__ import annotations

import hashlib
import importlib
import json
import os
import re
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bgars.errors import FileFormatError, InputError
from bgars.io.result_file import RESULT_NAME, parse_result
from bgars.line.cfx import to_cfx
from bgars.line.credentials import credentials, holds_user, split_address
from bgars.line.notify import message
from bgars.store.append import write_durably

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from bgars.store import Store

__all__ = ["Mqtt", "Sender"]

ACK_S = 10.0
BLOCK_PARTS = 500
"""Results of 100 balls take some 50 MB; every look into a store opens all of its files."""
LATE_NS = 3_600 * 10**9
"""A part may come into the store after one of a higher number: so far back it is looked for."""
LONGEST_NAME = 255
LONGEST_PAUSE_S = 60.0
SHOWN = 60
"""Characters of an address in the name of the file that remembers what it got."""
USER, PASSWORD = "BGARS_MQTT_USER", "BGARS_MQTT_PASSWORD"


class Mqtt:
    """A topic of an MQTT broker; user and password come from the environment or a file.

    Parameters
    ----------
    url : str
        ``mqtt://HOST[:PORT]/TOPIC``, or ``mqtts://`` for TLS.

    Raises
    ------
    InputError
        Another kind of address, one with a password in it, or paho-mqtt is not installed.
    """

    def __init__(self, url: str) -> None:
        parts = split_address(url, "mqtt")
        if parts.scheme not in {"mqtt", "mqtts"} or not parts.hostname or not parts.path.strip("/"):
            msg = "mqtt: must be mqtt://HOST/TOPIC or mqtts://HOST/TOPIC"
            raise InputError(msg)
        if parts.query or parts.fragment or url.endswith(("#", "?")) or "+" in parts.path:
            msg = "mqtt: a topic to send to must be without +, # and ?"
            raise InputError(msg)
        if holds_user(parts):
            msg = f"mqtt: user and password go into {USER} and {PASSWORD}, not into the address, which comes into logs"
            raise InputError(msg)
        self.host, self.is_secure, self.topic = parts.hostname, parts.scheme == "mqtts", parts.path.strip("/")
        self.port = parts.port or (8883 if self.is_secure else 1883)
        self.name = f"{parts.scheme}://{self.host}:{self.port}/{self.topic}"
        self._user, self._password = credentials(USER, PASSWORD)
        self._library = _need_paho()
        self._client: Any = None

    def send(self, text: str) -> None:
        """Send a message and wait until the broker has it.

        Raises
        ------
        OSError
            It does not answer in time.
        """
        if self._client is None:
            self._client = self._connected()
        told = self._client.publish(self.topic, text, qos=1)
        try:
            told.wait_for_publish(ACK_S)
        except (RuntimeError, ValueError) as error:
            raise OSError(str(error)) from error
        if not told.is_published():
            self.close()
            msg = f"no answer within {ACK_S:g} s"
            raise OSError(msg)

    def close(self) -> None:
        """Let the broker go; the next message connects anew."""
        if self._client is not None:
            self._client.loop_stop()
            self._client.disconnect()
            self._client = None

    def _connected(self) -> Any:  # noqa: ANN401 - paho's client
        library = self._library
        client = library.Client(library.CallbackAPIVersion.VERSION2, clean_session=True)
        if self._user:
            client.username_pw_set(self._user, self._password or None)
        if self.is_secure:
            client.tls_set()
        client.connect(self.host, self.port, keepalive=30)
        client.loop_start()
        end = time.monotonic() + ACK_S
        while not client.is_connected():
            if time.monotonic() > end:
                client.loop_stop()
                msg = f"no session within {ACK_S:g} s (user, password, TLS?)"
                raise OSError(msg)
            time.sleep(0.01)
        return client


@dataclass
class Sender:
    """What of a store goes to a broker.

    Attributes
    ----------
    store : Store
    channel : Mqtt or Amqp
        Or anything with ``name``, ``send(text)`` and ``close()``.
    is_cfx : bool
        Send IPC-CFX ``UnitsInspected`` instead of the short message.
    say : callable
    """

    store: Store
    channel: Any
    is_cfx: bool = False
    say: Callable[[str], object] = print
    is_stopping: bool = False
    sent: int = 0
    _problem: str = ""
    _state: dict[str, int] = field(default_factory=dict)
    _looked: frozenset[str] | None = None

    def __post_init__(self) -> None:
        """Read what was sent to this place before."""
        try:
            could_be = len(self._former.name) <= LONGEST_NAME
            if could_be and self._former.is_file() and not self._file.exists():
                self._former.replace(self._file)
            text = self._file.read_text(encoding="utf-8") if self._file.is_file() else "{}"
            self._state = {str(key): int(value) for key, value in json.loads(text).items()}
        except (OSError, ValueError, AttributeError) as error:
            msg = f"{self._file}: cannot be read ({error}); remove it to send everything again"
            raise FileFormatError(msg) from None

    @property
    def _file(self) -> Path:
        """Of this place alone: different addresses may be alike as names of files, or too long for one."""
        kind = "cfx" if self.is_cfx else "short"
        own = hashlib.sha256(f"{kind} {self.channel.name}".encode()).hexdigest()[:8]
        return self._former.with_name(f"{self._former.stem[:SHOWN]}-{own}.json")

    @property
    def _former(self) -> Path:
        """As an earlier bgars named it; the first address that would have had it takes it over."""
        name = re.sub(r"[^\w.-]", "_", f"{self.channel.name}{'-cfx' if self.is_cfx else ''}")
        return self.store.folder / "sent" / f"{name}.json"

    def run(self, *, follow: bool, poll_s: float = 1.0) -> None:
        """Send what was not sent; with `follow`, go on until :attr:`is_stopping`.

        Raises
        ------
        FileFormatError
            Without `follow`, the broker does not answer.
        """
        pause_s = poll_s
        while not self.is_stopping:
            try:
                count = self.step()
                pause_s, self._problem = poll_s, ""
            except OSError as error:
                self.channel.close()
                if isinstance(error, FileFormatError):
                    raise
                problem = f"{self.channel.name}: {error}"
                if not follow:
                    msg = f"{problem}; {self.sent} results sent, the others wait in the store"
                    raise FileFormatError(msg) from None
                if problem != self._problem:
                    self.say(f"{problem}; tried again")
                self._problem, count = problem, 0
                pause_s = min(LONGEST_PAUSE_S, 2 * pause_s)
            if count == 0:
                if not follow:
                    break
                end = time.monotonic() + pause_s
                while not self.is_stopping and time.monotonic() < end:
                    time.sleep(min(0.1, pause_s))
        self.channel.close()

    def step(self) -> int:
        """Send the next parts in their order; return how many. Each is remembered when the broker has it."""
        files = frozenset(path.path for path in _files(self.store.folder / "parts"))
        if files == self._looked:  # DuckDB would read them all
            return 0
        count = 0
        since = max(self._state.values(), default=0) - LATE_NS
        rows = self.store.query(
            f"select sequence, part_key, capture_folder from inspections where sequence > {since} order by sequence"
        ).to_pylist()
        rows = [row for row in rows if row["part_key"] not in self._state]
        block = ", ".join(f"'{row['part_key']}'" for row in rows[:BLOCK_PARTS])
        found = self.store.query(f"select part_key, result_json from results where part_key in ({block or 'NULL'})")
        texts = {row["part_key"]: row["result_json"] for row in found.to_pylist()}
        for row in (row for row in rows[:BLOCK_PARTS] if row["part_key"] in texts):
            if self.is_stopping:
                break
            result = parse_result(texts[row["part_key"]].encode(), self.store.folder / RESULT_NAME)
            values = to_cfx(result) if self.is_cfx else message(result, Path(row["capture_folder"]))
            self.channel.send(json.dumps(values, ensure_ascii=False))
            self._state[row["part_key"]] = row["sequence"]
            newest = max(self._state.values())
            self._state = {key: at for key, at in self._state.items() if at > newest - 2 * LATE_NS or at == newest}
            write_durably(self._file, json.dumps(self._state).encode())
            count += 1
            self.sent += 1
        if not rows:
            self._looked = files
        return count


def _files(folder: Path, depth: int = 2) -> Iterator[os.DirEntry[str]]:
    """Files of a table, in its folders by day and recipe; what goes meanwhile is left out."""
    try:
        with os.scandir(folder) as entries:
            found = list(entries)
    except (FileNotFoundError, NotADirectoryError):
        return
    for entry in found:
        if depth:
            yield from _files(Path(entry.path), depth - 1)
        else:
            yield entry


def _need_paho() -> Any:  # noqa: ANN401 - a module
    try:
        return importlib.import_module("paho.mqtt.client")
    except ImportError:
        msg = "mqtt: needs paho-mqtt, which is not installed; install it with: pip install 'bgars[mqtt]'"
        raise InputError(msg) from None
