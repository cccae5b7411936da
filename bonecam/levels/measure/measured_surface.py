"""A level as it is measured: its tessellation, on which nearest points are sought, and its surface, to which
distances are taken.

A tessellation lies up to its chord tolerance off the surface, which is more than levels may be off their
limits. So the nearest point of the mesh is where Newton's iteration for the footpoint on the surface starts,
and a distance is always the one from the surface.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import dots
from bonecam.levels.measure.grid import LevelGrid
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.surface.query.closest_point import closest_points_near
from bonecam.surface.tspline import TSpline

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
