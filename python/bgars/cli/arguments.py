"""What a command line must not hold, whichever command it is for."""

from __future__ import annotations

from typing import Any

from typer.core import TyperGroup

from bgars.errors import InputError

__all__ = ["CarefulGroup"]

MAY_BE_EMPTY = {"--serial", "-s"}


class CarefulGroup(TyperGroup):
    """Commands whose arguments are not empty: a path of no characters would be the current folder."""

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
