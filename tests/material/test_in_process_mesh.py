"""The mesh of what stands holds what rays tell."""

import numpy as np

from bonecam.material.dexels import uncut_rays
from bonecam.material.in_process_stock import DEVIATION, holding
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.setup.stocks.cylinder import Cylinder

BAR = Cylinder(5.0, 10.0, 30.0)


def beyond(mesh: TriangleMesh, ends: np.ndarray) -> np.ndarray:
    """How far what lies outside a mesh is from it, mm."""
    surface = MeshDistance(mesh)
    return np.maximum(surface.signed(ends), 0.0)


def test_a_mesh_that_cuts_an_edge_off_is_moved_out_to_it() -> None:
    mesh, ends = BAR.mesh(0.01), uncut_rays(BAR).balls.ends
    assert beyond(mesh, ends).max() < 0.02
    away = np.linalg.norm(mesh.vertices - [5.0, 0.0, 30.0], axis=1)
    cut_off = mesh.vertices - np.clip(1.5 - away, 0, None)[:, None] * np.array([0.7, 0.0, 0.7])
    cut = TriangleMesh(cut_off, mesh.faces)
    assert beyond(cut, ends).max() > 0.5
    held = holding(cut, ends)
    assert beyond(held, ends).max() <= DEVIATION + 0.01
    far = away > 4.0
    assert np.array_equal(held.vertices[far], mesh.vertices[far])


def test_a_mesh_that_holds_all_stays_as_it_is() -> None:
    mesh = BAR.mesh(0.01)
    assert holding(mesh, uncut_rays(BAR).balls.ends) is mesh
