"""The command ``bgars send``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bgars.cli.console import print_json, say
from bgars.cli.options import JsonOption
from bgars.cli.stopping import ended_by_signals
from bgars.errors import InputError
from bgars.line.amqp import Amqp
from bgars.line.send import Mqtt, Sender
from bgars.store import open_store

__all__ = ["register"]


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("send")(send)


def send(
    store: Annotated[
        Path, typer.Argument(metavar="STORE", help="Store that bgars batch or bgars watch writes.", show_default=False)
    ],
    mqtt: Annotated[
        str,
        typer.Option(
            metavar="mqtt://HOST/TOPIC",
            help="MQTT broker and topic; mqtts:// for TLS. User and password: BGARS_MQTT_USER, BGARS_MQTT_PASSWORD.",
            show_default=False,
        ),
    ] = "",
    amqp: Annotated[
        str,
        typer.Option(
            metavar="amqp://HOST/NODE",
            help="AMQP 1.0 broker and its queue, topic or exchange; amqps:// for TLS. User and password: "
            "BGARS_AMQP_USER, BGARS_AMQP_PASSWORD.",
            show_default=False,
        ),
    ] = "",
    cfx: Annotated[
        bool, typer.Option("--cfx", help="Send IPC-CFX UnitsInspected instead of the short message.")
    ] = False,
    follow: Annotated[
        bool,
        typer.Option("--follow", help="Keep sending as parts arrive, across restarts of the broker, until stopped."),
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Send the results of a store to a broker, by MQTT or AMQP 1.0: at least once, in order.

    The store is the outbox. Parts that the broker has acknowledged are recorded in STORE/sent; the others are sent when
    it answers again, after growing pauses of a minute at most.

    Passwords are read from the environment, or from the file that BGARS_MQTT_PASSWORD_FILE or BGARS_AMQP_PASSWORD_FILE
    names. TLS trusts the system's authorities; BGARS_AMQP_CA_FILE names another file of them.

    Exit code 0: everything was sent, or --follow was ended. 2: wrong use, or the broker does not answer.
    """
    if bool(mqtt) == bool(amqp):
        msg = "--mqtt or --amqp: give one of them"
        raise InputError(msg)
    sender = Sender(open_store(store), Mqtt(mqtt) if mqtt else Amqp(amqp), cfx, say=say)
    with ended_by_signals(sender):
        sender.run(follow=follow)
    if as_json:
        print_json({"sent": sender.sent, "to": sender.channel.name})
    else:
        say(f"{sender.sent} results sent to {sender.channel.name}")
