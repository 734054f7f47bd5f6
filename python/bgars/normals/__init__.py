"""Normals from a light stack: the estimators, and the table of their names."""

from bgars.normals.methods import DEFAULT_METHOD, METHODS, Method

__all__ = ["DEFAULT_METHOD", "METHODS", "Method"]
