"""Meshes of what is swept in cones, put before FCL: a catalogue of them, shared by all cones that are alike.

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
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.kernels.closest.swept_bounds import facets_below, swept_hold
from bonecam.kernels.closest.swept_cones import swept_vertices
from bonecam.kernels.closest.swept_triangles import swept_clear
from bonecam.mesh.distance import MeshDistance, tree_of
from bonecam.mesh.solids.revolution import ring_faces
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.axes.cones.sphere_leaves import sphere_leaves
from bonecam.planning.collision.fcl_model import FclObject, crosses, fcl_object, obstacle_object, solid_object

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

SIDES = 12
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
    for i, shared in enumerate(_rounded(sizes).tolist()):
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

    return meets(sweep, SIDES) and any(meets(step, FINE_SIDES) for step in sweep.steps())


def _rounded(sizes: Float[ndarray, "n 6"]) -> Float[ndarray, "n 6"]:
    """Sizes of the catalogue, with which sweeps hold those of these."""
    step, turn = GRID
    up = sizes.copy()
    up[:, 0] = step * np.floor(sizes[:, 0] / step)
    up[:, 5] = step * np.ceil(sizes[:, 5] / step)
    angles = turn * np.ceil(sizes[:, 3:5] / turn)
    up[:, 3:5] = np.where(angles <= WIDEST, angles, np.maximum(sizes[:, 3:5], WIDEST))
    return up


@lru_cache(maxsize=CATALOGUE)
def _catalogued(
    start: float, end: float, radius: float, first: float, second: float, growth: float
) -> FclObject | None:
    mesh = Sweep(start, end, radius=radius, first=first, second=second, growth=growth).mesh(SIDES)
    return None if mesh is None else solid_object(*mesh)
