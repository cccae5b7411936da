"""Filters of the levels family."""

FILTERS: tuple[object, ...] = ()
