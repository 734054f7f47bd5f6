"""The command ``bgars``."""

import gc
import os
import sys

__all__ = ["main"]

EXIT_INTERRUPTED = 130
BLAS_THREADS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""What says how many threads numpy's matrix library starts."""


def main() -> None:
    """Run the command; Ctrl-C ends it without a traceback, while its modules are loaded, too."""
    # Matrices are small here: more threads than one would wait for work in a loop, on the time of those that have some.
    for name in BLAS_THREADS:
        os.environ.setdefault(name, "1")
    try:
        from bgars.cli import app, console  # noqa: PLC0415 - only what is loaded here is interrupted in silence

        console.is_command()
        app.main()
    except KeyboardInterrupt:
        sys.exit(EXIT_INTERRUPTED)
    finally:
        # Python looks for garbage once more when it ends, a tenth of a second in all that was imported.
        gc.freeze()
