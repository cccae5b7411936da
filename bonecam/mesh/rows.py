"""The harmonic field from pole to pole: u = 0 at the lower, 1 at the upper, Laplace's equation between.

Cotangent weights (Pinkall & Polthier 1993), raised to a small positive floor where a pair of obtuse triangles
makes them smaller. With positive weights every vertex but the poles has a lower and a higher neighbour; then,
on a closed genus-0 mesh, Euler's formula leaves no saddle, so **every isoline is one closed loop**.

Isolines of a field on a closed mesh, each traced face by face as one loop.

A value that meets a vertex counts the vertex as below, so no isoline passes through a vertex and each crossed
face is crossed once, from the edge where the field falls to the edge where it rises (in the face's own
direction). Walking so keeps the higher side on the left seen from outside.

Rows of points round a bone: isolines of the harmonic field, evenly spread from pole to pole.

Field values crowd at the poles (the field is logarithmic there), so rows are spaced by the mean distance
between neighbouring loops: an area dA between two loops of length l lies dA / l apart. Points on a row are
equally spaced by arc length from the seam, the line from pole to pole that crosses the loops squarely. Gan et
al. 2014 begin with such rows ("17 rows x 100 points arranged along the directrix") and do not say how they
are made.

Several sets of rows for one mesh, of which a fit takes the next where it, or the levels after it, fail.

The first runs along Z with the seam at +X. The others turn that seam by a quarter, or run along X or along Y, which on
a stubby bone or a wedge may suit better. They come in the order of their distortion, a measure that takes no fit: with
the derivatives S_s and S_t of the map from parameters to the surface, averaged over its area,

    var(log |S_s|) + var(log |S_t|) + mean (angle between S_s and S_t less a right angle)^2.

It is 0 where even knots give even, rectangular cells everywhere.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.spatial import cKDTree

from bonecam.arrays import frozen, lengths
from bonecam.errors import MeshError
from bonecam.mesh.distance import exact_closest
from bonecam.mesh.facets import cotangent_weights
from bonecam.mesh.meshlab import remesh
from bonecam.mesh.solids import neighbours_of
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.progress import Progress, report, silent

END_LENGTH = 1.0
"""Length of the end of a part along Z, in mean radii."""
WEIGHT_FLOOR = 0.02
"""Least edge weight; a regular triangle pair has 2 / sqrt(3) / 2 = 0.58."""


def end_poles(mesh: TriangleMesh) -> Int[ndarray, "2"]:
    """The vertices in the middle of the lower and of the upper end along Z.

    An end is the part of the mesh within END_LENGTH mean radii of the lowest or the highest point; its middle
    is the vertex nearest to where the axis through its centroid leaves the mesh. (A pole at the very lowest
    point, often a corner at the rim, would crowd the rows on one side.)
    """
    heights = mesh.vertices[:, 2]
    corners = mesh.vertices[mesh.faces]
    radius = mesh.area / (2 * np.pi * np.ptp(heights))
    centres = corners.mean(axis=1)
    areas = np.linalg.norm(mesh.face_vectors, axis=1)
    poles = []
    for sign, end in ((-1.0, heights.min()), (1.0, heights.max())):
        cap = (end - centres[:, 2]) * sign < END_LENGTH * radius
        middle = np.average(centres[cap], axis=0, weights=areas[cap])
        outward = cap & (mesh.face_vectors[:, 2] * sign > 0)
        candidates = np.unique(mesh.faces[outward if outward.any() else cap])
        away = np.linalg.norm(mesh.vertices[candidates, :2] - middle[:2], axis=1)
        poles.append(int(candidates[np.argmin(away)]))
    return np.array(poles)


def harmonic_field(mesh: TriangleMesh, poles: Int[ndarray, "2"]) -> Float[ndarray, " v"]:
    """The field at each vertex: 0 at the vertex poles[0], 1 at poles[1], harmonic between."""
    laplacian = positive_laplacian(mesh)
    count = len(mesh.vertices)
    free = np.setdiff1d(np.arange(count), poles)
    u = np.zeros(count)
    u[poles[1]] = 1.0
    u[free] = spl.spsolve(laplacian[free][:, free].tocsc(), -laplacian[free] @ u)
    return u


def positive_laplacian(mesh: TriangleMesh) -> sp.csr_array:
    """The (v, v) cotangent Laplacian, rows summing to zero, off-diagonals at most -WEIGHT_FLOOR."""
    weights = cotangent_weights(mesh)
    weights.data = np.maximum(weights.data, WEIGHT_FLOOR)
    return (sp.diags_array(weights.sum(1)) - weights).tocsr()


@dataclass(frozen=True, eq=False)
class Isolines:
    """The isolines of `field`, a number at each vertex of a closed `mesh`; `neighbours` are those of its
    faces."""

    mesh: TriangleMesh
    field: Float[ndarray, " v"]
    neighbours: Int[ndarray, "m 3"]

    @classmethod
    def of(cls, mesh: TriangleMesh, field: Float[ndarray, " v"]) -> "Isolines":
        """Isolines of one number a vertex; MeshError where the mesh is not closed."""
        return cls(mesh, field, neighbours_of(mesh))

    def loop(self, value: float) -> Float[ndarray, "k 3"]:
        """The corners of the one closed isoline at `value`, higher side on the left; MeshError where it is
        none or several."""
        faces, rising = self._crossed(value)
        if not len(faces):
            raise MeshError(f"no isoline at {value:.6g}: give a value inside the field's range", value=value)
        # The crossed faces in the order of the loop that begins at the first of them
        successor = np.searchsorted(faces, self.neighbours[faces, rising]).tolist()
        places = [0]
        while successor[places[-1]] != 0:
            places.append(successor[places[-1]])
        order = faces[places]
        if len(order) != len(faces):
            place = self.mesh.vertices[self.mesh.faces[np.setdiff1d(faces, order)[0], 0]]
            where = ", ".join(f"{x:.2f}" for x in place)
            message = (
                f"the isoline at {value:.6g} falls into several loops, one near ({where}): the mesh has a "
                "handle or badly shaped faces"
            )
            raise MeshError(f"{message}; repair it or remesh it finer", value=value, place=place)
        return self._crossings(order, rising[np.searchsorted(faces, order)], value)

    def length(self, value: float) -> float:
        """Total length of the isoline at `value`, of all its loops."""
        faces, rising = self._crossed(value)
        falling = self._edges(self.field > value, faces, rises=False)
        ends = self._crossings(faces, rising, value) - self._crossings(faces, falling, value)
        return float(np.linalg.norm(ends, axis=1).sum())

    def _crossed(self, value: float) -> tuple[Int[ndarray, " k"], Int[ndarray, " k"]]:
        """The crossed faces in rising order, and for each the local edge (from its vertex to the next) where
        the field rises."""
        above = self.field > value
        count = above[self.mesh.faces].sum(1)
        faces = np.flatnonzero((count > 0) & (count < 3))
        return faces, self._edges(above, faces, rises=True)

    def _edges(self, above: Bool[ndarray, " v"], faces: Int[ndarray, " k"], *, rises: bool) -> Int[ndarray, " k"]:
        """The local edge of each crossed face where the field rises through the value, or falls."""
        corners = above[self.mesh.faces[faces]]
        following = np.roll(corners, -1, axis=1)
        return np.argmax((~corners & following) if rises else (corners & ~following), axis=1)

    def _crossings(self, faces: Int[ndarray, " k"], edges: Int[ndarray, " k"], value: float) -> Float[ndarray, "k 3"]:
        """Where the isoline crosses one edge of each face."""
        start = self.mesh.faces[faces, edges]
        end = self.mesh.faces[faces, (edges + 1) % 3]
        share = (value - self.field[start]) / (self.field[end] - self.field[start])
        return self.mesh.vertices[start] + share[:, None] * (self.mesh.vertices[end] - self.mesh.vertices[start])


POLE_SPACING = 0.5
"""Distance of the first row from its pole, as a share of the even spacing: the ends of a bone are curved the
most."""
STRIPS = 400
"""Isolines that measure the distance from pole to pole."""
ROW_POINTS = 100
"""Points on each row."""
EDGE = 1.3 / 100
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
        # The share of the arc length round its loop at which each vertex lies, by the nearest point of the guides
        count = self.guides.shape[1]
        _, nearest = cKDTree(self.guides.reshape(-1, 3)).query(self.mesh.vertices)
        loop, index = np.divmod(nearest, count)
        here = self.guides[loop, index]
        tangent = self.guides[loop, (index + 1) % count] - self.guides[loop, (index - 1) % count]
        step = ((self.mesh.vertices - here) * tangent).sum(1) / (tangent**2).sum(1) * 2
        return np.stack([np.mod((index + np.clip(step, -0.5, 0.5)) / count, 1.0), self.field_heights], axis=1)


def harmonic_rows(
    mesh: TriangleMesh, rows: int = 24, points: int = ROW_POINTS, edge: float | None = None, progress: Progress = silent
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
    # Each loop as `points` equally spaced points from the seam
    loops = [isolines.loop(float(value)) for value in values]
    middle = len(loops) // 2
    starts: list[ndarray] = [np.empty(0)] * len(loops)
    starts[middle] = loops[middle][np.argmax(loops[middle][:, 0])]
    for k in range(middle + 1, len(loops)):
        starts[k] = nearest_on_loop(loops[k], starts[k - 1])[1]
    for k in range(middle - 1, -1, -1):
        starts[k] = nearest_on_loop(loops[k], starts[k + 1])[1]
    spaced = []
    for loop, start in zip(loops, starts):
        side, place = nearest_on_loop(loop, start)
        chain = np.concatenate([[place], np.roll(loop, -(side + 1), axis=0), [place]])
        along = lengths_along(chain)
        places = along[-1] * np.arange(points) / points
        spaced.append(np.stack([np.interp(places, along, chain[:, axis]) for axis in range(3)], axis=1))
    guides = np.stack(spaced)
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

    # Area of the surface where the field is below each value, exact on each face
    low, middle, high = np.sort(isolines.field[isolines.mesh.faces], axis=1).T
    whole = np.linalg.norm(isolines.mesh.face_vectors, axis=1) / 2
    tiny = np.finfo(float).tiny
    below = []
    for value in values.tolist():
        cut_low = (value - low) ** 2 / ((middle - low) * (high - low) + tiny)
        cut_high = 1 - (high - value) ** 2 / ((high - middle) * (high - low) + tiny)
        share = np.select([value <= low, value < middle, value < high], [np.zeros_like(low), cut_low, cut_high], 1.0)
        below.append(float(share @ whole))
    areas = np.array(below)

    caps = 2 * areas[0] / lengths[0], 2 * (isolines.mesh.area - areas[-1]) / lengths[-1]
    steps = np.concatenate([[caps[0]], 2 * np.diff(areas) / (lengths[1:] + lengths[:-1]), [caps[1]]])
    heights = np.concatenate([[0.0], np.cumsum(steps)])
    return heights / heights[-1], np.concatenate([[0.0], values, [1.0]])


def nearest_on_loop(loop: Float[ndarray, "k 3"], point: Float[ndarray, "3"]) -> tuple[int, Float[ndarray, "3"]]:
    """The side of a closed polygon nearest to `point`, and the nearest place on it."""
    sides = np.roll(loop, -1, axis=0) - loop
    squares = np.maximum((sides**2).sum(1), np.finfo(float).tiny)
    shares = np.clip(((point - loop) * sides).sum(1) / squares, 0, 1)
    footpoints = loop + shares[:, None] * sides
    side = int(np.argmin(((footpoints - point) ** 2).sum(1)))
    return side, footpoints[side]


def lengths_along(chain: Float[ndarray, "n d"]) -> Float[ndarray, " n"]:
    """Length along a chain up to each of its points."""
    return np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(chain, axis=0), axis=1))]


MOST_CHOICES = 3
"""Sets of rows that are tried for one part; each takes a fit and its levels."""

OTHER_FRAMES = (
    np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]),
    np.array([[0.0, 0, 1], [0, -1, 0], [1, 0, 0]]),
    np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]]),
)
"""Axes (rows, the third one up, the seam along the first) of the frames for the rows that are not the first."""


def row_choices(
    mesh: TriangleMesh, rows: int, points: int = ROW_POINTS, edge: float | None = None, progress: Progress = silent
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
    spread = 0.0
    for size in (np.log(widths), np.log(tall)):
        spread += float(np.average((size - np.average(size, weights=areas)) ** 2, weights=areas))
    return float(spread + np.average(shear**2, weights=areas))
