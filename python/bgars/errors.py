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


class BgarsError(Exception):
    """Base of every exception that bgars raises on purpose."""


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
