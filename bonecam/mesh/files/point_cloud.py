"""A closed surface round a point cloud: normals from neighbours, then screened Poisson reconstruction
(Kazhdan, Hoppe 2013).

The cloud must cover the part all round, densely: what comes out is measured against the points, and refused
where it misses them.
"""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import MeshError
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.meshlab import from_meshset, meshlab
from bonecam.mesh.triangle_mesh import TriangleMesh

FEWEST = 200
"""Least number of points of a cloud."""
NEIGHBOURS = 12
"""Number of neighbours that the normal of a point is fitted to."""
DEPTH = 8
"""Depth of the octree of the reconstruction."""
MAX_DISTANCE = 0.02
"""Largest distance of a point from the surface, share of the diagonal: a surface that misses more is
refused."""


def reconstruct(points: Float[ndarray, "n 3"]) -> TriangleMesh:
    """The closed, outward surface through a dense cloud, in the cloud's unit. MeshError where the points are
    too few or missed."""
    points = np.unique(points, axis=0)
    if len(points) < FEWEST:
        raise MeshError(
            f"{len(points)} different points are too few for a surface: give {FEWEST} or more, or rows of points",
            points=len(points),
        )
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    if not size > 0:
        raise MeshError("the points are so close together that they have no size: export them in mm")
    middle = points.mean(axis=0)
    meshset = meshlab().MeshSet()
    meshset.add_mesh(meshlab().Mesh((points - middle) / size))
    meshset.compute_normal_for_point_clouds(k=NEIGHBOURS)
    meshset.generate_surface_reconstruction_screened_poisson(depth=DEPTH, preclean=True, threads=1)
    unit_mesh = from_meshset(meshset)
    faces = unit_mesh.faces if unit_mesh.volume >= 0 else unit_mesh.faces[:, ::-1]
    mesh = TriangleMesh(unit_mesh.vertices * size + middle, faces)
    distances = MeshDistance(mesh).unsigned(points) if len(mesh.faces) else np.full(1, np.inf)
    if not distances.max() <= MAX_DISTANCE * size:
        place = points[np.argmax(distances)] if len(mesh.faces) else middle
        what = f"the surface round the points misses one by {distances.max():.3g} at {np.round(place, 3).tolist()}"
        raise MeshError(f"{what}: give a denser cloud that covers the whole part, or a mesh", place=place)
    return mesh
