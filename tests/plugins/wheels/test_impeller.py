"""The shipped impeller is what its recipe makes: 108 mm across, one blade as rows, the rest as closed obstacles."""

import bonecam_meshes
import numpy as np
import pytest
from bonecam_meshes import impeller

from bonecam.mesh import MeshDistance, read_mesh, self_intersections
from bonecam.wheels import read_sections


def test_recipe_makes_the_shipped_rows(tmp_path):
    impeller.write_rows(impeller.sections(), tmp_path / "rows.txt")
    assert (tmp_path / "rows.txt").read_text() == bonecam_meshes.path("impeller_blade").read_text()
    rows = read_sections(bonecam_meshes.path("impeller_blade"))
    assert rows.closed
    assert [len(row) for row in rows.rows] == [72] * impeller.SECTIONS


def test_the_recipe_makes_the_shipped_solids():
    made = impeller.make()
    wheel = {"hub": made.hub, "shroud": made.shroud, "blades": impeller.joined(made.blades[1:])}
    for name, mesh in wheel.items():
        shipped = read_mesh(bonecam_meshes.path(f"impeller_{name}"))
        assert shipped.volume == pytest.approx(mesh.volume, rel=1e-5)
        assert len(shipped.faces) == pytest.approx(len(mesh.faces), rel=0.02)
        assert not len(self_intersections(shipped))
    assert np.ptp(made.hub.bounds, axis=0)[:2] == pytest.approx([108.0, 108.0], abs=0.1)
    assert len(made.blades) == impeller.BLADES


def test_the_blade_stands_free_between_hub_neighbours_and_casing():
    points = np.vstack(impeller.sections(0.1))
    away = {
        name: MeshDistance(read_mesh(bonecam_meshes.path(f"impeller_{name}"))).signed(points).min()
        for name in ("hub", "blades", "shroud")
    }
    assert away["hub"] > 0
    assert away["blades"] > 2 * 2.0
    assert away["shroud"] > 0.3
