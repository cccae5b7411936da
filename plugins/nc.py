"""Filters of the nc family."""

FILTERS: tuple[object, ...] = ()
