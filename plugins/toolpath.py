"""Filters of the toolpath family."""

FILTERS: tuple[object, ...] = ()
