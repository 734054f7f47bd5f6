"""Inspection of a part's balls: measurement, reference planes, positions, limits, verdict."""
