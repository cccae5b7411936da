"""Rows of points round a bone: isolines of the harmonic field, evenly spread from pole to pole.

Field values crowd at the poles (the field is logarithmic there), so rows are spaced by the mean distance
between neighbouring loops: an area dA between two loops of length l lies dA / l apart. Points on a row are
equally spaced by arc length from the seam, the line from pole to pole that crosses the loops squarely. Gan et
al. 2014 begin with such rows ("17 rows x 100 points arranged along the directrix") and do not say how they
are made.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial import cKDTree

from bonecam.arrays import frozen
from bonecam.mesh.distance import exact_closest
from bonecam.mesh.remeshing import remesh
from bonecam.mesh.sections.harmonic import end_poles, harmonic_field
from bonecam.mesh.sections.isolines import Isolines
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.progress import Progress, report, silent

POLE_SPACING = 0.5
"""Distance of the first row from its pole, as a share of the even spacing: the ends of a bone are curved the
most."""
STRIPS = 400
"""Isolines that measure the distance from pole to pole."""
EDGE = 0.013
"""Target edge of the even remesh, share of the diagonal."""
GUIDES = 8
"""Loops a row that lead the seam and the vertex parameters from row to row."""


@dataclass(frozen=True, eq=False)
class Rows:
    """m rows of p points from the lower pole to the upper one, on the mesh they were asked of.

    points[i, 0] is on the seam; points run counter-clockwise seen from above (so that S_s x S_t points
    outward). `mesh` is the even remesh whose isolines the rows are. `heights` (m,) are the mean distances of
    the rows from the lower pole in shares of the whole way, in (0, 1); `field_heights` (v,) are those
    of the vertices of `mesh`. `guides` are finer loops, GUIDES a row.
    """

    points: Float[ndarray, "m p 3"]
    poles: Float[ndarray, "2 3"]
    mesh: TriangleMesh
    heights: Float[ndarray, " m"]
    field_heights: Float[ndarray, " v"]
    guides: Float[ndarray, "g q 3"]

    @cached_property
    def vertex_parameters(self) -> Float[ndarray, "v 2"]:
        """(s, t) of each vertex of `mesh`: t its height in [0, 1], s its share of the arc length round its
        loop from the seam."""
        return np.stack([_arc_shares(self), self.field_heights], axis=1)


def harmonic_rows(
    mesh: TriangleMesh, rows: int = 24, points: int = 100, edge: float | None = None, progress: Progress = silent
) -> Rows:
    """Rows of points on a closed genus-0 mesh that stands upright (see `pose.upright`).

    `edge` is the target edge of the remesh in mm (default: EDGE of the diagonal). MeshError where an isoline
    is not one loop.
    """
    if rows < 2 or points < 3:
        raise ValueError(f"{rows} rows of {points} points: give at least 2 rows of 3 points")
    report(progress, 0.0, "remeshing evenly")
    even = remesh(mesh, mesh.diagonal * EDGE if edge is None else edge)
    report(progress, 0.5, "solving the harmonic field")
    poles = end_poles(even)
    isolines = Isolines.of(even, harmonic_field(even, poles))
    heights, field_values = measured_heights(isolines)
    wanted = row_heights(rows)
    guide_heights = np.interp(np.arange(1, (rows + 1) * GUIDES) / GUIDES, np.arange(rows + 2), [0.0, *wanted, 1.0])
    report(progress, 0.6, "tracing the rows")
    values = np.interp(guide_heights, heights, field_values)
    guides = _align_loops([isolines.loop(float(value)) for value in values], points)
    chosen = guides[GUIDES - 1 :: GUIDES]
    on_mesh, _ = exact_closest(mesh, np.concatenate([chosen.reshape(-1, 3), even.vertices[poles]]))
    return Rows(
        points=frozen(on_mesh[:-2].reshape(chosen.shape)),
        poles=frozen(on_mesh[-2:]),
        mesh=even,
        heights=frozen(wanted),
        field_heights=frozen(np.interp(isolines.field, field_values, heights)),
        guides=frozen(guides),
    )


def row_heights(rows: int) -> Float[ndarray, " m"]:
    """Heights of the rows in (0, 1): evenly spaced in the middle, POLE_SPACING as far apart at the poles."""
    x = np.arange(1, rows + 1) / (rows + 1)
    return np.asarray(x - (1 - POLE_SPACING) * np.sin(2 * np.pi * x) / (2 * np.pi))


def measured_heights(isolines: Isolines) -> tuple[Float[ndarray, " k"], Float[ndarray, " k"]]:
    """Heights in [0, 1] and the field values there. A height is the mean distance from the lower pole,
    divided by that of the upper pole.

    Between two isolines of mean length l with the area dA between them the distance is dA / l; a cap of area
    A in a loop of length l is a disc of radius 2 A / l.
    """
    corners = np.zeros(len(isolines.field))
    np.add.at(corners, isolines.mesh.faces, np.linalg.norm(isolines.mesh.face_vectors, axis=1)[:, None] / 6)
    order = np.argsort(isolines.field, kind="stable")
    share = np.cumsum(corners[order]) / isolines.mesh.area
    values = np.interp(np.arange(1, STRIPS) / STRIPS, share, isolines.field[order])
    lengths = np.array([isolines.length(float(value)) for value in values])
    areas = np.array([isolines.area_below(float(value)) for value in values])
    caps = 2 * areas[0] / lengths[0], 2 * (isolines.mesh.area - areas[-1]) / lengths[-1]
    steps = np.concatenate([[caps[0]], 2 * np.diff(areas) / (lengths[1:] + lengths[:-1]), [caps[1]]])
    heights = np.concatenate([[0.0], np.cumsum(steps)])
    return heights / heights[-1], np.concatenate([[0.0], values, [1.0]])


def _align_loops(loops: list[ndarray], points: int) -> Float[ndarray, "g p 3"]:
    """Each loop as `points` equally spaced points from the seam.

    The seam starts on the middle loop where it lies farthest out along +X and goes to the nearest place of
    the next loop, up and down.
    """
    middle = len(loops) // 2
    starts: list[ndarray] = [np.empty(0)] * len(loops)
    starts[middle] = loops[middle][np.argmax(loops[middle][:, 0])]
    for k in range(middle + 1, len(loops)):
        starts[k] = nearest_on_loop(loops[k], starts[k - 1])[1]
    for k in range(middle - 1, -1, -1):
        starts[k] = nearest_on_loop(loops[k], starts[k + 1])[1]
    return np.stack([equally_spaced(loop, start, points) for loop, start in zip(loops, starts)])


def nearest_on_loop(loop: Float[ndarray, "k 3"], point: Float[ndarray, "3"]) -> tuple[int, Float[ndarray, "3"]]:
    """The side of a closed polygon nearest to `point`, and the nearest place on it."""
    sides = np.roll(loop, -1, axis=0) - loop
    squares = np.maximum((sides**2).sum(1), np.finfo(float).tiny)
    shares = np.clip(((point - loop) * sides).sum(1) / squares, 0, 1)
    footpoints = loop + shares[:, None] * sides
    side = int(np.argmin(((footpoints - point) ** 2).sum(1)))
    return side, footpoints[side]


def equally_spaced(loop: Float[ndarray, "k 3"], start: Float[ndarray, "3"], points: int) -> Float[ndarray, "p 3"]:
    """`points` points on a closed polygon at equal arc lengths from the place nearest to `start`."""
    side, place = nearest_on_loop(loop, start)
    chain = np.concatenate([[place], np.roll(loop, -(side + 1), axis=0), [place]])
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(chain, axis=0), axis=1))])
    wanted = along[-1] * np.arange(points) / points
    return np.stack([np.interp(wanted, along, chain[:, axis]) for axis in range(3)], axis=1)


def _arc_shares(rows: Rows) -> Float[ndarray, " v"]:
    """The share of the arc length round its loop at which each vertex lies, by the nearest point of the
    guides."""
    count = rows.guides.shape[1]
    _, nearest = cKDTree(rows.guides.reshape(-1, 3)).query(rows.mesh.vertices)
    loop, index = np.divmod(nearest, count)
    here = rows.guides[loop, index]
    tangent = rows.guides[loop, (index + 1) % count] - rows.guides[loop, (index - 1) % count]
    step = ((rows.mesh.vertices - here) * tangent).sum(1) / (tangent**2).sum(1) * 2
    return np.mod((index + np.clip(step, -0.5, 0.5)) / count, 1.0)
