"""Bounds that hold between the points: a bicubic patch lies in the convex hull of its Bezier control
points."""
