"""The command ``bgars``."""

import sys

__all__ = ["main"]

EXIT_INTERRUPTED = 130


def main() -> None:
    """Run the command; Ctrl-C ends it without a traceback, while its modules are loaded, too."""
    try:
        from bgars.cli import app  # noqa: PLC0415 - what is not loaded yet cannot be interrupted with a word of its own

        app.main()
    except KeyboardInterrupt:
        sys.exit(EXIT_INTERRUPTED)
