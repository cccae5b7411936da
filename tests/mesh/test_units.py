import pytest
from solids import ellipsoid, moved

from bonecam.errors import UnitsError
from bonecam.mesh.units import to_mm

BONE = ellipsoid(5, 5, 14)


@pytest.mark.parametrize(("units", "scale"), [("mm", 1.0), ("m", 1000.0), ("inch", 25.4)])
def test_every_unit_gives_the_same_bone_in_mm(units: str, scale: float) -> None:
    assert to_mm(moved(BONE, (0, 0, 0), 1 / scale), units).diagonal == pytest.approx(BONE.diagonal)


def test_metres_taken_for_mm_are_refused_with_the_flag_that_fits() -> None:
    with pytest.raises(
        UnitsError,
        match=r"bone\.stl: 0\.0314 mm .* give --units m or in a job mesh\.units = \"m\" \(31\.4 mm\)",
    ):
        to_mm(moved(BONE, (0, 0, 0), 0.001), "mm", "bone.stl")


def test_the_remedy_is_worded_for_who_asks() -> None:
    with pytest.raises(UnitsError, match=r'write units="m" \(31\.4 mm\)'):
        to_mm(moved(BONE, (0, 0, 0), 0.001), "mm", flag='write units="{}"')


def test_a_size_no_unit_fits_and_an_unknown_unit_are_refused() -> None:
    with pytest.raises(UnitsError, match="scale the mesh"):
        to_mm(moved(BONE, (0, 0, 0), 1e6), "mm")
    with pytest.raises(ValueError, match="furlong"):
        to_mm(BONE, "furlong")
