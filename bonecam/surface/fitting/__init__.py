"""Fitting a T-spline to a mesh."""
