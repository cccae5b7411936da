"""How far surface and mesh are from each other, both ways, on dense samples: the symmetric Hausdorff distance as measured, and the rms."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.surface.feet import follow, grid_parameters, nearest_on_grid
from bonecam.surface.samples import sample_mesh
from bonecam.surface.tspline import TSpline


@dataclass(frozen=True, eq=False)
class Deviation:
    """Both ways, mm. `max` is the larger of the two maxima, at `place`; `rms` is by area over the samples of both."""

    max: float
    rms: float
    surface_to_mesh_max: float
    mesh_to_surface_max: float
    place: Float[ndarray, "3"]


def deviation(surface: TSpline, mesh: TriangleMesh, samples: int = 20000) -> Deviation:
    """Surface samples to the mesh's nearest points and mesh samples (vertices, points in the faces) to their feet on the surface."""
    points, areas = sample_mesh(mesh, samples)
    s, t = nearest_on_grid(surface, points)
    _, _, inward = follow(surface, points, s, t, rounds=6)
    along = int(np.ceil(np.sqrt(samples)))
    s, t = grid_parameters(surface, along, along)
    S, Ss, St = surface.evaluate(s, t, 1)
    cells = np.linalg.norm(np.cross(Ss, St), axis=1)
    outward = np.linalg.norm(S - MeshDistance(mesh).closest(S)[0], axis=1)
    mean_squares = [np.average(d**2, weights=w) for d, w in ((inward, areas), (outward, cells))]
    place = points[np.argmax(inward)] if inward.max() >= outward.max() else S[np.argmax(outward)]
    return Deviation(
        max=float(max(inward.max(), outward.max())),
        rms=float(np.sqrt(np.mean(mean_squares))),
        surface_to_mesh_max=float(outward.max()),
        mesh_to_surface_max=float(inward.max()),
        place=place,
    )
