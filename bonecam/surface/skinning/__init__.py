"""Skinning: one T-spline through rows of points."""
