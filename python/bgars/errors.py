"""The exceptions of bgars; every message names file or argument, rule and value."""

from __future__ import annotations

__all__ = [
    "BgarsError",
    "CalibrationError",
    "CaptureWarning",
    "ConvergenceError",
    "FileFormatError",
    "InputError",
    "UnsupportedImageError",
]

LONGEST = 2000
"""Characters of a message."""


class BgarsError(Exception):
    """Base of every exception that bgars raises on purpose; its message is one line of bounded length."""

    def __str__(self) -> str:
        # Decoders end their words in line breaks; a damaged file may put all of itself into a value that is quoted.
        text = " ".join(super().__str__().split("\n")).strip()
        return text if len(text) <= LONGEST else f"{text[: LONGEST // 2]} ... {text[-LONGEST // 4 :]}"


class InputError(BgarsError, ValueError):
    """An argument, a recipe or a capture breaks a rule."""


class CalibrationError(BgarsError):
    """A calibration could not be found or cannot be trusted."""


class ConvergenceError(BgarsError, RuntimeError):
    """An iterative solver stopped before it reached its tolerance.

    Parameters
    ----------
    message : str
        What happened.
    iterations : int
        Iterations done.
    residual : float
        Relative residual reached.
    """

    def __init__(self, message: str, iterations: int, residual: float) -> None:
        super().__init__(message, iterations, residual)
        self.iterations = iterations
        self.residual = residual

    def __str__(self) -> str:
        return str(self.args[0])


class FileFormatError(BgarsError, OSError):
    """A file is missing, unreadable, truncated, or not what its name says."""


class UnsupportedImageError(FileFormatError):
    """A valid image of a kind that the built-in decoders do not read."""


class CaptureWarning(UserWarning):
    """What had to be assumed to read a capture; the command line prints it as a note."""
