"""Pose: the long principal axis to +Z, the part centred on the axis.

The axes are those of the solid's own inertia (uniform density, exact for the polyhedron: the second moments
of the tetrahedra that each face spans with the origin). The thicker end points down, so that the post holds
it.
"""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import FINE_QUANTUM, settled
from bonecam.errors import MeshError
from bonecam.mesh.triangle_mesh import TriangleMesh

INSIDE = 1e-12
"""Share of the radius by which rounding may put a point outside the smallest circle."""
THROUGH = 1e-10
"""Share of the radius by which rounding may put a candidate outside a circle that holds it."""


def upright(mesh: TriangleMesh) -> tuple[TriangleMesh, Float[ndarray, "4 4"]]:
    """The closed `mesh` with its long axis along +Z, and the rigid motion (4, 4) that turned it.

    The end with more of the volume points down; the lowest point lies on z = 0; the smallest circle round the
    part seen along Z is centred on the axis (which makes the smallest coaxial bar thin). MeshError where the
    mesh holds no volume.
    """
    centroid, covariance = solid_moments(mesh)
    _, axes = np.linalg.eigh(covariance)
    long = axes[:, 2]
    middle = axes[:, 1]
    heights = (mesh.vertices - centroid) @ long
    if heights.max() < -heights.min():  # the centroid is nearer to the thicker end
        long = -long
    middle = middle * np.sign(middle[np.argmax(np.abs(middle))])
    rotation = np.stack([middle, np.cross(long, middle), long])
    turned = mesh.vertices @ rotation.T
    shift = -np.append(enclosing_circle(turned[:, :2])[0], turned[:, 2].min())
    transform = np.eye(4)
    transform[:3, :3] = rotation
    transform[:3, 3] = shift
    return TriangleMesh(turned + shift, mesh.faces), transform


def settled_pose(pose: Float[ndarray, "4 4"]) -> Float[ndarray, "4 4"]:
    """A rigid motion that is the same on every processor: its rotation from components on FINE_QUANTUM, made
    orthonormal without linear algebra, its shift on QUANTUM."""
    long, middle = settled(pose[2, :3], FINE_QUANTUM), settled(pose[0, :3], FINE_QUANTUM)
    long = long / np.sqrt((long * long).sum())
    middle = middle - (middle * long).sum() * long
    middle = middle / np.sqrt((middle * middle).sum())
    motion = np.eye(4)
    motion[:3, :3] = np.stack([middle, np.cross(long, middle), long])
    motion[:3, 3] = settled(pose[:3, 3])
    return motion


def solid_moments(mesh: TriangleMesh) -> tuple[Float[ndarray, "3"], Float[ndarray, "3 3"]]:
    """Centroid (mm) and covariance (mm^2) of the solid inside a closed mesh."""
    middle = mesh.vertices.mean(0)
    corners = (mesh.vertices - middle)[mesh.faces]
    volumes = np.linalg.det(corners) / 6
    volume = float(volumes.sum())
    if not volume > 0:
        raise MeshError(
            f"the mesh encloses {volume:.3g} mm^3: give a closed mesh whose faces point outwards", volume=volume
        )
    sums = corners.sum(1)
    centroid = (volumes @ sums) / (4 * volume)
    second = np.einsum("f,fi,fj->ij", volumes, sums, sums) + np.einsum("f,fki,fkj->ij", volumes, corners, corners)
    return centroid + middle, second / (20 * volume) - np.outer(centroid, centroid)


def enclosing_circle(points: Float[ndarray, "n 2"]) -> tuple[Float[ndarray, "2"], float]:
    """Centre and radius of the smallest circle round `points`.

    An active set holds the two or three points that the circle passes through. As long as a point lies
    outside, the farthest one joins the set and the circle grows (the order is that of Badoiu & Clarkson
    2003).
    """
    # by rounding the circle through a new point may be no larger: then it is the smallest that can be told
    active = [int(np.argmax(np.linalg.norm(points - points[0], axis=1)))]
    centre = points[active[0]]
    radius = 0.0
    while True:
        distances = np.linalg.norm(points - centre, axis=1)
        far = int(np.argmax(distances))
        if distances[far] <= radius * (1 + INSIDE) + np.finfo(float).eps * np.abs(points).max():
            return centre, radius
        # The smallest circle round at most four points: through two or three of them
        candidates = [*active, far]
        chosen = points[candidates]
        best: tuple[list[int], ndarray, float] = ([], chosen[0], np.inf)
        count = len(candidates)
        pairs = [[a, b] for a in range(count) for b in range(a + 1, count)]
        for subset in pairs + [[a, b, c] for a, b in pairs for c in range(b + 1, count)]:
            corners = chosen[subset]
            system = 2 * (corners[1:] - corners[0])
            if np.linalg.matrix_rank(system) < len(system):
                continue
            offset, *_ = np.linalg.lstsq(system, ((corners[1:] - corners[0]) ** 2).sum(1), rcond=None)
            middle, size = corners[0] + offset, float(np.linalg.norm(offset))
            if size < best[2] and (np.linalg.norm(chosen - middle, axis=1) <= size * (1 + THROUGH)).all():
                best = [candidates[k] for k in subset], middle, size
        if far in active or not radius < best[2] < np.inf:
            return centre, float(distances[far])
        active, centre, radius = best


def rotation(x_deg: float, y_deg: float, z_deg: float) -> Float[ndarray, "3 3"]:
    """The rotation matrix of turns about X, then Y, then Z by these angles in degrees."""
    matrix = np.eye(3)
    for axis, angle in enumerate(np.radians([x_deg, y_deg, z_deg])):
        u = (axis + 1) % 3
        v = (axis + 2) % 3
        turn = np.eye(3)
        turn[u, u] = turn[v, v] = np.cos(angle)
        turn[u, v] = -np.sin(angle)
        turn[v, u] = np.sin(angle)
        matrix = turn @ matrix
    return matrix
