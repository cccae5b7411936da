"""Sections of a blade that end at a blunt edge: told from one side of a blade, and closed by half circles over it."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import unit
from bonecam.surface.skinning.point_rows import PointRows
from bonecam.surface.tspline import TSpline

BLUNT = 0.02
"""Sections whose ends lie farther apart than this share of their length are one side of a blade."""
INSERTED = 7
"""Points on each half circle."""
SECTIONS = 9
"""So many sections of a surface are looked at,"""
PLACES = 101
"""and so many places on each."""


def widest_edge(rows: PointRows) -> float:
    """The largest distance between the two ends of an open section, mm; 0 of closed ones."""
    return 0.0 if rows.closed else max(float(np.linalg.norm(row[0] - row[-1])) for row in rows.rows)


def has_blunt_edge(surface: TSpline) -> bool:
    """Whether a surface that is open in s bounds a blade up to a blunt edge: it is no one side of a blade."""
    if surface.closed_in_s:
        return False
    (left, right), (low, high) = surface.domain
    s, t = np.meshgrid(np.linspace(left, right, PLACES), np.linspace(low, high, SECTIONS))
    rows = surface.positions(s.ravel(), t.ravel()).reshape(SECTIONS, PLACES, 3)
    return all(_nearly_closed(row) for row in rows)


def rounded_edge(rows: PointRows) -> PointRows:
    """The rows closed by half circles that stand out of their blunt edges by half of their widths; unchanged where they
    are closed, or where one is open by more than BLUNT of its length."""
    if rows.closed or not all(_nearly_closed(row) for row in rows.rows):
        return rows
    return PointRows(tuple(_closed(row) for row in rows.rows), rows.poles, closed=True)


def _nearly_closed(row: Float[ndarray, "p 3"]) -> bool:
    """Whether the ends of a section are no farther apart than a blunt edge is wide."""
    length = float(np.linalg.norm(np.diff(row, axis=0), axis=1).sum())
    return float(np.linalg.norm(row[0] - row[-1])) <= BLUNT * length


def _closed(row: Float[ndarray, "p 3"]) -> Float[ndarray, "q 3"]:
    """A row that goes on from its end to its start on a half circle, in the plane of that and the way it ends."""
    middle = (row[0] + row[-1]) / 2
    half = (row[-1] - row[0]) / 2
    size = float(np.linalg.norm(half))
    ends = unit(np.array([row[-1] - row[-2], row[0] - row[1]])).sum(axis=0)
    across = half / size
    out = unit((ends - (ends @ across) * across)[None])[0]
    angle = np.pi * np.arange(1, INSERTED + 1)[:, None] / (INSERTED + 1)
    return np.vstack([row, middle + np.cos(angle) * half + np.sin(angle) * size * out])
