"""Surfaces from normals: integration, anchors, meshes, shape images."""
