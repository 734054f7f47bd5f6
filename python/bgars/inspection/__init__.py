"""Solder balls measured from the shadows that they cast."""

from bgars.inspection.checks import check_shadows
from bgars.inspection.measure import measure_balls

__all__ = ["check_shadows", "measure_balls"]
