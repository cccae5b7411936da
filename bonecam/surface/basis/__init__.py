"""Knots, B-spline bases and Bezier extraction."""
