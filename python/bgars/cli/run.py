"""Running a command: an error becomes one line and an exit code."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from bgars.cli import EXIT_INTERRUPTED
from bgars.cli.console import EXIT_BAD_INPUT, fail, notes_to_stderr
from bgars.cli.stopping import sigterm_as_ctrl_c
from bgars.errors import BgarsError
from bgars.extras import EXTRA_OF, how_to_install

if TYPE_CHECKING:
    import typer

__all__ = ["run"]

EXIT_TERMINATED = 143


def run(app: typer.Typer) -> None:
    """Run a command; an error becomes one line and exit code 2 (wrong use: 2 too, Ctrl-C: 130, SIGTERM: 143)."""
    notes_to_stderr()
    ended = sigterm_as_ctrl_c()
    try:
        app()
    except SystemExit as end:
        if end.code != EXIT_INTERRUPTED:
            raise
        sys.stderr.write("interrupted; nothing half-written stays behind\n")
        sys.exit(EXIT_TERMINATED if ended else EXIT_INTERRUPTED)
    except BgarsError as error:
        fail(str(error))
    except ModuleNotFoundError as error:
        if error.name not in EXTRA_OF:
            raise
        fail(f"this command {how_to_install(error.name)}")
    except MemoryError as error:
        fail(str(error) or "there is not enough memory for this; use fewer or smaller images")
    except RecursionError:
        fail("a file is nested too deeply to be read")
    except OSError as error:
        # A disk that is full, a name that is too long: no defect, and nothing that a trace explains.
        name = "" if error.filename is None else f"{error.filename}: "
        fail(f"{name}{error.strerror or error}")
    else:
        return
    sys.exit(EXIT_BAD_INPUT)
