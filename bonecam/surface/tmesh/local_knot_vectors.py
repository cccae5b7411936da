"""Local knot vectors of a T-mesh by ray shooting in index space (Sederberg et al. 2003, Rule 1).

From a vertex a ray runs along its index line and takes the knot of each vertex or perpendicular edge that it
hits, two to either side. Where the ray leaves the domain the last knot repeats; in a closed direction the ray
goes round. All comparisons are between line numbers, so knots that a file holds twice with different last
digits are one.
"""

import numpy as np
from jaxtyping import Bool, Float, Int64
from numpy import ndarray

from bonecam.errors import SurfaceError


def local_lines(
    line: Int64[ndarray, " n"],
    row: Int64[ndarray, " n"],
    hits: Bool[ndarray, "a b"],
    passes: Bool[ndarray, "p b"],
    closed: bool,
) -> Int64[ndarray, "n 5"]:
    """The five lines that the ray through each vertex at (line, row) meets; -1 and a: once round a closed
    direction, and so on.

    hits[i, j]: a vertex or a perpendicular edge stops the ray of row j on line i. passes[i, j]: the ray of
    row j may run between lines i and i + 1. Raises SurfaceError for a closed row with fewer than four hits.
    """
    count = hits.shape[0]
    result = np.empty((len(line), 5), dtype=np.int64)
    for j in np.unique(row):
        here = np.flatnonzero(row == j)
        stops = np.flatnonzero(hits[:, j])
        gaps = np.concatenate([[0], np.cumsum(~passes[:, j])])
        if closed and passes[:, j].all():
            if len(stops) < 4:
                raise SurfaceError(
                    f"row {j} of a closed direction has {len(stops)} distinct knots: give it four or more",
                    row=int(j),
                )
            place = np.searchsorted(stops, line[here])[:, None] + np.arange(-2, 3)
            result[here] = stops[place % len(stops)] + count * (place // len(stops))
        elif closed:
            unrolled = np.concatenate([stops - count, stops, stops + count])
            walls = np.concatenate([gaps[:-1], gaps[-1] + gaps[:-1], 2 * gaps[-1] + gaps])
            result[here] = _open(line[here], unrolled, walls, count)
        else:
            result[here] = _open(line[here], stops, gaps, 0)
    return result


def _open(line: ndarray, stops: ndarray, walls: ndarray, shift: int) -> ndarray:
    """Two stops to either side of each line, the last one before a wall repeated. walls[i + shift]: gaps
    before line i."""
    indices = np.empty((len(line), 5), dtype=np.int64)
    indices[:, 2] = line
    place = np.searchsorted(stops, line)
    for step in (-1, 1):
        last = line
        for k in (1, 2):
            index = np.clip(place + step * k, 0, len(stops) - 1)
            reached = (place + step * k == index) & (walls[stops[index] + shift] == walls[line + shift])
            last = np.where(reached, stops[index], last)
            indices[:, 2 + step * k] = last
    return indices


def knots_of_lines(
    lines: Int64[ndarray, "n k"], knots: Float[ndarray, " a"], period: float
) -> Float[ndarray, "n k"]:
    """Knot values of line numbers, those beyond the ends of a closed direction moved by whole periods."""
    return knots[lines % len(knots)] + period * (lines // len(knots))
