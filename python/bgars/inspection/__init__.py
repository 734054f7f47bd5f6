"""Solder balls measured from the shadows that they cast."""

from bgars.inspection.measure import measure_balls

__all__ = ["measure_balls"]
