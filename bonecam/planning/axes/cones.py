"""Cones of tool axes: their surface, and where it meets others.

The oblique elliptic cone, the envelope of admissible tool axes at a contact, as a NURBS surface.

    x(u, phi) = A + u (D + cos(phi) U + sin(phi) V),    0 <= u <= 1

with the apex A, the oblique axis D and the conjugate semi-diameters U, V of the section at its end: any two
vectors that span a plane D does not lie in. Degrees are 2 and 2, the weights round the cone those of a circle
(Xu et al. 2013, Eq. 15). Differs from the paper in:

1. Both lines of Eq. 16 have weights: as printed, without them in the second, the surface misses the cone by an eighth
   of its radius.

Meshes of what is swept in cones, put before FCL: a catalogue of them, shared by all cones that are alike.

FCL answers in 25 us, but takes 2 us for each triangle of a mesh that it is to build. So it is asked where planes do not
tell a sweep from every triangle (`clear`), and first with a mesh of few sides whose sizes are rounded up to steps,
which cones and levels share. One that crosses there is asked again with meshes of its own, and these have only the
facets that no plane about the solid tells from it. A sweep that no mesh of these holds is taken to cross.

What a section of the tool sweeps for all axes of an elliptic cone: a closed mesh that holds it.

A section is a cylinder of radius r between the heights h and H above the apex, which may lie anywhere within `growth`
of its place. For all axes of the cone its points x (from the place of the apex) have

    n . x <= r + growth             for the outward normals n of the planes tangent to the cone,
    |x| <= |(H, r)| + growth,
    x . a >= h - growth             for an axis a of the cone.

The mesh has these planes as its sides. Its upper facets are no nearer than the bound, and so far away that they meet
each edge between two sides above its lower end, also of a section that is wide and short; its lower vertices, and so
its lower facets, lie in the convex set of all x for which the last line holds for no a.

Certified cones of free tool axes (Xu et al. 2013, section 3): one for every contact, about wanted axes.

The machine's limits and the largest tilt cut the cones by planes. Differs from the paper in:

1. A node of a net stands for the contacts round it: obstacles are nearer by the node's reach, so the tool is free on
   moves between these contacts too, not at the contacts alone.
2. The cone is the largest one in the map of proven directions in which the wanted axis lies deep; the paper says not
   how it finds its own.
3. The proof is a lower bound of distances, not a check of sampled axes; FCL is asked afterwards (`verify_cones`).

Cones of free tool axes as one mesh, to look at.

FCL's word on cones of free axes (Xu et al. 2013, section 6): what the tool sweeps in a cone, against the meshes of
a scene.

The cones are proven by spheres in grids of distances; this shares neither. What the sections of the tool sweep for
all axes of a cone, grown by the node's reach, are closed meshes (`envelope_catalogue`) that must not cross level,
material, post or what stands on the table. FCL is asked where no planes tell the sweep from each of their triangles.
It never reports containment: so a point of each is tested for being inside the obstacles, and one of each of their
pieces for being inside of it.

Next to the contact the cutter touches the level: it is asked from where the empty ball at its contacts ends
(`Apexes.room`). The table's plane, like the limits of the machine, cuts the cones: it is no obstacle.

The contacts of some nodes as apexes of their own: a node's apex is grown by how far its contacts are from it, and
stands for the largest turn of their normals; those of contacts need half of their moves alone.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.interpolate import BSpline
from scipy.spatial import KDTree

from bonecam.arrays import dots, frozen, unit
from bonecam.errors import OrientationError
from bonecam.job import PathJob
from bonecam.kernels.cones import Apexes, facets_below, largest_ellipses, swept_clear, swept_hold, swept_vertices
from bonecam.machine.limits import ANGLE_ROUNDING, MachineLimits, polar_angles
from bonecam.mesh.distance import MeshDistance, tree_of
from bonecam.mesh.solids import pieces_of, ring_faces
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.axes.free_axes import (
    NODES,
    FreeAxes,
    free_axes,
    half_moves,
    require_closed,
    rooms_at,
    sphere_leaves,
)
from bonecam.planning.axes.lead import table_limits
from bonecam.planning.collision import FclObject, column_mesh, crosses, fcl_object, obstacle_object, solid_object
from bonecam.planning.scene import Scene, Surroundings
from bonecam.runtime.threads import in_pieces
from bonecam.tool.cutter import Cutter, ToolSection
from bonecam.tool.elliptic_cones import EllipticCones
from bonecam.tool.path import ConeCheck, ContactPath, FreeCones, ToolPath
from bonecam.workholding.post import Column

CIRCLE = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]], dtype=float)
"""Control points of the unit circle."""
CIRCLE_WEIGHTS = np.array([1, np.sqrt(0.5)] * 4 + [1])
"""Their weights (Eq. 15)."""
CIRCLE_KNOTS = np.array([0, 0, 0, 0.25, 0.25, 0.5, 0.5, 0.75, 0.75, 1, 1, 1])
"""Knots round the cone (Eq. 15)."""
GENERATRIX_KNOTS = np.array([0.0, 0, 0, 1, 1, 1])
"""Knots from the apex to the end."""
DEGREE = 2
"""Of both directions."""
FLATTEST = 1e-9
"""D, U and V, at unit length, span less than this volume: no cone."""


@dataclass(frozen=True, eq=False)
class ObliqueEllipticCone:
    """The cone with `apex` A (mm), `axis` D, and semi-diameters `first` U and `second` V of its end, mm.

    ValueError where a vector is not finite, or D, U and V lie in one plane.
    """

    apex: Float[ndarray, "3"]
    axis: Float[ndarray, "3"]
    first: Float[ndarray, "3"]
    second: Float[ndarray, "3"]

    def __post_init__(self) -> None:
        for name in ("apex", "axis", "first", "second"):
            value = frozen(getattr(self, name))
            if value.shape != (3,) or not np.isfinite(value).all():
                raise ValueError(f"{name} = {value.tolist()}: give three finite numbers")
            object.__setattr__(self, name, value)
        sizes = np.linalg.norm(self._frame, axis=0)
        if not (sizes.min() > 0 and abs(np.linalg.det(self._frame / sizes)) > FLATTEST):
            raise ValueError("the axis lies in the plane of the semi-diameters, or these on one line: no cone")

    @property
    def _frame(self) -> Float[ndarray, "3 3"]:
        """U, V and D as columns."""
        return np.column_stack([self.first, self.second, self.axis])

    @cached_property
    def _inverse(self) -> Float[ndarray, "3 3"]:
        return np.linalg.inv(self._frame)

    @cached_property
    def control_points(self) -> Float[ndarray, "3 9 3"]:
        """The net P_ij = A + i/2 (D + x_j U + y_j V), from the apex to the end, round the cone."""
        ring = self.axis + CIRCLE[:, :1] * self.first + CIRCLE[:, 1:] * self.second
        return self.apex + np.array([0, 0.5, 1])[:, None, None] * ring

    @property
    def weights(self) -> Float[ndarray, "3 9"]:
        """The weights of the control points: round the cone those of a circle, along a generatrix all equal."""
        return np.tile(CIRCLE_WEIGHTS, (3, 1))

    @property
    def knots(self) -> tuple[Float[ndarray, "6"], Float[ndarray, "12"]]:
        """Along a generatrix and round the cone, each over 0 .. 1."""
        return GENERATRIX_KNOTS, CIRCLE_KNOTS

    def evaluate(self, u: Float[ndarray, " n"], v: Float[ndarray, " n"]) -> Float[ndarray, "n 3"]:
        """Points of the NURBS surface at parameters in 0 .. 1: u from the apex to the end, v round the cone."""
        along, around = (
            BSpline.design_matrix(np.asarray(x, dtype=float), knots, DEGREE).toarray()
            for x, knots in zip((u, v), self.knots)
        )
        points = np.concatenate([self.control_points, np.ones((3, 9, 1))], axis=2) * self.weights[:, :, None]
        homogeneous = np.einsum("ni,nj,ijk->nk", along, around, points)
        return homogeneous[:, :3] / homogeneous[:, 3:]

    def implicit(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        """q1^2 + q2^2 - q3^2 with q = [U V D]^-1 (x - A): zero on the cone and its opposite, negative inside."""
        q = (points - self.apex) @ self._inverse.T
        return q[:, 0] ** 2 + q[:, 1] ** 2 - q[:, 2] ** 2

    def gradient(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        """Gradient of `implicit`."""
        q = (points - self.apex) @ self._inverse.T
        return 2 * (q * [1, 1, -1]) @ self._inverse

    def heights(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        """q3: 0 in the apex, 1 in the plane of the end; negative on the opposite cone."""
        return (points - self.apex) @ self._inverse[2]

    def contains(self, directions: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
        """Whether rays from the apex in these directions run inside the cone or on it."""
        q = directions @ self._inverse.T
        return (q[:, 2] > 0) & (q[:, 0] ** 2 + q[:, 1] ** 2 <= q[:, 2] ** 2)

    @cached_property
    def principal(self) -> tuple[Float[ndarray, "3 3"], Float[ndarray, "2"]]:
        """Unit rows: the axis of symmetry, on the side of D, and the directions of the largest and the smallest
        opening; and these two semi-angles in radians."""
        quadric = self._inverse.T @ np.diag([1.0, 1.0, -1.0]) @ self._inverse
        values, vectors = np.linalg.eigh(quadric)
        axes = vectors.T
        if axes[0] @ self.axis < 0:
            axes[0] = -axes[0]
        return axes, np.arctan(np.sqrt(-values[0] / values[1:]))

    def tessellate(self, sides: int = 48, *, circumscribed: bool) -> TriangleMesh:
        """The closed cone with its end as a mesh of `sides` sides, outward: about the cone where it must
        contain it, inscribed where the cone must contain it. ValueError for fewer than three sides."""
        if sides < 3:
            raise ValueError(f"sides = {sides}: give 3 or more")
        angle = 2 * np.pi * np.arange(sides) / sides
        scale = 1 / np.cos(np.pi / sides) if circumscribed else 1.0
        ring = np.cos(angle)[:, None] * self.first + np.sin(angle)[:, None] * self.second
        end = self.apex + self.axis
        vertices = np.vstack([self.apex, end, end + scale * ring])
        here = 2 + np.arange(sides)
        following = np.roll(here, -1)
        wall = np.column_stack([np.zeros(sides, dtype=int), following, here])
        cap = np.column_stack([np.ones(sides, dtype=int), here, following])
        faces = np.vstack([wall, cap]).astype(np.int32)
        return TriangleMesh(vertices, faces if np.linalg.det(self._frame) > 0 else faces[:, ::-1])


def elliptic_cone(apex: Float[ndarray, "3"], cones: EllipticCones, which: int, length: float) -> ObliqueEllipticCone:
    """One of several cones, from `apex` to `length` (mm) along its axis."""
    axis, side = cones.axes[which], cones.sides[which]
    first, second = length * np.tan(cones.angles[which])
    return ObliqueEllipticCone(apex, length * axis, first * side, second * np.cross(axis, side))


STAIRS = ((1.0, 3**-0.5), ((2 / 3) ** 0.5, (2 / 3) ** 0.5), (3**-0.5, 1.0))
"""How far the steps that hold a quarter of the unit disc reach out and down."""


@dataclass(frozen=True)
class Sweep:
    """What a cylinder from `start` to `end` above the apex sweeps for all axes of a cone with the semi-angles `first`
    and `second` (radians, less than a right one) and apexes within `growth` of its place; mm."""

    start: float
    end: float
    radius: float
    first: float
    second: float
    growth: float

    @property
    def sizes(self) -> Float[ndarray, "6"]:
        """All of it in the order of the fields, as the kernels take it."""
        return np.array([self.start, self.end, self.radius, self.first, self.second, self.growth])

    def mesh(self, sides: int) -> tuple[Float[ndarray, "v 3"], Int[ndarray, "f 3"]] | None:
        """Vertices and outward faces of a mesh that holds it, of `sides` sides, the apex in the origin, the cone's axis
        along Z, and its largest opening along X; None where there is none (`swept_vertices`)."""
        vertices = swept_vertices(self.sizes, sides)
        return (vertices, _faces((len(vertices) - 2) // sides, sides)) if len(vertices) else None

    def steps(self) -> tuple["Sweep", ...]:
        """Sweeps that hold it together, and less below: growth rounds the edge of the section there, which they follow
        as a stair."""
        sweeps = []
        for out, down in STAIRS:
            start, radius = self.start - down * self.growth, self.radius + out * self.growth
            sweeps.append(
                Sweep(start, self.end + self.growth, radius=radius, first=self.first, second=self.second, growth=0.0)
            )
        return tuple(sweeps)

    def holds(self, points: Float[ndarray, "n 3"], sides: int) -> Bool[ndarray, " n"]:
        """Which points, in the frame of the mesh, lie within the bounds that it has."""
        sizes = np.tile(self.sizes, (len(points), 1))
        return swept_hold(sizes, sides, np.ascontiguousarray(points))


@lru_cache(maxsize=64)
def _faces(rings: int, sides: int) -> Int[ndarray, "f 3"]:
    return ring_faces(rings, sides)


Tree = tuple[Float[ndarray, "f 9"], Float[ndarray, "b 6"]]

COARSE_SIDES = 12
"""Sides of the meshes of the catalogue, and of the first of a cone's own;"""
FINE_SIDES = 24
"""those of its last ones, which follow the rounded edge below too, and the planes that are tried."""
GRID = 0.2, np.radians(6.0)
"""Steps of the sizes of the catalogue, mm and radians."""
CATALOGUE = 4096
"""So many meshes are kept at most, about 0.1 MB each."""
WIDEST = np.radians(80.0)
"""No semi-angle is rounded up beyond this, radians."""


@dataclass(frozen=True, eq=False)
class Obstacle:
    """The surface of a solid for FCL, its triangles and their boxes (`tree_of`), and how far it reaches (`supports`,
    mm) along unit `directions`."""

    surface: FclObject
    tree: Tree
    directions: Float[ndarray, "d 3"]
    supports: Float[ndarray, " d"]

    @classmethod
    def of(cls, mesh: TriangleMesh) -> "Obstacle":
        """The obstacle with this closed mesh."""
        return cls._with(mesh, fcl_object(mesh), tree_of(mesh))

    @classmethod
    def known(cls, distance: MeshDistance) -> "Obstacle":
        """The obstacle with the closed mesh of these distances; what FCL has of it, it keeps."""
        return cls._with(distance.mesh, obstacle_object(distance.mesh), distance.tree)

    @classmethod
    def _with(cls, mesh: TriangleMesh, surface: FclObject, tree: Tree) -> "Obstacle":
        triangles, _ = sphere_leaves()
        directions = np.ascontiguousarray(triangles.centres[: triangles.starts[1]])
        supports = (mesh.vertices @ directions.T).max(axis=0)
        return cls(surface, tree, directions, supports)

    def clear(
        self, sizes: Float[ndarray, "n 6"], places: Float[ndarray, "n 3"], turns: Float[ndarray, "n 3 3"]
    ) -> Bool[ndarray, " n"]:
        """Which of the sweeps, as `crossing` has them, planes tell from every triangle."""
        return swept_clear(sizes, FINE_SIDES, places, turns, *self.tree)


def crossing(
    sizes: Float[ndarray, "n 6"], places: Float[ndarray, "n 3"], turns: Float[ndarray, "n 3 3"], obstacle: Obstacle
) -> Bool[ndarray, " n"]:
    """Which of the sweeps (rows are the fields of `Sweep`), turned and with their apexes at `places`, cross the surface
    of an obstacle, as FCL has it."""
    met = np.zeros(len(sizes), dtype=bool)
    # Sizes of the catalogue, with which sweeps hold those of these.
    step, turn = GRID
    up = sizes.copy()
    up[:, 0] = step * np.floor(sizes[:, 0] / step)
    up[:, 5] = step * np.ceil(sizes[:, 5] / step)
    angles = turn * np.ceil(sizes[:, 3:5] / turn)
    up[:, 3:5] = np.where(angles <= WIDEST, angles, np.maximum(sizes[:, 3:5], WIDEST))
    for i, shared in enumerate(up.tolist()):
        alike = _catalogued(*shared)
        met[i] = (alike is None or crosses(alike, turns[i], places[i], obstacle.surface)) and _own_crosses(
            Sweep(*sizes[i].tolist()), places[i], turns[i], obstacle
        )
    return met


def _own_crosses(sweep: Sweep, place: Float[ndarray, "3"], turn: Float[ndarray, "3 3"], obstacle: Obstacle) -> bool:
    """Whether a sweep's own mesh crosses the surface of an obstacle, and those of its steps do."""

    def meets(some: Sweep, sides: int) -> bool:
        mesh = some.mesh(sides)
        if mesh is None:
            return True
        near = facets_below(*mesh, place, turn, obstacle.directions, obstacle.supports)
        return len(near[1]) > 0 and crosses(solid_object(*near), turn, place, obstacle.surface)

    return meets(sweep, COARSE_SIDES) and any(meets(step, FINE_SIDES) for step in sweep.steps())


@lru_cache(maxsize=CATALOGUE)
def _catalogued(
    start: float, end: float, radius: float, first: float, second: float, growth: float
) -> FclObject | None:
    mesh = Sweep(start, end, radius=radius, first=first, second=second, growth=growth).mesh(COARSE_SIDES)
    return None if mesh is None else solid_object(*mesh)


DEEP = 0.6
"""A cone stays where the wanted axis lies no further out in it than this share of the way to its rim: new ones would
hardly differ, and take most of the time of a field."""


@dataclass(frozen=True, eq=False)
class AxisCones:
    """Cones `shapes` (k), one for every node of `free.net`; `circular` ones were sought, or elliptic ones. The contacts
    of `path` keep to them, to the machine's `limits`, to polar angles `least_polar` .. `largest_polar` (n) and within
    `max_tilt` of their normals, radians. `check` is FCL's word on them, where it was asked."""

    path: ContactPath
    free: FreeAxes
    shapes: EllipticCones
    limits: MachineLimits
    least_polar: float
    largest_polar: Float[ndarray, " n"]
    max_tilt: float
    circular: bool = False
    check: ConeCheck | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "largest_polar", frozen(self.largest_polar))

    @property
    def found(self) -> Bool[ndarray, " n"]:
        """Which contacts have a cone."""
        return self.shapes.found[self.free.net.node_of]

    @property
    def shares(self) -> Float[ndarray, " k"]:
        """The part of each node's free directions that its cone holds; 0 where there is none."""
        free = self.free.free
        shapes = self.shapes
        held = np.zeros(len(shapes))
        for k in np.flatnonzero(shapes.found & free.any(axis=1)):
            q = self.free.directions[free[k]] @ shapes.matrices[k].T
            held[k] = ((q[:, 2] > 0) & (q[:, 0] ** 2 + q[:, 1] ** 2 <= q[:, 2] ** 2)).mean()
        return held

    def depths(self, axes: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        """How far inside its contact's cone each axis is, radians in a circular cone as wide; negative outside."""
        shapes = self.shapes.take(self.free.net.node_of)
        return shapes.mean_angles - shapes.off(axes)

    def contain(self, axes: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
        """Whether the axis of each contact lies in its cone and keeps the limits."""
        polar = polar_angles(axes)
        within = (polar >= self.least_polar - ANGLE_ROUNDING) & (polar <= self.largest_polar + ANGLE_ROUNDING)
        within &= self.limits.allow(axes)
        near = dots(axes, self.path.normals) >= np.cos(self.max_tilt)
        return within & near & self.found & (self.depths(axes) >= 0)

    def about(self, axes: Float[ndarray, "n 3"]) -> "AxisCones":
        """The cones that hold these axes best: at each node a large one in which the mean of its contacts lies deep,
        its own where that does."""
        free = self.free
        node = free.net.node_of
        sums = [np.bincount(node, axes[:, i], len(self.shapes)) for i in range(3)]
        means = unit(np.column_stack(sums))
        rows = np.flatnonzero(self.shapes.off(means) > DEEP * self.shapes.mean_angles)
        proven = free.proven[rows]
        wanted = means[rows]
        _, leaves = sphere_leaves()

        def work(piece: slice) -> tuple[ndarray, ndarray]:
            return largest_ellipses(proven[piece], wanted[piece], leaves, free.directions, self.circular)

        frames, has_cone = map(np.concatenate, zip(*in_pieces(work, len(rows), NODES)))
        has_cone &= free.free[rows].any(axis=1)
        cones = EllipticCones.oblique(frames, has_cone)
        return replace(self, shapes=self.shapes.with_rows(rows, cones), check=None)

    def as_circles(self) -> "AxisCones":
        """Without cones as yet, and such that circular ones are sought: their sections across the wanted axes are
        circles."""
        return replace(self, shapes=EllipticCones.none(len(self.shapes)), circular=True, check=None)

    def of(self, path: ContactPath) -> FreeCones:
        """The cones of the contacts of a path: those of `path`, or some of them."""
        kept = self.shapes.found
        number = np.where(kept, np.cumsum(kept) - 1, -1)
        away, row = KDTree(self.path.centres).query(path.centres)
        cone_of = np.where(away == 0, number[self.free.net.node_of[row]], -1)
        apexes = self.free.net.places[kept]
        return FreeCones(apexes, self.shapes.take(kept), cone_of, self.circular, self.check)

    def cone(self, contact: int, length: float = 1.0) -> ObliqueEllipticCone:
        """The cone of a contact with its apex at the ball's centre, to `length` (mm) along its axis. ValueError where
        the contact has none."""
        node = int(self.free.net.node_of[contact])
        if not self.shapes.found[node]:
            raise ValueError(f"contact {contact} has no cone: see `blocked`")
        return elliptic_cone(self.path.centres[contact], self.shapes, node, length)


def admissible_cones(path: ContactPath, scene: Scene, limits: MachineLimits, job: PathJob) -> AxisCones:
    """The cones of a path's contacts for its cutter in a scene: large ones about the mean of each node's free
    directions.

    OrientationError where a mesh of the scene is not closed, a contact is not finite, or there is none.
    """
    tilt = float(np.radians(job.max_tilt_deg))
    free = free_axes(path, scene, limits, tilt)
    clamping = scene.clamping
    largest = np.full(len(path.centres), limits.largest)
    if clamping.closed:
        largest = np.minimum(largest, table_limits(path.centres, path.cutter, clamping.clearance))
    none = AxisCones(
        path=path,
        free=free,
        shapes=EllipticCones.none(len(free.net.places)),
        limits=limits,
        least_polar=limits.smallest,
        largest_polar=largest,
        max_tilt=tilt,
    )
    middle = unit(free.free @ free.directions + 1e-9 * free.net.normals)
    return none.about(middle[free.net.node_of])


SHOWN_SIDES = 24
"""Of each cone."""


def cones_mesh(path: ToolPath, count: int = 100, length: float = 3.0) -> TriangleMesh:
    """The cones of `count` evenly chosen contacts at most, each closed and outward: apex at the ball's centre, `length`
    (mm) along its axis. What is drawn lies inside the cone. OrientationError where no contact has a cone."""
    rows = np.flatnonzero(path.cones.cone_of >= 0) if path.cones else np.zeros(0, dtype=np.int64)
    if path.cones is None or not len(rows):
        raise OrientationError(
            f"{path.title}: no contact has a cone: take path.orientation = 'cones', or another level", level=path.level
        )
    some = rows[np.unique(np.linspace(0, len(rows) - 1, min(count, len(rows))).astype(np.int64))]
    cones = [
        elliptic_cone(path.balls[row], path.cones.shapes, int(path.cones.cone_of[row]), length).tessellate(
            SHOWN_SIDES, circumscribed=False
        )
        for row in some
    ]
    starts = np.cumsum([0, *(len(cone.vertices) for cone in cones[:-1])])
    return TriangleMesh(
        np.vstack([cone.vertices for cone in cones]),
        np.vstack([cone.faces + start for cone, start in zip(cones, starts)]).astype(np.int32),
    )


def at_contacts(free: FreeAxes, nodes: Int[ndarray, " m"], path: ContactPath, scene: Scene) -> FreeAxes:
    """The free axes of a path with an apex for each contact of these nodes, and none for other nodes; a node of one
    contact that has several apexes keeps them."""
    node_of = free.net.node_of
    of_apex = free.apex_nodes
    several = np.diff(free.starts) > 1
    rows = np.flatnonzero(np.isin(node_of, nodes) & ~several[node_of])
    kept = np.flatnonzero(np.isin(of_apex, nodes) & several[of_apex])
    places = path.centres[rows]
    growth = np.linalg.norm(half_moves(path)[rows] - places[:, None], axis=2).max(axis=1, initial=0.0)
    made = places, growth, path.normals[rows], np.zeros(len(rows)), rooms_at(path.take(rows), scene)
    each = np.r_[node_of[rows], of_apex[kept]]
    order = np.argsort(each, kind="stable")
    apexes = Apexes(*(np.concatenate([new, old[kept]])[order] for new, old in zip(made, free.apexes)))
    counts = np.bincount(each, minlength=len(free.net.places))
    return replace(free, apexes=apexes, starts=np.cumsum(np.r_[0, counts]))


SHRUNK = (0.9, 0.75, 0.5)
"""Shares of its angles that a refused cone is tried with."""
RIM_ERROR = 0.01
"""The lean of the rim of a cone may be larger by this between the directions that are asked, radians."""


@dataclass(frozen=True, eq=False)
class ConeVerdict:
    """The nodes whose cones were `asked`, and for those (k) that FCL does not find free what meets, as `shank against
    the material`."""

    asked: Int[ndarray, " n"]
    refused: dict[int, str]


def verify_cones(cones: AxisCones, scene: Scene) -> ConeVerdict:
    """FCL's word on each cone, in the scene that they were made in. OrientationError where a mesh of it is not
    closed."""
    asked = np.flatnonzero(cones.shapes.found)
    return ConeVerdict(asked, _judged(cones, asked, scene, _pairs(scene, cones.path.cutter))[1])


def verified_cones(cones: AxisCones, scene: Scene) -> AxisCones:
    """The cones, of which those are narrowed that FCL refuses: to the largest share of SHRUNK of their angles that it
    does not, or to none; `check` counts them."""
    pairs = _pairs(scene, cones.path.cutter)
    asked = np.flatnonzero(cones.shapes.found)
    near, refusals = _judged(cones, asked, scene, pairs)
    refused = np.array(list(refusals), dtype=np.int64)
    shares = np.ones(len(cones.shapes))
    left = refused
    for share in SHRUNK:
        shares[left] = share
        tried = replace(near, shapes=cones.shapes.scaled(shares))
        left = np.array(list(_refusals(tried, left, pairs)), dtype=np.int64)
    shares[left] = -1.0
    check = ConeCheck(len(asked), len(refused) - len(left), len(left))
    return replace(cones, shapes=cones.shapes.scaled(shares), check=check)


def _judged(
    cones: AxisCones, nodes: Int[ndarray, " m"], scene: Scene, pairs: "list[_Pair]"
) -> tuple[AxisCones, dict[int, str]]:
    """The cones, those that FCL refuses at their nodes taken to each of their contacts, and what it refuses there
    too."""
    refused = np.array(list(_refusals(cones, nodes, pairs)), dtype=np.int64)
    near = replace(cones, free=at_contacts(cones.free, refused, cones.path, scene))
    return near, _refusals(near, refused, pairs)


@dataclass(frozen=True, eq=False)
class _Solid:
    """An obstacle of a section of the tool: its name, its surface, a point of each of its pieces, how far it may reach
    out of its mesh (mm), and which points are `inside`."""

    name: str
    obstacle: Obstacle
    pieces: Float[ndarray, "p 3"]
    deviation: float
    inside: Callable[[ndarray], ndarray]

    @classmethod
    def of_mesh(cls, around: Surroundings) -> "_Solid":
        """The mesh that a section stays out of. OrientationError where it is not closed."""
        mesh = around.mesh
        require_closed(mesh)
        _, first = np.unique(pieces_of(mesh), return_index=True)
        pieces = mesh.vertices[mesh.faces[first, 0]]
        distance = around.mesh_distance
        obstacle = Obstacle.known(distance)
        return cls(around.obstacle, obstacle, pieces, around.deviation, distance.inside)

    @classmethod
    def of_column(cls, name: str, column: Column) -> "_Solid":
        """A column."""
        top = np.array([[column.x, column.y, column.top]])
        return cls(name, Obstacle.of(column_mesh(column)), top, 0.0, column.holds)


_Pair = tuple[tuple[ToolSection, ...], float | None, _Solid]
"""Neighbouring sections of the tool, by how much thinner they are held against the level (mm; None: against anything
else), and one obstacle of theirs."""


def _pairs(scene: Scene, cutter: Cutter) -> list[_Pair]:
    """What is asked together: the sections that stay out of one mesh, and each section with each of its columns."""
    meshes: dict[str, tuple[list[ToolSection], _Solid]] = {}
    columns: dict[Column, _Solid] = {}
    pairs: list[_Pair] = []
    for section in cutter.profile:
        around = scene.around(section.name, cutter.radius)
        if around.obstacle not in meshes:
            meshes[around.obstacle] = [], _Solid.of_mesh(around)
        meshes[around.obstacle][0].append(section)
        for name, column in zip(["post", *["clamping"] * len(around.columns)], around.columns):
            if column not in columns:
                columns[column] = _Solid.of_column(name, column)
            pairs.append(((section,), None, columns[column]))
    for name, (sections, solid) in meshes.items():
        pairs.append((tuple(sections), scene.tangent_slack if name == "level" else None, solid))
    return pairs


def _refusals(cones: AxisCones, nodes: Int[ndarray, " m"], pairs: list[_Pair]) -> dict[int, str]:
    """For each of the nodes in whose cone the tool meets something, what does."""
    node_of = cones.free.apex_nodes
    asked = np.isin(node_of, nodes)
    refusals: dict[int, str] = {}
    for pair in pairs:
        for row, name in _meeting(cones, np.flatnonzero(asked), pair):
            refusals[int(node_of[row])] = f"{name} against the {pair[2].name}"
        asked &= ~np.isin(node_of, list(refusals))
    return refusals


def _meeting(cones: AxisCones, rows: Int[ndarray, " m"], pair: _Pair) -> Iterator[tuple[int, str]]:
    """The apexes about which sections of the tool meet a solid in their cones, and the lowest of these sections."""
    sections, slack, solid = pair
    height = cones.path.cutter.radius
    every = cones.free.apexes
    apexes = every.places[rows]
    # From the frames of the meshes to the scene
    shapes = cones.shapes.take(cones.free.apex_nodes[rows])
    turns = np.stack([shapes.sides, np.cross(shapes.axes, shapes.sides), shapes.axes], axis=2)
    growth = every.growth[rows] + solid.deviation
    # From where on the sections are asked, mm above the apexes: flutes from where the empty ball at the contact ends
    begins = np.zeros(len(rows))
    if slack is not None:
        lean = shapes.largest_angles(every.normals[rows]) + every.spread[rows] + RIM_ERROR
        begins = 2 * every.room[rows] * np.cos(np.minimum(lean, np.pi / 2))
    # sections follow each other, so where none crosses the solid, all are inside of it with their lowest point, or none
    lowest = np.maximum(begins, sections[0].start - height)
    inside = solid.inside(apexes + lowest[:, None] * turns[:, :, 2])
    left = np.ones(len(rows), dtype=bool)
    for section in sections:
        starts, end = np.maximum(begins, section.start - height), section.end - height
        some = np.flatnonzero(left & (starts < end))
        shape = np.tile([end, section.widest - (slack or 0.0)], (len(some), 1))
        sizes = np.column_stack([starts[some], shape, shapes.angles[some], growth[some]])
        met = inside[some]
        asked = np.flatnonzero(~met)
        asked = asked[~solid.obstacle.clear(sizes[asked], apexes[some[asked]], turns[some[asked]])]
        here = sizes[asked]
        poses = (apexes[some[asked]], turns[some[asked]])
        met[asked] = crossing(here, *poses, solid.obstacle)
        for point in solid.pieces:
            # a piece may lie inside of what is swept
            seen = np.einsum("nij,ni->nj", poses[1], point - poses[0])
            met[asked] |= swept_hold(here, COARSE_SIDES, seen)
        left[some[met]] = False
        for i in some[met]:
            yield int(rows[i]), section.name
