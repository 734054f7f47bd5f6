"""Balls in a capture: where they are."""

from bgars.balls.find import find_balls

__all__ = ["find_balls"]
