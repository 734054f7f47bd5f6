"""Balls in a capture: where they are."""
