"""Pits and clefts that no cutter can enter: found with a ball of its radius, filled with a membrane.

A ball that touches the surface at a vertex from outside must not reach into the part elsewhere. Where it
does, its material stays whatever the program; a surface that followed the pit would only fold on the levels
above it (a metacarpal's pit, 0.7 mm wide and 1.4 mm deep, made every sequence of levels fail). The vertices
found and their neighbours are moved to the membrane over the rest.
"""

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.spatial import cKDTree

from bonecam.errors import counted, place_name
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.intersections import self_intersections
from bonecam.mesh.triangle_mesh import TriangleMesh

REACH = 0.2
"""How far (as a share of its radius) the ball may reach into the part: facets and fillets are no pits."""
SHALLOW = 0.02
"""Depth in mm below which there is no pit: the wrong normal of a vertex among slivers looks like one."""
MAX_RINGS = 10
"""Largest number of rings of neighbours by which the filled region grows."""


def intrusion(
    mesh: TriangleMesh, radius: float, at: Int[ndarray, " k"] | slice = slice(None)
) -> Float[ndarray, " k"]:
    """How far (mm) a ball of `radius` that touches the surface at each vertex (of `at`) from outside reaches
    into the part elsewhere."""
    import igl

    weighting = igl.PER_VERTEX_NORMALS_WEIGHTING_TYPE_ANGLE
    normals = igl.per_vertex_normals(np.array(mesh.vertices), mesh.faces.astype(np.int64), weighting)
    return np.maximum(radius - MeshDistance(mesh).signed((mesh.vertices + radius * normals)[at], radius), 0.0)


def fill_pits(mesh: TriangleMesh, radius: float) -> tuple[TriangleMesh, tuple[str, ...]]:
    """The closed mesh (mm) without pits that a ball of `radius` mm cannot enter, and sentences for the
    report.

    A sentence names the depth, the place and the vertices still out of reach. A mesh without pits comes back
    unchanged, with no sentence.
    """
    found = intrusion(mesh, radius) > REACH * radius
    if not found.any():
        return mesh, ()
    free = np.zeros(len(mesh.vertices), dtype=bool)
    filled = mesh
    left = found
    for _ in range(MAX_RINGS):
        free[np.unique(mesh.faces[left[mesh.faces].any(axis=1)])] = True
        filled = _membrane(mesh, free)
        near = _reached(filled, free, radius)
        left = found.copy()
        left[near] = intrusion(filled, radius, near) > REACH * radius
        if not left.any():
            break
    moved = np.linalg.norm(filled.vertices - mesh.vertices, axis=1)
    worst = int(np.argmax(moved))
    if moved[worst] < SHALLOW and not left.any():
        return mesh, ()
    told = (
        f"pits that a ball of {radius:g} mm cannot enter, up to {moved[worst]:.2f} mm deep at "
        f"{place_name(mesh.vertices[worst])} mm"
    )
    if len(self_intersections(filled)):
        return mesh, (f"left {told}, open: a membrane over them would cut the part",)
    rest = f"; {counted(int(left.sum()), 'vertex')} still out of its reach" if left.any() else ""
    return filled, (f"filled {told}{rest}",)


def _reached(mesh: TriangleMesh, free: Bool[ndarray, " v"], radius: float) -> Int[ndarray, " k"]:
    """Vertices whose ball may touch a face with a free vertex; elsewhere the last measurement still holds."""
    faces = mesh.faces[free[mesh.faces].any(axis=1)]
    corners = mesh.vertices[faces]
    longest = float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max())
    away, _ = cKDTree(mesh.vertices[np.unique(faces)]).query(
        mesh.vertices, distance_upper_bound=2 * radius + longest
    )
    return np.flatnonzero(np.isfinite(away))


def _membrane(mesh: TriangleMesh, free: Bool[ndarray, " v"]) -> TriangleMesh:
    """The mesh with its free vertices moved to where Laplace's equation holds; the others stay."""
    import igl

    fixed = np.flatnonzero(~free)
    vertices = np.array(mesh.vertices)
    return TriangleMesh(
        igl.harmonic(vertices, mesh.faces.astype(np.int64), fixed, vertices[fixed], 1), mesh.faces
    )
