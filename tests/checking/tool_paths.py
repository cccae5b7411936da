"""Paths that several tests of posting write."""

from small_parts import capsule_path

THREE_PATHS = [
    capsule_path(level=5, radius=2.0, offset=1.5, count=60),
    capsule_path(level=4, radius=2.0, offset=1.0, count=60),
    capsule_path(level=0, radius=1.0, number=2, count=60),
]
"""Two roughing levels and one of another tool."""


TWO_PATHS = (
    capsule_path(level=5, radius=2.0, offset=1.5, number=1, count=150),
    capsule_path(level=0, radius=1.0, number=2, count=150),
)
"""A level cut for roughing, and the last one for finishing."""
