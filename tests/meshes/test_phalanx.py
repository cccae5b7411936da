"""The shipped phalanx is what its recipe makes: closed, genus 0, in mm, without self-intersections."""

import bonecam_meshes
import igl
import igl.copyleft.cgal
import numpy as np
import pymeshlab
import pytest
from bonecam_meshes import phalanx

from bonecam.mesh import TriangleMesh


@pytest.fixture(scope="module")
def shipped():
    meshes = pymeshlab.MeshSet()
    meshes.load_new_mesh(str(bonecam_meshes.path("phalanx")))
    return TriangleMesh(meshes.current_mesh().vertex_matrix(), meshes.current_mesh().face_matrix().astype(np.int32))


@pytest.fixture(scope="module")
def made():
    return phalanx.make()


def test_recipe_makes_the_shipped_geometry(shipped, made):
    assert np.abs(phalanx.distance(shipped.vertices)).max() < 1e-5
    assert np.abs(shipped.bounds - made.bounds).max() < 0.05
    assert shipped.volume == pytest.approx(made.volume, rel=1e-3)
    assert len(shipped.faces) == pytest.approx(len(made.faces), rel=0.05)


def test_recipe_is_deterministic(made, tmp_path):
    phalanx.write(made, tmp_path / "first.ply")
    phalanx.write(phalanx.make(), tmp_path / "second.ply")
    assert (tmp_path / "first.ply").read_bytes() == (tmp_path / "second.ply").read_bytes()


def test_phalanx_is_closed_of_genus_0_and_free_of_self_intersections(shipped):
    edges = np.vstack([shipped.faces[:, [0, 1]], shipped.faces[:, [1, 2]], shipped.faces[:, [2, 0]]])
    assert len(np.unique(edges, axis=0)) == len(edges), "each directed edge once"
    assert (np.unique(edges, axis=0) == np.unique(edges[:, ::-1], axis=0)).all(), "each with its opposite"
    assert len(shipped.vertices) - len(edges) // 2 + len(shipped.faces) == 2
    pieces, _ = igl.facet_components(shipped.faces)
    assert pieces == 1
    found = igl.copyleft.cgal.remesh_self_intersections(shipped.vertices, shipped.faces, detect_only=True)
    assert len(found[2]) == 0
    assert shipped.volume > 0


def test_docstring_states_the_counts_and_size_of_the_file(shipped):
    text = phalanx.__doc__ or ""
    size = " x ".join(f"{length:.1f}" for length in shipped.bounds[1] - shipped.bounds[0])
    assert f"{len(shipped.vertices):,} vertices, {len(shipped.faces):,} faces" in text
    assert f"{size} mm" in text
    assert f"{shipped.volume:,.0f} mm^3" in text
    assert bonecam_meshes.path("phalanx").stat().st_size < 200_000


def test_unknown_name_is_refused_with_the_known_ones():
    with pytest.raises(ValueError, match=r"'femur'.*phalanx"):
        bonecam_meshes.path("femur")
