"""Rows in other frames stay on the mesh, keep their sense of turning, and are ordered by their distortion."""

from collections.abc import Callable

import numpy as np
import pytest

from bonecam.mesh.distance import exact_closest
from bonecam.mesh.rows import OTHER_FRAMES, distortion, harmonic_rows, row_choices, rows_in_frame
from bonecam.mesh.triangle_mesh import TriangleMesh


@pytest.fixture(scope="module")
def wedge(ellipsoid: Callable[..., TriangleMesh]) -> TriangleMesh:
    return ellipsoid(3, 5, 9, thick_end=0.2)


@pytest.mark.parametrize("frame", OTHER_FRAMES)
def test_rows_in_another_frame_lie_on_the_mesh_and_turn_outwards(wedge: TriangleMesh, frame: np.ndarray) -> None:
    assert np.linalg.det(frame) == pytest.approx(1.0)
    rows = rows_in_frame(wedge, frame, 12, 40, 0.8)
    flat = rows.points.reshape(-1, 3)
    assert np.abs(exact_closest(wedge, flat)[0] - flat).max() < 1e-9
    up = frame[2]
    assert ((rows.poles[1] - rows.poles[0]) @ up) > 0
    around = np.roll(rows.points, -1, axis=1) - rows.points
    outward = np.cross(around[:-1], rows.points[1:] - rows.points[:-1])
    assert ((outward * (rows.points[:-1] - wedge.vertices.mean(0))).sum(axis=2) > 0).mean() > 0.99
    seam = rows.points[len(rows.points) // 2, 0]
    assert (rows.points[len(rows.points) // 2] @ frame[0]).max() - seam @ frame[0] < 0.8


def test_the_usual_rows_come_first_and_the_others_by_their_distortion(wedge: TriangleMesh) -> None:
    first, *others = row_choices(wedge, 12, 40, 0.8)
    assert np.array_equal(first.points, harmonic_rows(wedge, 12, 40, 0.8).points)
    measures = [distortion(rows) for rows in others]
    assert measures == sorted(measures)
    across = [rows for rows in others if abs(rows.poles[1] - rows.poles[0])[2] < 3]
    assert len(across) == 2
    assert distortion(others[0]) < min(distortion(rows) for rows in across), "along the long axis"
