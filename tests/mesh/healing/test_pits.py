from collections.abc import Callable

import numpy as np
import pytest

from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.healing.pits import REACH, _membrane, _reached, fill_pits, intrusion
from bonecam.mesh.intersections import self_intersections
from bonecam.mesh.triangle_mesh import TriangleMesh


@pytest.fixture(scope="module")
def bone(ellipsoid: Callable[..., TriangleMesh]) -> TriangleMesh:
    return ellipsoid(5, 4, 14, rings=120, columns=160)


@pytest.fixture(scope="module")
def pitted(solid: Callable[..., TriangleMesh], bone: TriangleMesh) -> Callable[[float, float], TriangleMesh]:
    """Makes an ellipsoid with a pit in its side at (5, 0, 0), about `width` mm wide and `depth` mm deep."""

    def build(width: float, depth: float) -> TriangleMesh:
        v = np.array(bone.vertices)
        away = np.linalg.norm(v - [5, 0, 0], axis=1) / (width / 2)
        v[:, 0] -= depth * np.exp(-(away**4))
        return solid(v, bone.faces)

    return build


def test_a_part_that_the_ball_reaches_everywhere_comes_back_as_it_is(
    pitted: Callable[[float, float], TriangleMesh], bone: TriangleMesh
) -> None:
    assert fill_pits(bone, 1.0) == (bone, ())
    assert fill_pits(pitted(6.0, 0.5), 1.0)[1] == ()


def test_a_narrow_pit_is_filled_up_to_the_surface_round_it_and_told(
    pitted: Callable[[float, float], TriangleMesh], bone: TriangleMesh
) -> None:
    mesh = pitted(0.9, 0.8)
    filled, told = fill_pits(mesh, 1.0)
    assert intrusion(mesh, 1.0).max() > 0.5
    assert intrusion(filled, 1.0).max() <= REACH
    assert len(told) == 1
    assert "filled pits that a ball of 1 mm cannot enter, up to 0.7" in told[0]
    moved = np.linalg.norm(filled.vertices - mesh.vertices, axis=1)
    assert mesh.vertices[np.argmax(moved), 0] == pytest.approx(4.2, abs=0.05)
    assert np.abs(MeshDistance(bone).signed(filled.vertices)).max() < 0.15
    assert not len(self_intersections(filled))


def test_nothing_moves_beyond_the_pit_and_its_rim(pitted: Callable[[float, float], TriangleMesh]) -> None:
    mesh = pitted(0.9, 0.8)
    filled, _ = fill_pits(mesh, 1.0)
    far = np.linalg.norm(mesh.vertices - [5, 0, 0], axis=1) > 1.5
    assert (filled.vertices[far] == mesh.vertices[far]).all()


def test_a_smaller_ball_goes_in(pitted: Callable[[float, float], TriangleMesh]) -> None:
    mesh = pitted(1.6, 0.6)
    assert fill_pits(mesh, 0.2)[1] == ()
    assert fill_pits(mesh, 1.5)[1]


def test_only_vertices_near_what_was_filled_can_change(
    pitted: Callable[[float, float], TriangleMesh],
) -> None:
    mesh = pitted(0.9, 0.8)
    free = np.linalg.norm(mesh.vertices - [5, 0, 0], axis=1) < 0.6
    near = _reached(mesh, free, 1.0)
    filled = _membrane(mesh, free)
    far = np.setdiff1d(np.arange(len(mesh.vertices)), near)
    assert 0 < len(near) < 0.5 * len(mesh.vertices)
    assert (intrusion(filled, 1.0)[far] == intrusion(mesh, 1.0)[far]).all()
    assert (intrusion(filled, 1.0, near) == intrusion(filled, 1.0)[near]).all()
