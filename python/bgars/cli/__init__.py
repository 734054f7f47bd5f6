"""The command ``bgars``."""

import sys

__all__ = ["main"]

EXIT_INTERRUPTED = 130


def main() -> None:
    """Run the command; Ctrl-C ends it without a traceback, while its modules are loaded, too."""
    try:
        from bgars.cli import app, console  # noqa: PLC0415 - only what is loaded here is interrupted in silence

        console.is_command()
        app.main()
    except KeyboardInterrupt:
        sys.exit(EXIT_INTERRUPTED)
