"""Closest points on a surface and on triangles."""
