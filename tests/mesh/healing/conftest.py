"""Debris that touches a bone, by recipe."""

from collections.abc import Callable

import numpy as np
import pytest

from bonecam.mesh.triangle_mesh import TriangleMesh

TETRAHEDRON = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
"""Faces of a tetrahedron of positive volume (corner 3 above the triangle 0, 1, 2)."""


@pytest.fixture(scope="session")
def bone(ellipsoid: Callable[..., TriangleMesh]) -> TriangleMesh:
    """A convex part of 1,536 faces."""
    return ellipsoid(5, 4, 14)


def touching(bone: TriangleMesh, kind: str, face: int, size: float) -> TriangleMesh:
    """The bone and a tetrahedron `size` mm high that stands on a vertex, an edge or a whole face of it.

    "vertex", "edge" and "face" share the bone's vertices; "wall" has the face between bone and tetrahedron once only.
    """
    corners = bone.faces[face]
    a, b, c = bone.vertices[corners]
    out = np.cross(b - a, c - a)
    out = out / np.linalg.norm(out)
    aside = np.cross(out, b - a) / np.linalg.norm(b - a)
    along = (b - a) / np.linalg.norm(b - a)
    new = len(bone.vertices)
    if kind == "vertex":
        added = a + size * np.array([out + 0.3 * along, out - 0.3 * along, out + 0.3 * aside])
        own = np.array([corners[0], new, new + 1, new + 2])
    elif kind == "edge":
        added = (a + b) / 2 + size * np.array([out + 0.2 * aside, out - 0.2 * aside])
        own = np.array([corners[0], corners[1], new, new + 1])
    else:
        added = (a + b + c)[None] / 3 + size * out
        own = np.array([*corners, new])
    vertices = np.concatenate([bone.vertices, added])
    points = vertices[own]
    faces = own[TETRAHEDRON if np.linalg.det(points[1:] - points[0]) > 0 else TETRAHEDRON[:, ::-1]]
    if kind == "wall":
        faces = faces[[set(trio) != set(corners) for trio in faces.tolist()]]
    return TriangleMesh(vertices, np.concatenate([bone.faces, faces]).astype(np.int32))


@pytest.fixture(scope="session")
def with_debris() -> Callable[..., TriangleMesh]:
    """Makes a bone with debris that touches it."""
    return touching


def same_rows(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether two arrays have the same distinct rows, to the bit."""
    return np.array_equal(np.unique(one, axis=0), np.unique(other, axis=0))


@pytest.fixture(scope="session")
def is_same() -> Callable[[TriangleMesh, TriangleMesh], bool]:
    """Tells whether two closed meshes have the same vertices and triangles, to the bit, in any order."""

    def compare(one: TriangleMesh, other: TriangleMesh) -> bool:
        soups = [np.sort(mesh.vertices[mesh.faces], axis=1).reshape(-1, 9) for mesh in (one, other)]
        same = same_rows(one.vertices, other.vertices) and same_rows(*soups)
        return same and len(one.faces) == len(other.faces) and bool(np.isclose(one.volume, other.volume, 1e-12))

    return compare
