"""Triangles within a chord tolerance of a surface."""
