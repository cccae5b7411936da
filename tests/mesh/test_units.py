import numpy as np
import pytest
from mesh_bodies import ellipsoid, moved

from bonecam.errors import UnitsError
from bonecam.mesh import TriangleMesh, to_mm
from bonecam.mesh.units import mirror_and_scale


@pytest.fixture(scope="module")
def bone():
    return ellipsoid(5, 5, 14)


@pytest.mark.parametrize(("units", "scale"), [("mm", 1.0), ("m", 1000.0), ("inch", 25.4), ("cm", 10.0)])
def test_every_unit_gives_the_same_bone_in_mm(bone, units, scale):
    assert to_mm(moved(bone, (0, 0, 0), 1 / scale), units).diagonal == pytest.approx(bone.diagonal)


@pytest.mark.parametrize(
    ("scale", "told"),
    [
        (0.001, r"^bone\.stl: 0\.0314 mm .*: is it in m, or .* give --units m \(31\.4 mm\), or mesh\.units in a job$"),
        (
            0.03,
            r"is it in m, in inch, in cm, or wrongly scaled\? give --units m \(941 mm\) or --units inch \(23\.9 mm\) "
            r"or --units cm \(9\.41 mm\), or mesh\.units in a job$",
        ),
        (1e6, "scale the mesh"),
    ],
)
def test_a_size_that_is_no_bone_s_is_refused_with_the_units_that_fit(bone, scale, told):
    with pytest.raises(UnitsError, match=told):
        to_mm(moved(bone, (0, 0, 0), scale), "mm", "bone.stl")


def test_the_remedy_is_worded_for_who_asks_and_an_unknown_unit_is_a_wrong_call(bone):
    with pytest.raises(UnitsError, match=r'write units="m" \(31\.4 mm\)'):
        to_mm(moved(bone, (0, 0, 0), 0.001), "mm", flag='write units="{}"')
    with pytest.raises(ValueError, match="furlong"):
        to_mm(bone, "furlong")


@pytest.mark.parametrize("axis", ["none", "x", "y", "z"])
@pytest.mark.parametrize("scale", [1.0, 1.25])
def test_a_mirrored_and_scaled_mesh_encloses_what_it_should(axis, scale):
    mesh = ellipsoid(5, 4, 14, thick_end=0.2)
    lopsided = TriangleMesh(mesh.vertices + 0.1 * mesh.vertices[:, [1, 2, 0]] ** 2, mesh.faces)
    made = mirror_and_scale(lopsided, axis, scale)
    assert made.volume == pytest.approx(lopsided.volume * scale**3)
    signs = [-1 if name == axis else 1 for name in "xyz"]
    assert np.allclose(made.vertices, scale * lopsided.vertices * signs)
    assert (made is lopsided) == (axis == "none" and scale == 1)
    again = mirror_and_scale(made, axis)
    assert np.allclose(again.vertices, scale * lopsided.vertices)
    assert (again.faces == lopsided.faces).all()
