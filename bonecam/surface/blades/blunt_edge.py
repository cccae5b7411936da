"""Sections of a blade that end at a blunt edge, closed by half circles over it."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import unit
from bonecam.surface.skinning.point_rows import PointRows

BLUNT = 0.02
"""Sections whose ends lie farther apart than this share of their length are one side of a blade."""
INSERTED = 7
"""Points on each half circle."""


def widest_edge(rows: PointRows) -> float:
    """The largest distance between the two ends of an open section, mm; 0 of closed ones."""
    return 0.0 if rows.closed else max(float(np.linalg.norm(row[0] - row[-1])) for row in rows.rows)


def rounded_edge(rows: PointRows) -> PointRows:
    """The rows closed by half circles that stand out of their blunt edges by half of their widths; unchanged where they
    are closed, or where one is open by more than BLUNT of its length."""
    lengths = [np.linalg.norm(np.diff(row, axis=0), axis=1).sum() for row in rows.rows]
    if rows.closed or any(
        np.linalg.norm(row[0] - row[-1]) > BLUNT * length for row, length in zip(rows.rows, lengths)
    ):
        return rows
    return PointRows(tuple(_closed(row) for row in rows.rows), rows.poles, closed=True)


def _closed(row: Float[ndarray, "p 3"]) -> Float[ndarray, "q 3"]:
    """A row that goes on from its end to its start on a half circle, in the plane of that and the way it ends."""
    middle, half = (row[0] + row[-1]) / 2, (row[-1] - row[0]) / 2
    size = float(np.linalg.norm(half))
    ends = unit(np.array([row[-1] - row[-2], row[0] - row[1]])).sum(axis=0)
    across = half / size
    out = unit((ends - (ends @ across) * across)[None])[0]
    angle = np.pi * np.arange(1, INSERTED + 1)[:, None] / (INSERTED + 1)
    return np.vstack([row, middle + np.cos(angle) * half + np.sin(angle) * size * out])
