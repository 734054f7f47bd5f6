"""Solder balls measured from the shadows that they cast."""

from bgars.inspection.measure import check_shadows, measure_balls

__all__ = ["check_shadows", "measure_balls"]
