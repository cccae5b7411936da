"""A ball beside a part: where it lies free while it touches the surface, and where it lies nearest to given points."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial import cKDTree

from bonecam.arrays import lengths
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.facets.vertex_normals import vertex_normals
from bonecam.mesh.healing.hollows.closing import ACCURACY, nearest_centres
from bonecam.mesh.remeshing import split_edges
from bonecam.mesh.triangle_mesh import TriangleMesh

CHORD = 0.01
"""Facets of a fill lie within this of the ball, mm: the gouge allowed by default."""
PROBED = 0.5
"""The surface is probed at places no farther apart than this share of the ball's radius."""
AGAIN = 5
"""Times that nearer balls are looked for from those of other points, at most."""


class Ball:
    """A ball beside a part, and where it lies free while it touches the surface, which is `probed` on small faces."""

    def __init__(self, mesh: TriangleMesh, radius: float) -> None:
        self.mesh = mesh
        self.radius = radius
        self.probed = split_edges(mesh, PROBED * radius)
        size = np.maximum(lengths(self.probed.face_vectors), np.finfo(float).tiny)[:, None]
        normals = np.vstack([vertex_normals(self.probed), self.probed.face_vectors / size])
        self.probes = np.vstack([self.probed.vertices, self.probed.vertices[self.probed.faces].mean(axis=1)])
        centres = self.probes + radius * normals
        self.distance = MeshDistance(mesh)
        self.entered = radius - self.distance.signed(centres, radius)
        self.free = cKDTree(centres[self.entered <= ACCURACY])

    @property
    def longest(self) -> float:
        """Edges of faces that follow the ball within CHORD, mm, at most."""
        return float(np.sqrt(8 * self.radius * CHORD))

    def lying_near(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        """The centre of the ball outside the part that lies nearest to each point: looked for from free balls, and
        again from one that was found for another point where that lies nearer."""
        starts = np.asarray(self.free.data)[np.asarray(self.free.query(points)[1])]
        centres = nearest_centres(self.distance, points, starts, self.radius)
        for _ in range(AGAIN):
            away, other = cKDTree(centres).query(points)
            nearer = np.asarray(away) < lengths(centres - points) - ACCURACY
            if not nearer.any():
                break
            centres[nearer] = nearest_centres(self.distance, points[nearer], centres[other][nearer], self.radius)
        return centres

    def onto(self, points: Float[ndarray, "n 3"], *, both_ways: bool = False) -> Float[ndarray, "n 3"]:
        """The points moved onto the ball that lies nearest; one that it reaches stays, unless points are to move
        `both_ways`, out of the ball too."""
        centres = self.lying_near(points)
        away = np.maximum(lengths(centres - points), ACCURACY)
        stays = (away <= self.radius + 2 * ACCURACY) & (not both_ways)
        share = np.where(stays, 0.0, 1 - self.radius / away)
        return points + share[:, None] * (centres - points)
