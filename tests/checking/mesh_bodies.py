"""Small solids with known volumes, and what every reader of part files promises of a bad file."""

from pathlib import Path

import numpy as np
import pytest

from bonecam.errors import FileError
from bonecam.mesh import TriangleMesh, read_mesh


def solid(vertices: np.ndarray, faces: np.ndarray) -> TriangleMesh:
    return TriangleMesh(
        np.asarray(vertices, dtype=np.float64).reshape(-1, 3), np.asarray(faces, dtype=np.int32).reshape(-1, 3)
    )


def grid_faces(rows: int, columns: int, closed_rows: bool) -> np.ndarray:
    """Faces of a tube of `rows` rings with `columns` corners; the last ring meets the first where closed."""
    faces = []
    for i in range(rows if closed_rows else rows - 1):
        for j in range(columns):
            a, b = i * columns + j, i * columns + (j + 1) % columns
            c, d = ((i + 1) % rows) * columns + j, ((i + 1) % rows) * columns + (j + 1) % columns
            faces += [[a, b, d], [a, d, c]]
    return np.array(faces)


def moved(mesh: TriangleMesh, shift: tuple[float, float, float], scale: float = 1.0) -> TriangleMesh:
    return solid(mesh.vertices * scale + np.array(shift), mesh.faces)


def together(*meshes: TriangleMesh) -> TriangleMesh:
    """All of them in one mesh, not joined."""
    starts = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes[:-1]])
    return solid(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts)]),
    )


def ellipsoid(a: float, b: float, c: float, rings: int = 24, columns: int = 32, thick_end: float = 0.0) -> TriangleMesh:
    """Makes an ellipsoid of semi-axes a, b, c about the origin; `thick_end` > 0 swells the lower half."""
    angle = np.pi * np.arange(1, rings + 1) / (rings + 1)
    turn = 2 * np.pi * np.arange(columns) / columns
    height = -np.cos(angle)[:, None] * np.ones(columns)
    width = np.sin(angle)[:, None] * (1 - thick_end * height)
    tube = np.stack([a * width * np.cos(turn), b * width * np.sin(turn), c * height], axis=2).reshape(-1, 3)
    low, high = len(tube), len(tube) + 1
    j = np.arange(columns)
    k = (j + 1) % columns
    last = (rings - 1) * columns
    caps = [np.stack([np.full(columns, low), k, j], 1), np.stack([np.full(columns, high), last + j, last + k], 1)]
    faces = np.concatenate([grid_faces(rings, columns, False), *caps])
    return solid(np.concatenate([tube, [[0, 0, -c], [0, 0, c]]]), faces)


def torus(radius: float = 10.0, tube: float = 3.0) -> TriangleMesh:
    """Makes an outward torus about z."""
    u, v = (
        x.ravel() for x in np.meshgrid(2 * np.pi * np.arange(40) / 40, 2 * np.pi * np.arange(16) / 16, indexing="ij")
    )
    ring = radius + tube * np.cos(v)
    mesh = solid(np.stack([ring * np.cos(u), ring * np.sin(u), tube * np.sin(v)], 1), grid_faces(40, 16, True))
    return mesh if mesh.volume > 0 else solid(mesh.vertices, mesh.faces[:, ::-1])


def check_refused(file: Path, content: bytes | str, reason: str) -> None:
    """Asserts that a file of this content is refused in one short line that names it and holds `reason`."""
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(FileError) as caught:
        read_mesh(file)
    assert str(caught.value).startswith(str(file))
    assert reason in str(caught.value)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 1000


def is_closed(mesh: TriangleMesh) -> bool:
    """Whether each edge has two faces."""
    edges = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    return bool((np.unique(edges, axis=0, return_counts=True)[1] == 2).all())


def assert_closed_sphere(mesh: TriangleMesh) -> None:
    """Asserts that a mesh is one closed oriented surface of genus 0 with no empty face and no vertex unused."""
    directed = np.vstack([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]]).astype(np.int64)
    key = directed[:, 0] * len(mesh.vertices) + directed[:, 1]
    back = directed[:, 1] * len(mesh.vertices) + directed[:, 0]
    assert len(np.unique(key)) == len(key)
    np.testing.assert_array_equal(np.sort(key), np.sort(back))
    assert len(np.unique(mesh.faces)) == len(mesh.vertices)
    assert len(mesh.vertices) - len(key) // 2 + len(mesh.faces) == 2
    assert np.linalg.norm(mesh.face_vectors, axis=1).min() > 0
