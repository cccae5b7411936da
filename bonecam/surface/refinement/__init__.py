"""Exact refinement: more control points, the same surface."""
