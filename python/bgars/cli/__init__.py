"""The command ``bgars``."""

from bgars.cli.app import main

__all__ = ["main"]
