"""T-junctions of a general T-mesh and where their extensions meet (Scott, Li, Sederberg & Hughes 2012,
Definition 1).

A T-junction is a vertex with three edges inside the domain. Its extension runs against the missing edge to
the first knot (edge extension) and through the missing edge to the second (face extension). A T-mesh in which
no extension along s meets one along t is analysis-suitable: its blending functions are linearly independent
and sum to one for some weights.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int64
from numpy import ndarray

from bonecam.surface.tmesh.general import TMesh, beside

STEPS = ((1, 0), (0, 1), (-1, 0), (0, -1))
"""Steps in lines of s and t of the directions 0 +s, 1 +t, 2 -s, 3 -t."""


class Junctions(NamedTuple):
    """Vertices that are T-junctions and the direction of the missing edge: 0 +s, 1 +t, 2 -s, 3 -t."""

    vertices: Int64[ndarray, " j"]
    directions: Int64[ndarray, " j"]


def _around(tmesh: TMesh, pieces_s: ndarray, pieces_t: ndarray) -> ndarray:
    """The values of the pieces between crossings on the four sides of each vertex, (n, 4); False where there
    is no piece. `pieces_s` run along s, `pieces_t` along t."""
    sides = np.zeros((tmesh.size, 4), dtype=bool)
    for direction, (di, dj) in enumerate(STEPS):
        pieces = (pieces_s, pieces_t)[direction % 2]
        place = tmesh.vertices + np.minimum([di, dj], 0)
        for axis in (0, 1):
            if tmesh.period[axis]:
                place[:, axis] %= pieces.shape[axis]
        there = ((place >= 0) & (place < pieces.shape)).all(axis=1)
        sides[there, direction] = pieces[tuple(place[there].T)]
    return sides


def junctions(tmesh: TMesh) -> Junctions:
    """All T-junctions. Vertices with the same two knots are one: an edge that goes on from any of them is not
    missing."""
    # Whether an edge leaves each vertex in the directions +s, +t, -s, -t, (n, 4)
    edges = _around(tmesh, tmesh.along_s, tmesh.along_t)
    inside = _around(
        tmesh, beside(tmesh.inside, bool(tmesh.period[1])), beside(tmesh.inside.T, bool(tmesh.period[0])).T
    )
    s, t = tmesh.s_lines[tmesh.vertices[:, 0]], tmesh.t_lines[tmesh.vertices[:, 1]]
    place = np.unique(np.column_stack([s, t]), axis=0, return_inverse=True)[1].ravel()
    leaving = np.zeros((int(place.max()) + 1, 4), dtype=bool)
    np.logical_or.at(leaving, place, edges & _positive_intervals(tmesh))
    missing = ~edges & inside & (edges.sum(axis=1) == 3)[:, None] & ~leaving[place]
    vertices, directions = np.nonzero(missing)
    first = np.sort(np.unique(4 * place[vertices] + directions, return_index=True)[1])
    return Junctions(vertices[first], directions[first])


def _positive_intervals(tmesh: TMesh) -> ndarray:
    """Whether the knot intervals on the four sides of each vertex are positive, (n, 4)."""
    s, t = tmesh.intervals
    return _around(
        tmesh,
        np.repeat((s > 0)[:, None], len(tmesh.t_lines), axis=1),
        np.repeat((t > 0)[None], len(tmesh.s_lines), axis=0),
    )


class Extensions(NamedTuple):
    """Extensions of T-junctions: segments from `low` to `high` on the line `across`, all knots; `vertices`
    are the T-junctions."""

    across: Float[ndarray, " e"]
    low: Float[ndarray, " e"]
    high: Float[ndarray, " e"]
    vertices: Int64[ndarray, " e"]


def extensions(tmesh: TMesh) -> tuple[Extensions, Extensions]:
    """The extensions along s and those along t."""
    vertices, directions = junctions(tmesh)
    by_axis = []
    for axis in (0, 1):
        here = directions % 2 == axis
        v = vertices[here]
        forward = directions[here] < 2
        knots = tmesh.local_knots[axis][v]
        other = tmesh.local_knots[1 - axis][v]
        low = np.where(forward, knots[:, 1], knots[:, 0])
        high = np.where(forward, knots[:, 4], knots[:, 3])
        by_axis.append(Extensions(other[:, 2], low, high, v))
    return by_axis[0], by_axis[1]


def meetings(tmesh: TMesh) -> tuple[Int64[ndarray, "c 2"], Int64[ndarray, "d 2"]]:
    """Pairs of T-junctions whose extensions cross inside both, and pairs whose extensions only touch at an
    end of one; the extension along s comes first."""
    along_s, along_t = extensions(tmesh)
    crossing = [np.zeros((0, 2), dtype=np.int64)]
    touching = [np.zeros((0, 2), dtype=np.int64)]
    for ds in _shifts(tmesh.period[0]):
        for dt in _shifts(tmesh.period[1]):
            x = (along_t.across + ds)[None]
            y = along_s.across[:, None]
            low, high = along_s.low[:, None], along_s.high[:, None]
            below, above = (along_t.low + dt)[None], (along_t.high + dt)[None]
            meet = (low <= x) & (x <= high) & (below <= y) & (y <= above)
            inner = (low < x) & (x < high) & (below < y) & (y < above)
            for pairs, which in ((crossing, inner), (touching, meet & ~inner)):
                i, j = np.nonzero(which)
                pairs.append(np.column_stack([along_s.vertices[i], along_t.vertices[j]]))
    return np.concatenate(crossing), np.concatenate(touching)


def _shifts(period: float) -> list[float]:
    """Shifts by whole periods at which extensions may meet; none but 0 in an open direction."""
    return [-period, 0.0, period] if period else [0.0]
