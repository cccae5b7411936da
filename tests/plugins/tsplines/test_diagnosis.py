"""Diagnosis: the models' kinds, and T-meshes whose kind is known."""

import numpy as np
import pytest
from bonecam_plugins.tsplines import diagnose, read_tsm
from tsplines import bone_like

TABLE = {  # kind, faces on which the sum is one, faces, T-junctions, crossing, touching
    "simple": ("standard", 3, 3, 1, 0, 0),
    "fan": ("standard", 32, 32, 8, 0, 16),
    "Bike": ("semi-standard", 69, 81, 2, 0, 0),
    "mouse": ("non-standard", 0, 12, 6, 0, 0),
    "face": ("non-standard", 43, 135, 16, 16, 0),
    "gearbox2-9": ("non-standard", 0, 94, 56, 50, 24),
}


@pytest.mark.parametrize("name", TABLE)
def test_the_models_are_of_their_kind(shared, name):
    surface = read_tsm(shared / "tspline" / "tsm" / f"{name}.tsm")
    found = diagnose(surface)
    assert (
        found.kind,
        found.sums_to_one,
        found.faces,
        found.junctions,
        len(found.crossing),
        len(found.touching),
    ) == TABLE[name]
    assert found.nullity == 0
    assert found.meeting == {"fan": 16, "face": 16, "gearbox2-9": 74}.get(name, 0)
    if found.unit_weights is not None:
        patches = surface.elements().patches(surface.control_points, found.unit_weights)
        np.testing.assert_allclose(patches[:, :, 3], 1, atol=1e-10)


def test_row_structured_surfaces_are_standard_and_independent():
    found = diagnose(bone_like(10, 7, 3))
    assert found.standard
    assert found.analysis_suitable
    assert found.linearly_independent
