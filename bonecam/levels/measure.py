"""What is measured and certified between neighbouring levels.

What is measured on one cut, between a level (outer) and the level before it (inner).

- *Depth*: how far points of the outer level lie from the inner one, which is what the cutter on the inner level
  removes; the *reverse depth* is how far points of the inner level lie from the outer one.
- *Nesting*: how far inside the outer level the inner one lies.
- *Outside*: how far the outer level leaves the stock.

The points are the vertices of the tessellations and the surface points in the middle of every face. Nearest
points are sought on the tessellations, distances are taken to the surfaces, the signed
distance of a stock is exact. Faces that cut each other are those of the outer tessellation.

The measures of a cut that are out of tolerance, and the error of a level that has such a cut.

One parameter mesh for all levels of a morph, so that their tessellations correspond vertex by vertex.

Neighbouring levels that touch then touch in their tessellations too, and what is measured between them is not
the difference of two chord errors. Fine only where one of the levels needs it: of every STRIDE-th level, the
first and the last.

A level as it is measured: its tessellation, on which nearest points are sought, and its surface, to which
distances are taken.

A tessellation lies up to its chord tolerance off the surface, which is more than levels may be off their
limits. So the nearest point of the mesh is where Newton's iteration for the footpoint on the surface starts,
and a distance is always the one from the surface.

The levels of a morph: the part, the surfaces between it and its stock, and the stock; each with what was
measured on the cut that ends at it.

Level 0 is the part, level K the stock. Cut k removes the material between levels k - 1 and k; the tool path of
level k - 1 machines it. There are four kinds of levels:

- `PartLevel`: level 0; no cut lies below it.
- `MorphLevel`: a surface over the T-mesh of the part, made by the morph.
- `RoundedLevel`: a level of a stock with edges (`levels/job_levels.py`). The morph of such a stock ends at a
  body whose edges are rounded; further levels are larger bodies of the same kind.
- `StockLevel`: the last level, the stock itself.

How deep each cut is at single points: on the vertices of every level, and along one parameter line (Gan et
al. 2014, Fig. 11).

Measure one cut of an open surface, between two levels over one T-mesh.

An open surface has no inside. Nesting is measured along the normals of the outer level, on the side of the part
on which the stock lies.

Inspect a sequence of levels: measure and certify every cut, and list those that are out of tolerance.

`inspect` measures all cuts of a sequence on one grid;
`inspect_again` measures some of them again when their levels have moved by microns, on the same grid.

Measure one cut: sample both of its levels and find depths, nesting and how far it leaves the stock.

All points are measured by few Newton steps from the parameters of the same place on the other level, which
finds distances that are true or too large. Only points that look too deep or not nested are measured again,
closely.
"""

import time
from abc import ABC
from collections.abc import Collection, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float, Int, Int32
from numpy import ndarray

from bonecam.arrays import dots, frozen, lengths
from bonecam.errors import LevelError, SurfaceError, place_name
from bonecam.levels.certificates import Certificate, certifiable, certify_cut, certify_last_cut
from bonecam.levels.problem import DEPTH_TOLERANCE, NESTING_TOLERANCE, STOCK_TOLERANCE
from bonecam.mesh.distance import MeshDistance, exact_closest
from bonecam.mesh.solids import self_intersections
from bonecam.mesh.triangle_mesh import TriangleMesh, probes
from bonecam.progress import Progress, report, silent
from bonecam.runtime.threads import cores
from bonecam.setup.stock import Schedule, Stock
from bonecam.surface.query import closest_points_near
from bonecam.surface.tessellation import shared_parameters
from bonecam.surface.tspline import TSpline

FULL_DEPTH = 1.0
"""Depths that must be left above a point of the inner level for it to count in `full_depth_mean`."""
BINS = 20
"""Even bins of the shares of area by depth, from 0 to the limit."""


@dataclass(frozen=True, eq=False)
class Measures:
    """One cut as measured; lengths in mm, and the places where the worst values are.

    `depth_max` and `depth_mean` (over its area) are of the outer level, `reverse_depth_max` of the inner one.
    `full_depth_mean` is the mean reverse depth where at least a full depth of material was left to the stock,
    over `full_depth_area` mm^2 of the inner level; the limit where that area is empty. `depth_shares` are the
    shares of the outer level's area by depth, in even bins from 0 to the limit. `nesting_min` is negative where
    a point of the inner level lies outside the outer one, `outside` negative where no point leaves the stock.
    `crossing_faces` are faces of the outer mesh that cut others. `near_limits` are parameters (s, t) of places
    that use half a tolerance or more, or where the level cuts itself.
    """

    depth_max: float
    depth_mean: float
    reverse_depth_max: float
    full_depth_mean: float
    full_depth_area: float
    depth_shares: tuple[float, ...]
    nesting_min: float
    outside: float
    depth_place: Float[ndarray, "3"]
    reverse_depth_place: Float[ndarray, "3"]
    nesting_place: Float[ndarray, "3"]
    outside_place: Float[ndarray, "3"]
    crossing_faces: Int[ndarray, " x"]
    near_limits: Float[ndarray, "k 2"]

    @property
    def self_intersections(self) -> int:
        """The number of faces of the outer mesh that cut others."""
        return len(self.crossing_faces)


NO_CUT = Measures(
    depth_max=0.0,
    depth_mean=0.0,
    reverse_depth_max=0.0,
    full_depth_mean=0.0,
    full_depth_area=0.0,
    depth_shares=(),
    nesting_min=0.0,
    outside=0.0,
    depth_place=np.zeros(3),
    reverse_depth_place=np.zeros(3),
    nesting_place=np.zeros(3),
    outside_place=np.zeros(3),
    crossing_faces=np.empty(0, dtype=np.int64),
    near_limits=np.empty((0, 2)),
)
"""The measures of a level that no cut ends at."""


def measures_of(
    inner: TriangleMesh,
    outer: TriangleMesh,
    limit: float,
    *,
    inner_points: Float[ndarray, "m 3"],
    outer_points: Float[ndarray, "n 3"],
    depth: Float[ndarray, " n"],
    outside: Float[ndarray, " n"],
    reverse_depth: Float[ndarray, " m"],
    nesting: Float[ndarray, " m"],
    remaining: Float[ndarray, " m"],
    crossing_faces: Int[ndarray, " x"],
    near_limits: Float[ndarray, "k 2"] = NO_CUT.near_limits,
) -> Measures:
    """The worst values and the means over the areas of the two meshes of a cut; `limit` is its depth, mm.

    The points of each level are the vertices of its mesh first, then one a face. `depth` and `outside` (mm) belong to
    the `outer_points`; `reverse_depth`, `nesting` (signed, positive inside the outer level) and `remaining` (the
    distance to the stock) to the `inner_points`.
    """
    inner_areas = np.linalg.norm(inner.face_vectors, axis=1) / 2
    outer_areas = np.linalg.norm(outer.face_vectors, axis=1) / 2
    face_depth = depth[len(outer.vertices) :]
    face_reverse_depth = np.abs(reverse_depth[len(inner.vertices) :])
    full = remaining[len(inner.vertices) :] >= FULL_DEPTH * limit
    # what is deeper than the limit counts in the last bin
    weights = outer_areas / outer_areas.sum()
    shares, _ = np.histogram(np.minimum(face_depth, limit), bins=BINS, range=(0, limit), weights=weights)
    return Measures(
        depth_max=float(depth.max()),
        depth_mean=float(np.average(face_depth, weights=outer_areas)),
        reverse_depth_max=float(reverse_depth.max()),
        full_depth_mean=float(np.average(face_reverse_depth[full], weights=inner_areas[full])) if full.any() else limit,
        full_depth_area=float(inner_areas[full].sum()),
        depth_shares=tuple(float(share) for share in shares),
        nesting_min=float(nesting.min()),
        outside=float(outside.max()),
        depth_place=outer_points[np.argmax(depth)],
        reverse_depth_place=inner_points[np.argmax(reverse_depth)],
        nesting_place=inner_points[np.argmin(nesting)],
        outside_place=outer_points[np.argmax(outside)],
        crossing_faces=crossing_faces,
        near_limits=near_limits,
    )


PATCH = 2.0
"""The faces within this distance (mm) of a violation are kept with its error, so that it can be looked at."""
REMEDY = "give a higher stiffness or more control points there"
"""What to do about a level that breaks its limits."""

Violation = tuple[str, Float[ndarray, "3"]]
"""What is out of tolerance, in words, and where that is worst."""


def violations(
    measures: Measures,
    limit: float,
    mesh: TriangleMesh,
    *,
    nesting_tolerance: float = NESTING_TOLERANCE,
    stock_tolerance: float = STOCK_TOLERANCE,
) -> list[Violation]:
    """All measures of a cut that are out of tolerance; `mesh` is the tessellation of its outer level, `limit`
    its depth in mm."""
    out_of_tolerance = []
    depths = ((measures.depth_max, measures.depth_place), (measures.reverse_depth_max, measures.reverse_depth_place))
    for depth, place in depths:
        if depth > limit + DEPTH_TOLERANCE:
            out_of_tolerance.append((f"is {depth:.4f} mm deep, more than {limit} mm,", place))

    if measures.nesting_min < -nesting_tolerance:
        what = f"falls {-measures.nesting_min:.4f} mm behind the level before"
        out_of_tolerance.append((what, measures.nesting_place))

    if measures.outside > stock_tolerance:
        out_of_tolerance.append((f"leaves the stock by {measures.outside:.4f} mm", measures.outside_place))

    if measures.self_intersections:
        place = mesh.vertices[mesh.faces[measures.crossing_faces[0]]].mean(0)
        out_of_tolerance.append((f"cuts itself in {measures.self_intersections} faces", place))

    return out_of_tolerance


def require_none(index: int, found: list[Violation], mesh: TriangleMesh, remedy: str = REMEDY) -> None:
    """Raise LevelError for the first violation of level `index`, with its place and the patch of the mesh
    round it; without violations nothing is raised."""
    if found:
        trouble, place = found[0]
        distance = np.linalg.norm(mesh.vertices[mesh.faces] - place, axis=2).min(1)
        faces = mesh.faces[distance <= max(PATCH, float(distance.min()))]
        kept, faces = np.unique(faces, return_inverse=True)
        patch = TriangleMesh(mesh.vertices[kept], faces.reshape(-1, 3).astype(np.int32))
        message = f"level {index} {trouble} at {place_name(place)}: {remedy}"
        raise LevelError(message, level=index, place=place, patch=patch)


STRIDE = 3
"""Every so many levels take part in the choice of the grid."""
SEAM = 0.5
"""Corners of a face whose s are farther apart than this share of a turn lie on both sides of the seam."""


@dataclass(frozen=True, eq=False)
class LevelGrid:
    """Parameters (s, t) of the vertices and of the faces' middles, the basis `R`, `R_middles` there, and the
    faces.

    The tessellations lie within about `chord_tolerance` mm of the levels.
    """

    parameters: Float[ndarray, "v 2"]
    middles: Float[ndarray, "f 2"]
    R: sp.csr_array
    R_middles: sp.csr_array
    faces: Int32[ndarray, "f 3"]
    chord_tolerance: float

    @property
    def sample_parameters(self) -> Float[ndarray, "n 2"]:
        """Parameters of the vertices, then of the faces' middles."""
        return np.vstack([self.parameters, self.middles])

    def mesh(self, control_points: Float[ndarray, "c 3"]) -> TriangleMesh:
        """The tessellation of the level with these control points."""
        return TriangleMesh(self.R @ control_points, self.faces)

    def points(self, control_points: Float[ndarray, "c 3"]) -> Float[ndarray, "n 3"]:
        """Points of the level with these control points at `sample_parameters`."""
        return np.vstack([self.R @ control_points, self.R_middles @ control_points])


def level_grid(surface: TSpline, levels: Sequence[Float[ndarray, "c 3"]], chord_tolerance: float) -> LevelGrid:
    """The grid on which the levels are within about `chord_tolerance` of their surfaces."""
    chosen = [*levels[:-1:STRIDE], levels[-1]]
    parameters, faces = shared_parameters(
        [surface.with_control_points(np.asarray(P)) for P in chosen[::-1]], chord_tolerance
    )
    low, high = surface.domain[1]
    off_poles = (parameters[faces, 1] > low) & (parameters[faces, 1] < high)
    corner = np.take_along_axis(faces, np.argmax(off_poles, axis=1)[:, None], axis=1)[:, 0]
    own = np.where(off_poles.any(1)[:, None], off_poles, True)

    # (s, t) in the middle of each face; s within half a turn of `first`, the mean over the corners that have an s of
    # their `own`, which poles have not
    first = parameters[corner, 0]
    offset = parameters[faces, 0] - first[:, None]
    offset -= np.round(offset) * (np.abs(offset) > SEAM)
    s = first + (offset * own).sum(1) / own.sum(1)
    middles = np.column_stack([np.mod(s, 1.0), parameters[faces, 1].mean(1)])

    return _grid(surface, parameters, middles, faces, chord_tolerance)


def open_level_grid(surface: TSpline, target: TSpline, chord_tolerance: float) -> LevelGrid:
    """The grid of an open surface and of the levels up to `target`, over the same T-mesh: the tessellation of
    whichever of the two needs more faces."""
    tessellations = [each.tessellate_with_parameters(chord_tolerance) for each in (surface, target)]
    finer = max(tessellations, key=lambda tessellation: len(tessellation.mesh.faces))
    faces = finer.mesh.faces

    # (s, t) in the middle of each face, also where it lies across a seam; a period of 0 means none
    period = surface.elements().period
    first = finer.parameters[faces[:, 0]]
    turn = np.array(period)
    offset = finer.parameters[faces] - first[:, None]
    offset -= turn * np.round(offset / np.where(turn > 0, turn, 1.0))
    middles = first + offset.mean(1)

    return _grid(surface, finer.parameters, middles, faces, chord_tolerance)


def _grid(surface: TSpline, parameters: ndarray, middles: ndarray, faces: ndarray, chord_tolerance: float) -> LevelGrid:
    """The grid with these parameters of vertices and faces' middles."""
    R = surface.basis(*parameters.T)[0]
    R_middles = surface.basis(*middles.T)[0]
    faces = frozen(faces, np.int32)
    return LevelGrid(
        frozen(parameters), frozen(middles), R=R, R_middles=R_middles, faces=faces, chord_tolerance=chord_tolerance
    )


STEPS = 3
"""Newton steps from parameters that are near the footpoint already: those of the same place on the next
level."""
CLOSEST_STEPS = 20
"""Newton steps where the distance decides whether a level passes."""
UNSURE = 0.1
"""mm: rays decide on which side of the surface points lie that are farther off; the normal at the footpoint
where they are nearer."""
UNSURE_CHORDS = 2.0
"""Rays decide it only for points that are also more than so many chord tolerances off: then they lie on the
same side of the mesh as of the surface."""


@dataclass(frozen=True, eq=False)
class MeasuredSurface:
    """The surface of one level on the parameter mesh that all levels share."""

    surface: TSpline
    grid: LevelGrid

    @cached_property
    def mesh(self) -> TriangleMesh:
        """The tessellation."""
        return self.grid.mesh(self.surface.control_points)

    @cached_property
    def mesh_distance(self) -> MeshDistance:
        """Distances to the tessellation."""
        return MeshDistance(self.mesh)

    @cached_property
    def points(self) -> Float[ndarray, "n 3"]:
        """Points of the surface: at the vertices of the mesh, then in the middle of every face."""
        return self.grid.points(self.surface.control_points)

    @property
    def parameters(self) -> Float[ndarray, "n 2"]:
        """Parameters (s, t) of `points`."""
        return self.grid.sample_parameters

    def distances_near(self, points: Float[ndarray, "n 3"], parameters: Float[ndarray, "n 2"]) -> Float[ndarray, " n"]:
        """Distances (mm) of points from the footpoints that few Newton steps find from these parameters;
        never less than the true ones."""
        return np.abs(self._newton(points, parameters, STEPS)[0])

    def signed_distances_near(
        self, points: Float[ndarray, "n 3"], parameters: Float[ndarray, "n 2"]
    ) -> Float[ndarray, " n"]:
        """Signed distances (mm, negative inside) of points from the footpoints that few Newton steps find
        from these parameters; never nearer than the true ones."""
        return self._with_sides(points, self._newton(points, parameters, STEPS)[0])

    def closest(
        self, points: Float[ndarray, "n 3"], parameters: Float[ndarray, "n 2"] | None = None
    ) -> tuple[Float[ndarray, " n"], Float[ndarray, "n 2"]]:
        """Signed distances (mm, negative inside) of points and the parameters of their footpoints, by many
        Newton steps from the nearest point of the mesh and from `parameters`, whichever ends nearer."""
        # Distances and parameters as `_newton` finds them from the nearest corner of the nearest face of the mesh
        nearest, face = self.mesh_distance.closest(points)
        corners = self.grid.faces[face]
        away = np.linalg.norm(self.mesh.vertices[corners] - nearest[:, None], axis=2)
        corner = corners[np.arange(len(points)), np.argmin(away, axis=1)]
        distance, footpoints = self._newton(points, self.grid.parameters[corner], CLOSEST_STEPS)

        if parameters is not None:
            other, other_footpoints = self._newton(points, parameters, CLOSEST_STEPS)
            nearer = np.abs(other) < np.abs(distance)
            distance = np.where(nearer, other, distance)
            footpoints = np.where(nearer[:, None], other_footpoints, footpoints)
        return self._with_sides(points, distance), footpoints

    def _newton(self, points: ndarray, parameters: ndarray, steps: int) -> tuple[ndarray, ndarray]:
        """Distances with the sign of the normal at the footpoints that Newton finds, and their parameters."""
        s, t, footpoints, normals = closest_points_near(self.surface, points, parameters[:, 0], parameters[:, 1], steps)
        offset = points - footpoints
        signed = np.copysign(np.linalg.norm(offset, axis=1), dots(offset, normals))
        return signed, np.column_stack([s, t])

    def _with_sides(self, points: ndarray, distance: ndarray) -> ndarray:
        """The distances with signs that hold beyond a crease too, where the normal at the footpoint misleads:
        rays decide the side of points that are farther off than the mesh can be."""
        far = np.flatnonzero(np.abs(distance) > max(UNSURE, UNSURE_CHORDS * self.grid.chord_tolerance))
        if not len(far):
            return distance
        signed = distance.copy()
        signed[far] = np.abs(distance[far]) * np.where(self.mesh_distance.inside(points[far]), -1.0, 1.0)
        return signed


class Level(ABC):
    """What every kind of level has; lengths in mm.

    `index` is its number k, `mesh` the tessellation that it was measured on, `limit` the largest depth allowed
    to cut k, `measures` what was measured on that cut. `surface` is its T-spline; a stock has none.
    `certificate` holds bounds on cut k that are valid at every point. There is none where the weights of the
    surface are not all one, nor for cuts that only round the stock: their depths are exact by construction.
    """

    index: int
    mesh: TriangleMesh
    limit: float
    measures: Measures
    surface: TSpline | None
    certificate: Certificate | None

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.index}: {self.deepest:.3g} of {self.limit:.3g} mm deep, {self.mesh!r}>"

    @property
    def deepest(self) -> float:
        """The largest depth of the cut, mm, measured from either of its levels to the other."""
        return max(self.measures.depth_max, self.measures.reverse_depth_max)

    @property
    def depth_max(self) -> float:
        """The largest distance of a point of this level from the level before, mm."""
        return self.measures.depth_max

    @property
    def depth_mean(self) -> float:
        """The mean distance of this level from the level before over its area, mm."""
        return self.measures.depth_mean

    @property
    def nesting_min(self) -> float:
        """How far inside this level the level before lies at least, mm; negative where a point lies outside."""
        return self.measures.nesting_min

    @property
    def outside(self) -> float:
        """How far the level leaves the stock, mm; negative where it lies inside."""
        return self.measures.outside

    @property
    def certified(self) -> bool | None:
        """Whether the certificate proves depth, nesting and stock within the tolerances; None without one."""
        return None if self.certificate is None else not self.certificate.shortfalls(self.limit)


@dataclass(frozen=True, eq=False, repr=False)
class PartLevel(Level):
    """Level 0, the surface of the part; `measures` are those of no cut, but for faces that cut each other."""

    surface: TSpline
    mesh: TriangleMesh
    measures: Measures
    index: int = field(default=0, init=False)
    limit: float = field(default=0.0, init=False)
    certificate: None = field(default=None, init=False)

    @property
    def control_points(self) -> Float[ndarray, "c 3"]:
        """Control points over the T-mesh of the part."""
        return self.surface.control_points


@dataclass(frozen=True, eq=False, repr=False)
class MorphLevel(Level):
    """A level of the morph: a surface over the T-mesh of the part."""

    index: int
    surface: TSpline
    mesh: TriangleMesh
    limit: float
    measures: Measures
    certificate: Certificate | None = None

    @property
    def control_points(self) -> Float[ndarray, "c 3"]:
        """Control points over the T-mesh of the part."""
        return self.surface.control_points


@dataclass(frozen=True, eq=False, repr=False)
class RoundedLevel(Level):
    """A level of a stock with edges: a body with rounded edges, of which only what lies inside `stock` is
    machined.

    `surface` has a T-mesh of its own. `control_points` are over the T-mesh of the part; their surface follows
    the level roughly. The first such level is the body that the morph ends at, and only it has a certificate.
    """

    index: int
    surface: TSpline
    mesh: TriangleMesh
    limit: float
    measures: Measures
    stock: Stock
    control_points: Float[ndarray, "c 3"]
    certificate: Certificate | None = None


@dataclass(frozen=True, eq=False, repr=False)
class StockLevel(Level):
    """The last level: the stock, whose surface `mesh` describes."""

    index: int
    mesh: TriangleMesh
    limit: float
    measures: Measures
    certificate: Certificate | None = None
    surface: None = field(default=None, init=False)


MachinedLevel = PartLevel | MorphLevel | RoundedLevel
"""A level that a tool path follows: any but the stock."""


def machined_levels(levels: Iterable[Level]) -> list[MachinedLevel]:
    """The levels that tool paths follow, in the order given."""
    return [level for level in levels if isinstance(level, MachinedLevel)]


def morph_surfaces(levels: Iterable[Level]) -> list[TSpline]:
    """The surfaces over the T-mesh of the part: of level 0 and of the levels of the morph."""
    return [level.surface for level in levels if isinstance(level, PartLevel | MorphLevel)]


def morph_end(levels: Sequence[Level]) -> Level:
    """The level that the morph ends at: the first body with rounded edges, or the stock where it has none."""
    return next((level for level in levels if isinstance(level, RoundedLevel)), levels[-1])


def rounding_cuts(levels: Sequence[Level]) -> range:
    """The numbers of the cuts that round a stock with edges; empty where the morph ends at the stock."""
    return range(morph_end(levels).index + 1, len(levels))


LINE = 0.7
"""Parameter s of the line along which depths are drawn."""

POINTS = 1000
"""Points on the line."""


def step_depths(levels: Sequence[Level]) -> list[Float[ndarray, " n"]]:
    """For each level the distance of its mesh vertices to the level before it (its surface, not its mesh),
    mm; zero on the part."""
    return [
        np.zeros(len(levels[0].mesh.vertices)),
        *(depths_from(before, level.mesh.vertices) for before, level in pairwise(levels)),
    ]


def depths_from(before: Level, points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
    """Distances (mm) of points of a level to the level before it."""
    if isinstance(before, PartLevel | MorphLevel):
        return before.surface.project(points).distances
    return MeshDistance(before.mesh).unsigned(points)


def line_depths(
    levels: Sequence[Level], stock: Stock | None, s: float = LINE, points: int = POINTS
) -> Float[ndarray, "k points"]:
    """For each cut of the morph (rounding levels left out) the depth, mm, at points evenly spaced on the line
    s of its outer level.

    Depths are distances to the level before, not to the point of the same parameter, which may have slid
    along. The last cut's are from the places nearest to the line on the body that the morph ends at: the
    `stock` itself, or its surface where it was rounded. Open levels have no `stock` (None): theirs are from
    the mesh of the last level.
    """
    surfaces = morph_surfaces(levels)
    across, t = _on_line(surfaces[0], s, points)
    depths = [before.project(level.positions(across, t)).distances for before, level in pairwise(surfaces)]
    last = surfaces[-1].positions(across, t)
    end = morph_end(levels)
    if isinstance(end, RoundedLevel):
        ends = end.surface.project(last).points
    else:
        ends = stock.closest_points(last) if stock else exact_closest(levels[-1].mesh, last)[0]
    return np.vstack([*depths, surfaces[-1].project(ends).distances])


def line_lengths(surface: TSpline, s: float = LINE, points: int = POINTS) -> Float[ndarray, " points"]:
    """How far along the line s of a surface, mm, the points lie where `line_depths` takes its depths."""
    steps = np.diff(surface.positions(*_on_line(surface, s, points)), axis=0)
    return np.r_[0.0, np.linalg.norm(steps, axis=1).cumsum()]


def _on_line(surface: TSpline, s: float, points: int) -> tuple[ndarray, ndarray]:
    """Parameters of points evenly spaced on the line s."""
    (first, last), (low, high) = surface.domain
    if not first <= s <= last:
        raise ValueError(f"line = {s}: give a parameter from {first:g} to {last:g}")
    return np.full(points, float(s)), np.linspace(low, high, points)


def measure_open_cut(
    inner: MeasuredSurface, outer: MeasuredSurface, stock: TSpline, side: float, limit: float
) -> Measures:
    """The cut from `outer` down to `inner`; `side` is 1 where the stock lies where the normals of the part point
    and -1 on the other side, `limit` the depth of the cut, mm.

    `outside` is measured from the outer level itself, which makes it zero.
    """
    parameters = inner.parameters

    # How far points of the inner level lie behind the outer one, mm: from its mesh, and from its surface where that
    # seems negative
    closest, face = exact_closest(outer.mesh, inner.points)
    normals = outer.mesh.face_vectors[face] / lengths(outer.mesh.face_vectors[face])[:, None]
    nesting = -side * dots(inner.points - closest, normals)

    doubtful = np.flatnonzero(nesting < 0)
    points = inner.points[doubtful]
    projection = outer.surface.project(points)
    normals = outer.surface.normals(*projection.parameters.T)
    nesting[doubtful] = -side * dots(points - projection.points, normals)
    return measures_of(
        inner.mesh,
        outer.mesh,
        limit,
        inner_points=inner.points,
        outer_points=outer.points,
        depth=distances_to(inner.surface, outer.points, parameters),
        outside=np.zeros(len(outer.points)),
        reverse_depth=distances_to(outer.surface, inner.points, parameters),
        nesting=np.asarray(nesting),
        remaining=distances_to(stock, inner.points, parameters),
        crossing_faces=self_intersections(outer.mesh),
    )


def distances_to(
    surface: TSpline, points: Float[ndarray, "n 3"], parameters: Float[ndarray, "n 2"]
) -> Float[ndarray, " n"]:
    """Distances (mm) of points from a surface: to their footpoints, or to its points at `parameters` where
    those are nearer than the footpoints found."""
    return np.minimum(surface.project(points).distances, lengths(points - surface.positions(*parameters.T)))


def measure_cut(inner: MeasuredSurface, outer: MeasuredSurface, stock: Stock, limit: float) -> Measures:
    """The cut between two levels with surfaces over one T-mesh; `limit` is its depth, mm."""
    outside = stock.signed_distance(outer.points)
    depth = inner.distances_near(outer.points, outer.parameters)
    deep = np.flatnonzero(depth > limit)
    depth[deep] = np.abs(inner.closest(outer.points[deep], outer.parameters[deep])[0])

    nesting = -outer.signed_distances_near(inner.points, inner.parameters)
    behind = np.flatnonzero(nesting < 0)
    fallen, footpoints_behind = outer.closest(inner.points[behind], inner.parameters[behind])
    nesting[behind] = -fallen
    deep = np.flatnonzero(nesting > limit)
    nesting[deep] = -outer.closest(inner.points[deep], inner.parameters[deep])[0]

    crossing_faces = self_intersections(outer.mesh)
    too_far = (depth > limit + DEPTH_TOLERANCE / 2) | (outside > STOCK_TOLERANCE / 2)
    near_limits = np.vstack(
        [
            outer.parameters[too_far],
            inner.parameters[nesting > limit + DEPTH_TOLERANCE / 2],
            footpoints_behind[fallen > NESTING_TOLERANCE / 2],
            outer.grid.parameters[np.unique(outer.mesh.faces[crossing_faces])],
        ]
    )
    return measures_of(
        inner.mesh,
        outer.mesh,
        limit,
        inner_points=inner.points,
        outer_points=outer.points,
        depth=depth,
        outside=outside,
        reverse_depth=nesting,
        nesting=nesting,
        remaining=-stock.signed_distance(inner.points),
        crossing_faces=crossing_faces,
        near_limits=near_limits,
    )


def measure_last_cut(inner: MeasuredSurface, mesh: TriangleMesh, stock: Stock, limit: float) -> Measures:
    """The cut from the stock, tessellated as `mesh`, down to the last level below it; `limit` is its depth,
    mm.

    No part of it counts as cut at full depth: nothing is left above the stock.
    """
    points = probes(mesh)
    nesting = -stock.signed_distance(inner.points)
    return measures_of(
        inner.mesh,
        mesh,
        limit,
        inner_points=inner.points,
        outer_points=points,
        depth=np.abs(inner.closest(points)[0]),
        outside=stock.signed_distance(points),
        reverse_depth=nesting,
        nesting=nesting,
        remaining=np.zeros(len(nesting)),
        crossing_faces=self_intersections(mesh),
    )


MAX_DOUBTED_PLACES = 100
"""Most places of a level at which its certificate leaves depth in doubt that become samples when the level is
solved again."""


@dataclass(frozen=True, eq=False)
class Rules:
    """What levels are measured against: the stock, the depths of the cuts, how far (mm) a level may lie
    outside the next one and leave the stock, and the chord tolerance of their tessellations, mm."""

    stock: Stock
    schedule: Schedule
    nesting_tolerance: float
    stock_tolerance: float
    chord_tolerance: float

    def violations(self, level: Level) -> list[Violation]:
        """What is out of tolerance on the cut of a level."""
        return violations(
            level.measures,
            level.limit,
            level.mesh,
            nesting_tolerance=self.nesting_tolerance,
            stock_tolerance=self.stock_tolerance,
        )


@dataclass(frozen=True, eq=False)
class Inspection:
    """Levels 0 (the part) to K (the stock), measured on one grid in `seconds`."""

    grid: LevelGrid
    rules: Rules
    levels: tuple[Level, ...]
    seconds: float

    @property
    def control_points(self) -> list[Float[ndarray, "c 3"]]:
        """Control points of levels 0 to K - 1."""
        return [level.control_points for level in machined_levels(self.levels)]

    @property
    def crosses(self) -> bool:
        """Whether a level cuts itself."""
        return any(level.measures.self_intersections for level in self.levels)

    @property
    def failed(self) -> tuple[Level, ...]:
        """The levels of the cuts that are out of tolerance."""
        return tuple(level for level in self.levels[1:] if self.rules.violations(level))

    @property
    def uncertain(self) -> tuple[Level, ...]:
        """The levels of the cuts that measure well but that their certificates do not prove."""
        return tuple(
            level for level in self.levels[1:] if level.certified is False and not self.rules.violations(level)
        )

    def require_passed(self) -> None:
        """Raise LevelError for the first cut that is out of tolerance."""
        for level in self.levels[1:]:
            require_none(level.index, self.rules.violations(level), level.mesh)


def excess(level: Level) -> float:
    """By how much (mm) the worst measured place of a cut breaks depth, nesting or stock; negative where none
    does."""
    return max(level.deepest - level.limit, -level.nesting_min, level.outside)


def excess_bound(level: Level) -> float:
    """An upper bound (mm) of by how much any place of a cut breaks depth, nesting or stock, from its
    certificate; the measured excess where there is none."""
    bounds = level.certificate
    if bounds is None:
        return excess(level)
    return max(excess(level), bounds.depth - level.limit, -bounds.nesting, bounds.outside)


def trouble(levels: Iterable[Level], *, doubts: bool) -> tuple[int, float]:
    """How many faces of these levels cut others, and the largest excess, mm; with `doubts` the largest of its
    bounds instead."""
    some = list(levels)
    crossing = sum(level.measures.self_intersections for level in some)
    return crossing, max((excess_bound if doubts else excess)(level) for level in some)


def inspect(
    surface: TSpline, made: Sequence[Float[ndarray, "c 3"]], rules: Rules, progress: Progress = silent
) -> Inspection:
    """Measure the cuts of the levels with control points `made`, those of the part (`surface`) first.

    Raises LevelError where a level is creased so that it cannot be tessellated.
    """
    began = time.perf_counter()
    try:
        grid = level_grid(surface, made, rules.chord_tolerance)
    except SurfaceError as error:
        raise LevelError(f"a level is creased: {error}") from error

    part = measure_part(MeasuredSurface(surface, grid))
    unmeasured = Inspection(grid, rules, (part,), time.perf_counter() - began)
    return inspect_again(unmeasured, made, range(1, len(made) + 1), progress)


def inspect_again(
    inspection: Inspection, made: Sequence[Float[ndarray, "c 3"]], cuts: Collection[int], progress: Progress = silent
) -> Inspection:
    """The inspection with these cuts measured anew, between the levels with control points `made`; the other
    cuts stay as measured."""
    began = time.perf_counter()
    measured = {level.index: level for level in inspection.levels}
    surface = measured[0].surface
    grid = inspection.grid
    rules = inspection.rules
    assert surface is not None
    waiting = list(cuts)
    threads = cores()
    surfaces = dict[int, MeasuredSurface]()
    with ThreadPoolExecutor(threads) as pool:
        for some in (waiting[first : first + threads] for first in range(0, len(waiting), threads)):
            report(progress, some[0] / (len(made) + 1), f"checking level {some[0]}")
            needed = {j for k in some for j in (k - 1, k) if j < len(made)}
            surfaces = {
                j: surfaces.get(j) or MeasuredSurface(surface.with_control_points(made[j]), grid) for j in needed
            }
            measures = pool.map(lambda k, at=surfaces: _measure(k, at, rules), some)
            measured.update(zip(some, measures))

    levels = tuple(measured[k] for k in sorted(measured))
    return Inspection(grid, rules, levels, inspection.seconds + time.perf_counter() - began)


def measure_part(part: MeasuredSurface) -> PartLevel:
    """The part as level 0, with the faces of its tessellation that cut others."""
    crossing_faces = self_intersections(part.mesh)
    return PartLevel(part.surface, part.mesh, replace(NO_CUT, crossing_faces=crossing_faces))


def _measure(k: int, surfaces: dict[int, MeasuredSurface], rules: Rules) -> MorphLevel | StockLevel:
    """Level k with its cut measured, given the surfaces of levels k - 1 and k, and certified where that is possible and
    says something: not where levels may lie farther outside one another than a certificate allows. The stock where
    level k has no surface."""
    inner, stock = surfaces[k - 1], rules.stock
    limit = rules.schedule.limit(k)
    certifies = certifiable(inner.surface) and rules.nesting_tolerance <= NESTING_TOLERANCE
    if k not in surfaces:
        mesh = stock.mesh(rules.chord_tolerance)
        measures = measure_last_cut(inner, mesh, stock, limit)
        last_proof = certify_last_cut(inner.surface, stock, limit) if certifies else None
        return StockLevel(k, mesh, limit, measures, last_proof)

    outer = surfaces[k]
    measures = measure_cut(inner, outer, stock, limit)
    if not certifies:
        return MorphLevel(k, outer.surface, outer.mesh, limit, measures)
    proof = certify_cut(inner.surface, outer.surface, stock, limit)
    doubted = proof.too_deep[:MAX_DOUBTED_PLACES]
    if proof.nesting < -NESTING_TOLERANCE:
        nearest = outer.surface.project(proof.nesting_place[None]).parameters
        doubted = np.vstack([doubted, nearest])
    return MorphLevel(
        k,
        outer.surface,
        outer.mesh,
        limit,
        replace(measures, near_limits=np.vstack([measures.near_limits, doubted])),
        proof,
    )
