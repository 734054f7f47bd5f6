"""What a command line must not hold, whichever command it is for."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import typer
from typer.core import TyperGroup

from bgars.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["CarefulGroup"]

MAY_BE_EMPTY = {"--serial", "-s"}


@contextmanager
def _telling_values() -> Iterator[None]:
    """Let the message about a value that does not fit name it: that of the validation behind typer does not."""
    try:
        yield
    except typer.BadParameter as error:
        found: list[dict[str, Any]] = getattr(error.__cause__, "errors", list)()
        if found and "input" in found[0]:
            told = error.message.removeprefix("Value error, ").removesuffix(".")
            error.message = f"{told}; got {found[0]['input']!r}"
        raise


class CarefulGroup(TyperGroup):
    """Commands whose arguments are not empty: a path of no characters would be the current folder."""

    def make_context(self, *arguments: Any, **settings: Any) -> Any:  # noqa: ANN401
        """Read the options that stand before the command."""
        with _telling_values():
            return super().make_context(*arguments, **settings)

    def invoke(self, ctx: Any) -> Any:  # noqa: ANN401
        """Read the options of the command, and run it."""
        with _telling_values():
            return super().invoke(ctx)

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:  # noqa: ANN401 - typer may bring its own click
        """Refuse an empty argument, as of a variable of the shell that is not set."""
        # The shell that asks for completions may well stand at an empty argument.
        for place, argument in enumerate(() if ctx.resilient_parsing else args):
            before = args[place - 1] if place else "bgars"
            name, assigned, value = argument.partition("=")
            if not argument and before not in MAY_BE_EMPTY:
                msg = (
                    f"{before}: is followed by an empty argument (a path of no characters, a variable that is not set?)"
                )
                raise InputError(msg)
            if assigned and not value and name.startswith("--") and name not in MAY_BE_EMPTY:
                msg = f"{name}: must not be empty (a variable that is not set?)"
                raise InputError(msg)
        return super().parse_args(ctx, args)
