"""The recipe of `phalanx.ply`: a part shaped like a middle phalanx, made by formula, so that it ships under
bonecam's licence.

It is no copy of a bone: a bent shaft, two condyles and a broad base with a concave facet are distance
functions (lengths in mm) joined by the polynomial smooth minimum `min(a, b) - max(k - |a - b|, 0)^2 / (4 k)`.
The zero set is taken by marching cubes, remeshed to an even edge and put back on the zero set, so the same
recipe gives the same mesh.

    file      meshes/phalanx.ply, binary PLY, float32, millimetres
    counts    2,348 vertices, 4,692 faces, one closed piece of genus 0 without self-intersections
    size      11.5 x 9.0 x 27.8 mm (x: width, y: dorsal-palmar, z: base to head); volume 1,066 mm^3

Make it again with `python -m bonecam_meshes.phalanx [FILE]`.
"""

import sys
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.mesh.triangle_mesh import TriangleMesh

GRID = 0.4
EDGE = 0.58
CORNERS = np.array([[-7.0, -6.5, -2.0], [7.0, 6.5, 30.0]])

CONDYLES = (((-2.2, -0.5, 24.9), (2.3, 3.05, 2.75)), ((2.2, -0.5, 24.9), (2.25, 2.95, 2.65)))
BASE = ((0.0, 0.1, 3.6), (5.5, 4.3, 4.1))
FACET = ((0.0, 0.4, -2.6), (4.6, 3.6, 3.9))


def distance(points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
    """Signed distance of (n, 3) points to the part, mm, negative inside; exact only near the surface of one
    primitive."""
    body = smooth_minimum(shaft(points), ellipsoid(points, *BASE), 2.5)
    head = smooth_minimum(ellipsoid(points, *CONDYLES[0]), ellipsoid(points, *CONDYLES[1]), 0.9)
    solid = smooth_minimum(body, head, 2.0)
    return -smooth_minimum(-solid, ellipsoid(points, *FACET), 1.2)


def shaft(points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
    """About the distance to a tube along z = 2 .. 23 with round ends, elliptic, waisted at z = 16 and bowed
    towards +y by 0.7 mm."""
    x, y, z = points.T
    height = np.clip(z, 2.0, 23.0)
    wide = 2.95 + 0.0085 * (height - 16.0) ** 2
    deep = 2.45 + 0.0050 * (height - 16.0) ** 2
    bow = 0.7 - 0.005 * (height - 14.0) ** 2
    radius = np.sqrt((x / wide) ** 2 + ((y - bow) / deep) ** 2 + ((z - height) / deep) ** 2)
    return (radius - 1.0) * deep


def ellipsoid(
    points: Float[ndarray, "n 3"], centre: tuple[float, ...], axes: tuple[float, ...]
) -> Float[ndarray, " n"]:
    """First-order distance to an ellipsoid: r (r - 1) / |gradient|."""
    inside = (points - centre) / axes
    radius = np.linalg.norm(inside, axis=1)
    slope = np.linalg.norm(inside / axes, axis=1)
    return radius * (radius - 1.0) / np.maximum(slope, np.finfo(float).tiny)


def smooth_minimum(first: Float[ndarray, " n"], second: Float[ndarray, " n"], width: float) -> Float[ndarray, " n"]:
    """The smaller of two distances with the crease filled over `width` mm."""
    overlap = np.maximum(width - np.abs(first - second), 0.0)
    return np.minimum(first, second) - overlap**2 / (4.0 * width)


def make() -> TriangleMesh:
    """The part: closed, outward, edges of about 0.6 mm, vertices on the zero set of `distance`."""
    mesh = remesh(contour())
    return TriangleMesh(relax(mesh.vertices, mesh.faces), mesh.faces)


def contour() -> TriangleMesh:
    """Marching cubes of `distance` on a grid of GRID mm."""
    import igl

    counts = np.round((CORNERS[1] - CORNERS[0]) / GRID).astype(int) + 1
    axes = [np.linspace(low, high, count) for low, high, count in zip(*CORNERS, counts, strict=True)]
    z, y, x = np.meshgrid(*axes[::-1], indexing="ij")
    grid = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    vertices, faces = igl.marching_cubes(distance(grid), grid, *(int(count) for count in counts), 0.0)[:2]
    return outward(TriangleMesh(vertices, faces.astype(np.int32)))


def outward(mesh: TriangleMesh) -> TriangleMesh:
    """The same mesh with a positive volume."""
    return mesh if mesh.volume > 0 else TriangleMesh(mesh.vertices, mesh.faces[:, ::-1])


def remesh(mesh: TriangleMesh) -> TriangleMesh:
    """MeshLab's isotropic explicit remeshing to edges of EDGE mm."""
    import pymeshlab

    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(mesh.vertices, mesh.faces))
    meshes.meshing_merge_close_vertices(threshold=pymeshlab.PureValue(0.02))
    meshes.meshing_isotropic_explicit_remeshing(targetlen=pymeshlab.PureValue(EDGE), iterations=8)
    current = meshes.current_mesh()
    return TriangleMesh(current.vertex_matrix().copy(), current.face_matrix().astype(np.int32))


def relax(vertices: Float[ndarray, "n 3"], faces: ndarray, rounds: int = 10) -> Float[ndarray, "n 3"]:
    """Move each vertex half way to the mean of its neighbours and back on the zero set, `rounds` times."""
    ends = np.vstack([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    valence = np.bincount(ends[:, 0], minlength=len(vertices))[:, None]
    points = vertices
    for _ in range(rounds):
        means = (
            np.column_stack([np.bincount(ends[:, 0], points[ends[:, 1], k], len(points)) for k in range(3)]) / valence
        )
        points = on_surface((points + means) / 2)
    return points


def on_surface(points: Float[ndarray, "n 3"], steps: int = 4) -> Float[ndarray, "n 3"]:
    """Newton steps along the gradient of `distance` (central differences of 1 um) to its zero set."""
    for _ in range(steps):
        nudges = 0.001 * np.eye(3)
        gradient = np.column_stack([(distance(points + nudge) - distance(points - nudge)) / 0.002 for nudge in nudges])
        points = points - (distance(points) / (gradient**2).sum(1))[:, None] * gradient
    return points


def write(mesh: TriangleMesh, path: str | Path, recipe: str = "phalanx") -> None:
    """Binary little-endian PLY with float32 coordinates in mm; `recipe` is the module that made the mesh."""
    header = (
        "ply\nformat binary_little_endian 1.0\n"
        f"comment bonecam {recipe}, millimetres, made by bonecam_meshes.{recipe}\n"
        f"element vertex {len(mesh.vertices)}\nproperty float x\nproperty float y\nproperty float z\n"
        f"element face {len(mesh.faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    faces = np.zeros(len(mesh.faces), dtype=[("count", "u1"), ("vertices", "<i4", 3)])
    faces["count"], faces["vertices"] = 3, mesh.faces
    Path(path).write_bytes(header.encode("ascii") + mesh.vertices.astype("<f4").tobytes() + faces.tobytes())


if __name__ == "__main__":
    write(make(), sys.argv[1] if len(sys.argv) > 1 else Path(__file__).with_name("phalanx.ply"))
