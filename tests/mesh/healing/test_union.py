"""The union of solids: its volume is that of all points inside one of them; open and inward ones are refused."""

import numpy as np
import pytest

from bonecam.errors import MeshError
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.solids import revolve, revolve_ring, solid_union
from bonecam.mesh.triangle_mesh import TriangleMesh, keep_faces


def cylinder(low: float, high: float, radius: float = 5.0) -> TriangleMesh:
    return revolve(np.full(2, radius), np.array([low, high]), (low, high), 64)


def test_overlapping_and_separate_solids_become_one_boundary() -> None:
    made = solid_union([cylinder(0.0, 10.0), cylinder(6.0, 14.0, 3.0), cylinder(20.0, 22.0)])
    share = cylinder(0.0, 1.0).volume
    assert made.volume == pytest.approx(12 * share + 4 * cylinder(0.0, 1.0, 3.0).volume)
    inside = MeshDistance(made).inside(np.array([[0, 0, 8.0], [4, 0, 8.0], [0, 0, 12.0], [0, 0, 17.0]]))
    assert inside.tolist() == [True, True, True, False]


def test_open_and_inward_meshes_are_refused_by_name_or_number() -> None:
    good = cylinder(0.0, 10.0)
    with pytest.raises(MeshError, match="solid 1 is not closed near"):
        solid_union([good, keep_faces(good, slice(1, None))])
    with pytest.raises(MeshError, match=r"hub\.stl is not closed near"):
        solid_union([keep_faces(good, slice(1, None)), good], ["hub.stl", "shroud.stl"])
    with pytest.raises(MeshError, match="solid 0 encloses"):
        solid_union([TriangleMesh(good.vertices, good.faces[:, ::-1])])


def test_a_revolved_polygon_is_a_closed_outward_ring() -> None:
    ring = revolve_ring(np.array([[4.0, 0.0], [6.0, 0.0], [6.0, 3.0], [4.0, 3.0]]), 256)
    assert ring.volume == pytest.approx(np.pi * (36 - 16) * 3, rel=1e-3)
