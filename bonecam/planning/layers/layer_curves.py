"""Curves of a tool over a chart: polylines in its coordinates, with the heights of the ball's centre, sampled until
straight moves deviate by no more than the chord tolerance."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.planning.layers.chart import Chart

Heights = Callable[[Float[ndarray, " n"], Float[ndarray, " n"]], Float[ndarray, " n"]]
"""Heights (mm) of the ball's centre at coordinates a and b."""
FIRST_STEP = 0.3
"""Points are so far apart at first, mm."""
SHORTEST = 0.005
"""Moves are not divided further than this, mm: at the edge of an undercut heights jump."""
ROUNDS = 12
"""Times that moves are halved at most."""


@dataclass(frozen=True, eq=False)
class LayerCurves:
    """Points (n,) of curves one behind the other, with the number of the `line` of each."""

    line: Int[ndarray, " n"]
    a: Float[ndarray, " n"]
    b: Float[ndarray, " n"]
    heights: Float[ndarray, " n"]

    def take(self, index: Int[ndarray, " k"]) -> "LayerCurves":
        """The points with these numbers."""
        return LayerCurves(self.line[index], self.a[index], self.b[index], self.heights[index])

    def centres(self, chart: Chart) -> Float[ndarray, "n 3"]:
        """The ball centres at the points."""
        return chart.bases(self.a, self.b) + self.heights[:, None] * chart.axes(self.a)

    def joined(self) -> Bool[ndarray, " n"]:
        """Whether each point and the next are on one line."""
        return np.r_[self.line[1:] == self.line[:-1], False]


def join(pieces: Sequence[LayerCurves]) -> LayerCurves:
    """Curves one behind the other, each piece a line."""
    line = np.repeat(np.arange(len(pieces)), [len(piece.a) for piece in pieces])
    a, b, heights = (
        np.concatenate([np.zeros(0), *(getattr(piece, name) for piece in pieces)]) for name in ("a", "b", "heights")
    )
    return LayerCurves(line, a, b, heights)


def sample(
    lines: Sequence[Float[ndarray, "_ 2"]], chart: Chart, height_of: Heights, width: float, tolerance: float
) -> LayerCurves:
    """The points of polylines (a, b); `width` is the length (mm) of a unit of a where it is largest."""
    line, a, b = _divided(lines, width)
    curves = LayerCurves(line, a, b, height_of(a, b))
    fresh = curves.joined()
    for _ in range(ROUNDS):
        begins = np.flatnonzero(fresh)
        middle_a = (curves.a[begins] + curves.a[begins + 1]) / 2
        middle_b = (curves.b[begins] + curves.b[begins + 1]) / 2
        heights = height_of(middle_a, middle_b)
        centres = curves.centres(chart)
        starts, ends = centres[begins], centres[begins + 1]
        middles = LayerCurves(curves.line[begins], middle_a, middle_b, heights)

        # Distance of each point from the segment from its start to its end, mm
        points = middles.centres(chart)
        along = ends - starts
        square = np.maximum((along**2).sum(axis=1), np.finfo(float).tiny)
        share = np.clip(((points - starts) * along).sum(axis=1) / square, 0.0, 1.0)
        off = np.linalg.norm(points - starts - share[:, None] * along, axis=1)

        needed = (off > tolerance) & (np.linalg.norm(ends - starts, axis=1) > SHORTEST)
        if not needed.any():
            break
        indices = begins[needed] + 1
        curves = LayerCurves(
            np.insert(curves.line, indices, curves.line[begins[needed]]),
            np.insert(curves.a, indices, middle_a[needed]),
            np.insert(curves.b, indices, middle_b[needed]),
            np.insert(curves.heights, indices, heights[needed]),
        )
        added = indices + np.arange(len(indices))
        fresh = np.zeros(len(curves.a), dtype=bool)
        fresh[added] = fresh[added - 1] = True
    return curves


def _divided(lines: Sequence[Float[ndarray, "_ 2"]], width: float) -> tuple[ndarray, ndarray, ndarray]:
    """Number, a and b of points on polylines that are no farther apart than FIRST_STEP."""
    numbers, points = [], []
    for number, polyline in enumerate(lines):
        steps = np.diff(polyline, axis=0)
        counts = np.ceil(np.hypot(steps[:, 0] * width, steps[:, 1]) / FIRST_STEP).astype(np.int64).clip(1)
        ends = np.r_[0, np.cumsum(counts)]
        at = np.arange(ends[-1] + 1)
        points.append(np.column_stack([np.interp(at, ends, polyline[:, k]) for k in range(2)]))
        numbers.append(np.full(len(at), number))
    if not points:
        return np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros(0)
    a, b = np.vstack(points).T
    return np.concatenate(numbers), a, b
