"""A convex body with all its edges rounded: a core and everything within `radius` of it. A morph can follow
it, an edge it cannot.

Rounding a stock S by rho takes S eroded by rho as core: of all bodies inside S that a ball of radius rho can
roll round, this is the largest. A cylinder bar rounded by its radius is the published capsule (Gan et al.
2014, section 4.2).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.errors import StockError, place_name
from bonecam.mesh.remeshing import bisect_faces
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.setup.capsule import smallest_capsule
from bonecam.setup.stock import Stock

LARGEST_TURN = 0.5
"""Cosine of the largest angle between a face's normal and the surface's normals at its corners."""
ALL = 0.98
"""A radius of this share of a stock's inradius is all of it: what is left of the core is too thin to compute
with."""
BISECTIONS = 60
"""Most rounds of bisection of a mesh: more than twice as many as halve every edge of a bone's stock down to a
micron."""


@dataclass(frozen=True, eq=False)
class RoundedStock(Stock):
    """All points within `radius` mm of `core`."""

    core: Stock
    radius: float
    kind: str = "rounded"

    @property
    def diameter(self) -> float:
        """Largest extent across the Z axis, mm."""
        return self.core.diameter + 2 * self.radius

    @property
    def length(self) -> float:
        """Extent along the axis, mm."""
        return self.core.length + 2 * self.radius

    @property
    def middle(self) -> Float[ndarray, "3"]:
        """The middle of the body, mm."""
        return self.core.middle

    @property
    def bounds(self) -> Float[ndarray, "2 3"]:
        """Lowest and highest corner of the bounding box, mm."""
        return self.core.bounds + self.radius * np.array([[-1.0], [1.0]])

    @property
    def has_edges(self) -> bool:
        """A rounded stock has no edges."""
        return False

    def move(self, shift: Float[ndarray, "3"]) -> "RoundedStock":
        """The body translated by `shift`, mm."""
        return RoundedStock(self.core.move(shift), self.radius)

    def offset(self, distance: float) -> Stock:
        """The body and everything within `distance` mm of it; for a negative one what is as deep inside it."""
        radius = self.radius + distance
        return RoundedStock(self.core, radius) if radius > 0 else self.core.offset(radius)

    def round_edges(self, radius: float) -> "RoundedStock":
        """The body itself: it has no edges."""
        return self

    def signed_distance(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n"]:
        """Distance of each point to the surface, mm, negative inside."""
        return self.core.signed_distance(points) - self.radius

    def normals(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        """Unit outward normals of the surface at the points nearest to `points`."""
        return self.core.normals(points)

    def distances_and_normals(self, points: Float[ndarray, "n 3"]) -> tuple[Float[ndarray, "n"], Float[ndarray, "n 3"]]:
        """Signed distances (mm) and outward normals in one pass."""
        distance, normals = self.core.distances_and_normals(points)
        return distance - self.radius, normals

    def mesh(self, chord_tolerance: float) -> TriangleMesh:
        """A closed outward mesh without self-intersections, its vertices on the surface, its faces within
        `chord_tolerance` mm of it.

        The nearest points on a convex body to a mesh round it lie in the same order, no farther apart. Faces
        are bisected until they are near enough.
        """
        axis = np.array([*self.middle[:2], 0.0])
        core = self.core.mesh(chord_tolerance).vertices - axis
        around = smallest_capsule(core, self.radius + chord_tolerance).move(axis)
        mesh = self._project(around.mesh(chord_tolerance), 0)
        for _ in range(BISECTIONS):
            coarse = self._too_coarse(mesh, chord_tolerance)
            if not coarse.any():
                return mesh
            mesh = self._project(bisect_faces(mesh, coarse), len(mesh.vertices))
        place = mesh.vertices[mesh.faces[np.argmax(coarse), 0]]
        raise StockError(
            f"no mesh of the rounded stock is within {chord_tolerance:g} mm of it at {place_name(place)}: "
            "give a stock with rounder "
            "edges, or raise levels.chord_tolerance",
            distance=chord_tolerance,
            place=place,
        )

    def _project(self, mesh: TriangleMesh, first: int) -> TriangleMesh:
        """The mesh with its vertices from the `first` on moved to the nearest surface points."""
        moved = np.vstack([mesh.vertices[:first], self.closest_points(mesh.vertices[first:])])
        return TriangleMesh(moved, mesh.faces)

    def _too_coarse(self, mesh: TriangleMesh, chord_tolerance: float) -> Bool[ndarray, " f"]:
        """Which faces may be farther than `chord_tolerance` mm from the surface, or are tilted against it.

        The body lies below the plane that touches it over the middle of a face: that plane's height over the
        corners bounds the depth. A closed mesh of which no face is turned over covers the convex body once.
        """
        corners = mesh.vertices[mesh.faces]
        middles = corners.mean(1)
        distance, normals = self.distances_and_normals(middles)
        height = -distance - np.einsum("fcx,fx->fc", corners - middles[:, None], normals).min(1)
        at_corners = self.normals(mesh.vertices)[mesh.faces]
        turned = np.einsum("fcx,fx->fc", at_corners, mesh.face_vectors).min(1)
        tilted = turned < LARGEST_TURN * np.linalg.norm(mesh.face_vectors, axis=1)
        return (height > chord_tolerance) | tilted
