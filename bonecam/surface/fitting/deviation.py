"""How far surface and mesh are from each other, both ways, on dense samples: the symmetric Hausdorff distance
as measured, and the rms."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.mesh.distance import MeshDistance, hausdorff
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.surface.fitting.mesh_samples import sample_mesh
from bonecam.surface.query.closest_point import follow_closest_points, grid_parameters, nearest_on_grid
from bonecam.surface.tspline import TSpline

CHORD = 0.002
"""Chord tolerance of the tessellation that stands for the surface, mm."""
DOUBTFUL = 50
"""One in so many samples, the farthest, is projected with more care."""


@dataclass(frozen=True, eq=False)
class Deviation:
    """The deviation of surface and mesh in both directions, mm.

    `max` is the larger of the two maxima, at `place`; `rms` is weighted by area over the samples of both.
    """

    max: float
    rms: float
    surface_to_mesh_max: float
    mesh_to_surface_max: float
    place: Float[ndarray, "3"]


@dataclass(frozen=True, eq=False)
class Measured:
    """Samples of the mesh with their distances to the surface (`inward`), samples of the surface with
    theirs to the mesh (`outward`), mm, and the area each stands for, mm^2.
    """

    mesh_points: Float[ndarray, "n 3"]
    inward: Float[ndarray, " n"]
    mesh_areas: Float[ndarray, " n"]
    surface_points: Float[ndarray, "m 3"]
    surface_places: Float[ndarray, "m 2"]
    nearest: Float[ndarray, "m 3"]
    outward: Float[ndarray, " m"]
    surface_areas: Float[ndarray, " m"]

    @property
    def deviation(self) -> Deviation:
        """The largest and the root mean square distance."""
        inward, outward = self.inward, self.outward
        squares = [np.average(d**2, weights=w) for d, w in ((inward, self.mesh_areas), (outward, self.surface_areas))]
        at_mesh = inward.max() >= outward.max()
        return Deviation(
            max=float(max(inward.max(), outward.max())),
            rms=float(np.sqrt(np.mean(squares))),
            surface_to_mesh_max=float(outward.max()),
            mesh_to_surface_max=float(inward.max()),
            place=self.mesh_points[np.argmax(inward)] if at_mesh else self.surface_points[np.argmax(outward)],
        )

    def missed(self, tolerance: float) -> tuple[Float[ndarray, "k 3"], Float[ndarray, "p 2"]]:
        """Points of the mesh that are, or that a surface sample finds, farther than the tolerance; and (s, t)
        of such surface samples."""
        far = self.outward > tolerance
        return np.vstack([self.mesh_points[self.inward > tolerance], self.nearest[far]]), self.surface_places[far]


def deviation(surface: TSpline, mesh: TriangleMesh, samples: int = 20000) -> Deviation:
    """How far surface and mesh are from each other."""
    return measure(surface, mesh, MeshDistance(mesh), samples).deviation


def distance_both_ways(surface: TSpline, mesh: TriangleMesh) -> tuple[float, float]:
    """The largest distance (mm) of the surface from a mesh, which may be open, and of the mesh from the
    surface, within CHORD: for meshes of any size, of which `deviation` projects every vertex."""
    return hausdorff(surface.tessellate(CHORD), mesh)


def measure(surface: TSpline, mesh: TriangleMesh, distance: MeshDistance, samples: int = 20000) -> Measured:
    """Surface samples to the mesh's nearest points and mesh samples (vertices, points in the faces) to their
    feet on the surface."""
    points, areas = sample_mesh(mesh, samples)
    s, t = nearest_on_grid(surface, points)
    _, _, inward = follow_closest_points(surface, points, s, t, steps=6)
    doubtful = np.argsort(-inward, kind="stable")[: max(1, len(points) // DOUBTFUL)]
    inward[doubtful] = np.minimum(inward[doubtful], surface.project(points[doubtful]).distances)
    along = int(np.ceil(np.sqrt(samples)))
    s, t = grid_parameters(surface, along, along)
    S, Ss, St = surface.evaluate(s, t, 1)
    nearest = distance.closest(S)[0]
    cells = np.linalg.norm(np.cross(Ss, St), axis=1)
    return Measured(
        mesh_points=points,
        inward=inward,
        mesh_areas=areas,
        surface_points=S,
        surface_places=np.column_stack([s, t]),
        nearest=nearest,
        outward=np.linalg.norm(S - nearest, axis=1),
        surface_areas=cells,
    )
