"""Filters of the mesh family."""

FILTERS: tuple[object, ...] = ()
