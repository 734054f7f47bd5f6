"""Commands whose modules are loaded when they run, so that ``bgars --help`` and ``--version`` load none of them."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import typer
from typer.core import TyperCommand

from bgars.cli.arguments import CarefulGroup
from bgars.cli.options import METHOD_METAVAR
from bgars.normals.methods import TABLE, method_names

__all__ = ["LAZY_COMMANDS", "LazyGroup"]

LAZY_COMMANDS = {
    "info": ("bgars.cli.describe", "Describe a capture: images, lights, scale, clipped pixels."),
    "check": (
        "bgars.cli.check",
        "Check whether images and lights belong together, and find other faults of a capture.",
    ),
    "mesh": ("bgars.cli.mesh", "Turn a normal map or a height map into a mesh."),
    "shape": ("bgars.cli.shape", "Write images of a surface's shape: slope, curvatures, dents and scratches."),
    "inspect": ("bgars.cli.inspect", "Find, measure and judge the solder balls of a part."),
    "capture": ("bgars.cli.capture", "Take an image under each light with a camera, write a capture folder."),
    "batch": ("bgars.cli.batch", "Inspect many captures into one store: all cores, failures kept with their reason."),
    "watch": ("bgars.cli.watch", "Inspect parts as they arrive: each once, none lost."),
    "report": ("bgars.cli.report", "Write the page of an inspection again, from its result.json."),
    "query": ("bgars.cli.query", "Query a store of results, in SQL."),
    "store": ("bgars.cli.query", "Maintain a store of results."),
    "send": (
        "bgars.cli.send",
        "Send the results of a store to a broker, by MQTT or AMQP 1.0: at least once, in order.",
    ),
    "grr": ("bgars.cli.grr", "Compute how repeatable the gauge is: gauge R&R by analysis of variance."),
    "spc": (
        "bgars.cli.spc",
        "Chart many results over time: X-bar / S or I-MR charts, Cp, Cpk, Pp, Ppk with confidence intervals.",
    ),
    "calibrate": ("bgars.cli.calibrate", "Calibrate what all captures of a station share, and keep it in a file."),
    "init": (
        "bgars.cli.init",
        "Write capture.toml: from these options, or by asking on a terminal.",
    ),
    "teach": (
        "bgars.cli.teach",
        "Write a part recipe from golden parts: layout, empty places, nominal sizes.",
    ),
    "verify": ("bgars.cli.verify", "Compare a station with a part of known sizes: bias, linearity, repeatability."),
    "simulate": ("bgars.cli.simulate", "Render a simulated part with known truth."),
}
"""Of each command, in the order of the help: the module whose ``register`` adds it, and its line in the list."""


class LazyGroup(CarefulGroup):
    """The commands of the app itself, then those of LAZY_COMMANDS."""

    def __init__(self, **settings: Any) -> None:  # noqa: ANN401 - typer's own
        super().__init__(**settings)
        _reflow(self)
        for name, (module, line) in LAZY_COMMANDS.items():
            self.commands[name] = _Listed(name, help=line, module=module)

    def format_help(self, ctx: Any, formatter: Any) -> None:  # noqa: ANN401
        """Show the options of completion, which typer adds last, as the flags that they are."""
        _show_flags(self)
        super().format_help(ctx, formatter)


class _Listed(TyperCommand):
    """A command's name and line; it becomes the command itself where arguments are parsed or completed."""

    def __init__(self, name: str, *, help: str, module: str) -> None:  # noqa: A002 - click's word
        super().__init__(name, help=help)
        self.module = module

    def load(self) -> Any:  # noqa: ANN401 - a command of whichever click typer brings
        """Import the module and return its command."""
        registered = typer.Typer()
        import_module(self.module).register(registered)
        command = typer.main.get_group(registered).commands[str(self.name)]
        _reflow(command)
        return command

    def make_context(self, *args: Any, **settings: Any) -> Any:  # noqa: ANN401
        """Parse the command's arguments: from here on it is the command that works."""
        return self.load().make_context(*args, **settings)


def _with_added_methods(command: Any) -> None:  # noqa: ANN401
    """Let the help of ``--method`` name the methods of installed packages, which are looked for when it is shown."""
    shown = command.format_help

    def format_help(*arguments: Any) -> None:  # noqa: ANN401
        added = [name for name in method_names() if name not in TABLE]
        for option in command.params if added else ():
            if option.name == "method" and option.metavar == METHOD_METAVAR:
                option.help = f"{option.help} Added by others: {', '.join(added)}."
        shown(*arguments)

    command.format_help = format_help


def _show_flags(command: Any) -> None:  # noqa: ANN401
    for option in getattr(command, "params", ()):
        if getattr(option, "is_flag", False):
            option.metavar = ""  # else <bool>, as if they took one


def _reflow(command: Any) -> None:  # noqa: ANN401
    """Join the lines of each paragraph of the help, which the terminal's width then breaks; flags take no value."""
    _show_flags(command)
    own_help = command.get_help_option

    def help_option(context: Any) -> Any:  # noqa: ANN401
        option = own_help(context)
        if option is not None:
            option.metavar = ""
        return option

    command.get_help_option = help_option
    command.help = "\n\n".join(" ".join(text.split()) for text in (command.help or "").split("\n\n"))
    if any(option.name == "method" for option in getattr(command, "params", ())):
        _with_added_methods(command)
    for each in getattr(command, "commands", {}).values():
        _reflow(each)
