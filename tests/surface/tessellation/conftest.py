"""What a closed tessellation is."""

from collections.abc import Callable

import numpy as np
import pytest

from bonecam.mesh.triangle_mesh import TriangleMesh


@pytest.fixture(scope="session")
def assert_closed_sphere() -> Callable[[TriangleMesh], None]:
    """Asserts that a mesh is one closed oriented surface of genus 0 with no empty face and no vertex unused."""

    def check(mesh: TriangleMesh) -> None:
        directed = np.vstack([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]]).astype(np.int64)
        key = directed[:, 0] * len(mesh.vertices) + directed[:, 1]
        back = directed[:, 1] * len(mesh.vertices) + directed[:, 0]
        assert len(np.unique(key)) == len(key)
        np.testing.assert_array_equal(np.sort(key), np.sort(back))
        assert len(np.unique(mesh.faces)) == len(mesh.vertices)
        assert len(mesh.vertices) - len(key) // 2 + len(mesh.faces) == 2
        assert np.linalg.norm(mesh.face_vectors, axis=1).min() > 0

    return check
