"""Cones of tool axes: their surface, and where it meets others."""
