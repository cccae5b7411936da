"""Filters of the surface family."""

FILTERS: tuple[object, ...] = ()
