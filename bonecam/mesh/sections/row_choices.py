"""Several sets of rows for one mesh, of which a fit takes the next where it, or the levels after it, fail.

The first runs along Z with the seam at +X. The others turn that seam by a quarter, or run along X or along Y, which on
a stubby bone or a wedge may suit better. They come in the order of their distortion, a measure that takes no fit: with
the derivatives S_s and S_t of the map from parameters to the surface, averaged over its area,

    var(log |S_s|) + var(log |S_t|) + mean (angle between S_s and S_t less a right angle)^2.

It is 0 where even knots give even, rectangular cells everywhere.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import lengths
from bonecam.mesh.sections.harmonic_rows import GUIDES, Rows, harmonic_rows
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.progress import Progress, silent

MOST_CHOICES = 3
"""Sets of rows that are tried for one part; each takes a fit and its levels."""

OTHER_FRAMES = (
    np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]),
    np.array([[0.0, 0, 1], [0, -1, 0], [1, 0, 0]]),
    np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]]),
)
"""Axes (rows, the third one up, the seam along the first) of the frames for the rows that are not the first."""


def row_choices(
    mesh: TriangleMesh, rows: int, points: int, edge: float | None = None, progress: Progress = silent
) -> Iterator[Rows]:
    """The sets of rows, with the arguments of `harmonic_rows`; each is made when it is asked for, all but the first
    together. MeshError where an isoline is not one loop."""
    yield harmonic_rows(mesh, rows, points, edge, progress)
    others = [rows_in_frame(mesh, frame, rows, points, edge) for frame in OTHER_FRAMES]
    yield from sorted(others, key=distortion)


def rows_in_frame(
    mesh: TriangleMesh, frame: Float[ndarray, "3 3"], rows: int, points: int, edge: float | None = None
) -> Rows:
    """The harmonic rows that the mesh has where the third row of the rotation `frame` is up, the seam along the first
    one; they stay where they are on the mesh."""
    harmonic = harmonic_rows(TriangleMesh(mesh.vertices @ frame.T, mesh.faces), rows, points, edge)
    return replace(
        harmonic,
        points=harmonic.points @ frame,
        poles=harmonic.poles @ frame,
        mesh=TriangleMesh(harmonic.mesh.vertices @ frame, harmonic.mesh.faces),
        guides=harmonic.guides @ frame,
    )


def distortion(rows: Rows) -> float:
    """How far the parameters of the rows are from even, rectangular cells."""
    loops = rows.guides
    count = loops.shape[1]
    heights = np.interp(
        np.arange(1, len(loops) + 1) / GUIDES, np.arange(len(rows.heights) + 2), [0.0, *rows.heights, 1.0]
    )
    around = (np.roll(loops, -1, axis=1) - np.roll(loops, 1, axis=1)).reshape(-1, 3) * count / 2
    along = np.gradient(loops, heights, axis=0).reshape(-1, 3)
    areas = lengths(np.cross(around, along))
    widths, tall = lengths(around), lengths(along)
    shear = np.arccos(np.clip(areas / (widths * tall), 0.0, 1.0))
    spread = sum(_variance(np.log(size), areas) for size in (widths, tall))
    return float(spread + np.average(shear**2, weights=areas))


def _variance(values: Float[ndarray, " n"], weights: Float[ndarray, " n"]) -> float:
    """The weighted variance."""
    return float(np.average((values - np.average(values, weights=weights)) ** 2, weights=weights))
