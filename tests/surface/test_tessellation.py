"""What a closed tessellation is.

Tessellation: closed, outward, within the tolerance it states.

Surfaces that bound no body are told with the place.
"""

import igl
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mesh_bodies import assert_closed_sphere
from small_parts import mesh_of, pebble
from tsplines import bone_like, samples

from bonecam.errors import SurfaceError
from bonecam.surface import TSpline
from bonecam.surface.tessellation import require_valid


@settings(max_examples=12)
@given(st.integers(0, 10_000), st.integers(6, 18), st.integers(5, 16), st.sampled_from([0.3, 0.05, 0.01]))
def test_a_tessellation_is_one_closed_outward_sphere(seed, rows, around, tolerance):
    surface = bone_like(rows, around, seed)
    found = surface.tessellate_with_parameters(tolerance)
    assert_closed_sphere(found.mesh)
    assert found.deviation <= tolerance
    np.testing.assert_allclose(surface.evaluate(*found.parameters.T), found.mesh.vertices, atol=1e-12)
    centres = found.mesh.vertices[found.mesh.faces].mean(axis=1)
    foot = surface.project(centres)
    assert foot.distances.max() <= tolerance
    assert np.mean(np.einsum("ni,ni->n", found.mesh.face_vectors, surface.normals(foot.s, foot.t)) > 0) > 0.999
    assert abs(found.mesh.volume - surface.volume) <= tolerance * surface.area


def test_no_small_face_at_a_pole_turns_over():
    """Nearly collinear in (s, t) is not so round a pole: with few vertices on its ring one of these faces lay
    against the surface."""
    surface = bone_like(14, 12, 10)
    mesh = surface.tessellate(0.01)
    foot = surface.project(mesh.vertices[mesh.faces].mean(axis=1))
    assert (np.einsum("ni,ni->n", mesh.face_vectors, surface.normals(foot.s, foot.t)) > 0).all()


def test_the_surface_lies_within_the_tolerance_of_the_mesh():
    surface = bone_like(14, 12, 2)
    points = surface.evaluate(*samples(20_000))
    for tolerance in (0.1, 0.01):
        mesh = surface.tessellate(tolerance)
        squared = igl.point_mesh_squared_distance(points, mesh.vertices, mesh.faces)[0]
        assert np.sqrt(squared.max()) <= tolerance


def test_the_angle_tolerance_bounds_normals_along_edges():
    surface = bone_like(12, 10, 7, spread=0.0)
    found = surface.tessellate_with_parameters(0.2, np.radians(8))
    assert_closed_sphere(found.mesh)
    normals = surface.normals(*found.parameters.T)
    edges = found.mesh.faces[:, [0, 1]]
    long = np.linalg.norm(np.diff(found.mesh.vertices[edges], axis=1)[:, 0], axis=1) > 0.2
    cosine = np.einsum("ni,ni->n", normals[edges[:, 0]], normals[edges[:, 1]])
    assert cosine[long].min() >= np.cos(np.radians(8)) - 1e-12


def test_what_cannot_be_tessellated_is_an_error():
    surface = bone_like(8, 6)
    with pytest.raises(ValueError, match="positive"):
        surface.tessellate(0.0)
    flat = TSpline(surface.tmesh, np.zeros_like(surface.control_points), surface.weights)
    with pytest.raises(SurfaceError, match="one point"):
        flat.tessellate(0.1)


def test_rounds_that_do_not_suffice_are_told(monkeypatch):
    monkeypatch.setattr("bonecam.surface.tessellation.ROUNDS", 1)
    with pytest.raises(SurfaceError, match=r"cannot be tessellated to 0\.002 mm .* in 1 rounds?, near"):
        bone_like(8, 8, 3).tessellate(0.002)


def test_a_surface_that_cuts_itself_is_refused_with_the_place():
    sound = pebble()
    require_valid(sound, 0.05, "bone.stl")
    points = np.array(sound.control_points)
    waist = slice(1 + 12 * 4, 1 + 12 * 7)
    points[waist, :2] *= -0.3  # turned through the axis: the wall passes through itself
    crossed = TSpline(sound.tmesh, points, sound.weights)
    with pytest.raises(
        SurfaceError,
        match=r"bone\.stl: the surface of \d+ control points cuts itself in \d+ faces, first near \(.*\): raise",
    ) as caught:
        require_valid(crossed, 0.05, "bone.stl")
    low, high = mesh_of(crossed).bounds
    assert ((caught.value.evidence["place"] >= low - 0.1) & (caught.value.evidence["place"] <= high + 0.1)).all()
