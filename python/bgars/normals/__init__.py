"""Normals from a light stack: the estimators."""
