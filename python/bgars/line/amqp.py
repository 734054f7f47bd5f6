"""A node of a message broker that speaks AMQP 1.0, such as RabbitMQ, ActiveMQ, Qpid or Azure Service Bus."""

from __future__ import annotations

import importlib
import json
import logging
import os
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from bgars.errors import InputError
from bgars.line.credentials import credentials, holds_user, split_address

__all__ = ["Amqp"]

ACK_S = 10.0
USER, PASSWORD, CA_FILE = "BGARS_AMQP_USER", "BGARS_AMQP_PASSWORD", "BGARS_AMQP_CA_FILE"
CONTENT_TYPE = 'application/json; charset="utf-8"'


class Amqp:
    """A queue, topic or exchange of an AMQP 1.0 broker; user and password come from the environment or a file.

    Parameters
    ----------
    url : str
        ``amqp://HOST[:PORT]/NODE``, or ``amqps://`` for TLS. NODE is the broker's name of it: ``results``, or after
        another slash ``/queue/results`` where the name begins with one (RabbitMQ 3).

    Raises
    ------
    InputError
        Another kind of address, one with a password in it, a file of certificates that is missing, or
        python-qpid-proton is not installed.
    """

    def __init__(self, url: str) -> None:
        parts = split_address(url, "amqp")
        if parts.scheme not in {"amqp", "amqps"} or not parts.hostname or not parts.path.strip("/"):
            msg = "amqp: must be amqp://HOST/NODE or amqps://HOST/NODE"
            raise InputError(msg)
        if holds_user(parts):
            msg = f"amqp: user and password go into {USER} and {PASSWORD}, not into the address, which comes into logs"
            raise InputError(msg)
        if parts.query or parts.fragment or url.endswith(("#", "?")):
            msg = "amqp: a node's name must be without # and ? (%23 and %3F stand for them)"
            raise InputError(msg)
        self.host, self.is_secure = parts.hostname, parts.scheme == "amqps"
        self.node = unquote(parts.path[1:])
        self.port = parts.port or (5671 if self.is_secure else 5672)
        self.name = f"{parts.scheme}://{self.host}:{self.port}/{self.node}"
        self._user, self._password = credentials(USER, PASSWORD)
        self._proton = _need_proton()
        logging.getLogger("proton").setLevel(logging.CRITICAL)  # what is lost is said here, in one line
        self._ca_file = os.environ.get(CA_FILE, "")
        if self._ca_file and not Path(self._ca_file).is_file():
            msg = f"{CA_FILE}: no such file: {self._ca_file}"
            raise InputError(msg)
        self._domain = self._tls() if self.is_secure else None
        self._connection: Any = None
        self._sender: Any = None

    def send(self, text: str) -> None:
        """Send a message and wait until the broker took it.

        Raises
        ------
        OSError
            It does not answer in time, or refuses.
        """
        # A broker drops a link that was quiet for long: that is no failure yet.
        if self._connection is not None:
            try:
                self._send(text)
            except OSError:
                self.close()
            else:
                return
        self._connect()
        self._send(text)

    def close(self) -> None:
        """Let the broker go; the next message connects anew."""
        connection, self._connection, self._sender = self._connection, None, None
        if connection is not None:
            try:
                connection.close()
            except self._errors():
                pass

    def _send(self, text: str) -> None:
        try:
            delivery = self._sender.send(self._message(text), timeout=ACK_S, error_states=[])
        except self._errors() as error:
            raise OSError(_told(error)) from None
        if delivery.remote_state != delivery.ACCEPTED:  # rejected, released, modified, or settled without a word
            answer = getattr(delivery.remote_state, "name", delivery.remote_state)
            msg = f"the broker did not take a message, its answer is {answer}; is {self.node} full?"
            raise OSError(msg)

    def _message(self, text: str) -> Any:  # noqa: ANN401 - proton's message
        """A durable message; that of IPC-CFX has the properties by which its endpoints choose (IPC-2591)."""
        values = json.loads(text)
        properties: dict[str, str] | None = None
        if "MessageName" in values:
            name = str(values["MessageName"])
            properties = {"cfx-topic": name.rpartition(".")[0], "cfx-message": name}
            properties |= {"cfx-handle": str(values["Source"])} if values.get("Source") else {}
        return self._proton.Message(
            body=text.encode(),
            inferred=True,
            durable=True,
            id=values.get("UniqueID"),
            content_type=CONTENT_TYPE,
            properties=properties,
        )

    def _connect(self) -> None:
        scheme = "amqps" if self.is_secure else "amqp"
        host = f"[{self.host}]" if ":" in self.host else self.host
        options: dict[str, Any] = {"timeout": ACK_S}
        if self._domain is not None:
            options["ssl_domain"] = self._domain
        if self._user:
            # PLAIN over a bare connection is what amqp:// with a password asks for.
            options |= {"user": self._user, "password": self._password, "allow_insecure_mechs": True}
            options["allowed_mechs"] = "PLAIN"  # else a broker that takes anybody would get no user
        try:
            self._connection = self._proton.utils.BlockingConnection(f"{scheme}://{host}:{self.port}", **options)
            # A name of its own: proton's changes at each try, and so would what is said of it.
            self._sender = self._connection.create_sender(self.node, name="bgars", options=self._durable())
        except self._errors() as error:
            self.close()
            hint = "" if self._user or "SASL" not in str(error) else f" (the broker wants a user: {USER}, {PASSWORD})"
            raise OSError(f"{_told(error)}{hint}") from None

    def _tls(self) -> Any:  # noqa: ANN401 - proton's SSLDomain
        ssl = self._proton.SSLDomain
        try:
            domain = ssl(ssl.MODE_CLIENT)
        except self._proton.SSLUnavailable:
            msg = "amqp: python-qpid-proton was built without TLS; docs/line.md says what to install before it"
            raise InputError(msg) from None
        try:
            if self._ca_file:
                domain.set_trusted_ca_db(self._ca_file)
        except self._proton.SSLException:
            msg = f"{CA_FILE}: {self._ca_file}: must hold certificates, as PEM"
            raise InputError(msg) from None
        domain.set_peer_authentication(ssl.VERIFY_PEER_NAME)
        return domain

    def _durable(self) -> Any:  # noqa: ANN401 - proton's option of a link
        """Ask for a queue that outlives the broker, where the broker makes it now: RabbitMQ's default does not."""
        proton = self._proton

        class Durable(proton.reactor.SenderOption):  # type: ignore[misc, name-defined]
            """Sets the durability of the link's target."""

            def apply(self, sender: Any) -> None:  # noqa: ANN401
                sender.target.durability = proton.Terminus.DELIVERIES

        return Durable()

    def _errors(self) -> tuple[type[Exception], ...]:
        return self._proton.ProtonException, OSError


def _told(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__


def _need_proton() -> Any:  # noqa: ANN401 - a module
    try:
        proton = importlib.import_module("proton")
        for part in ("utils", "reactor"):
            importlib.import_module(f"proton.{part}")
    except ImportError:
        msg = "amqp: needs python-qpid-proton, which is not installed; install it with: pip install 'bgars[amqp]'"
        raise InputError(msg) from None
    return proton
