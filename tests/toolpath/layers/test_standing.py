"""Balls in the mesh of what stands while a layer is cut."""

import numpy as np
import pytest

from bonecam.setup.stocks.cylinder import Cylinder
from bonecam.toolpath.layers.standing import StandingMesh


def test_a_ball_enters_the_mesh_as_deep_as_it_is_within_its_radius_of_it() -> None:
    standing = StandingMesh(Cylinder(6.0, 0.0, 40.0).mesh(0.001))
    centres = np.array([[9.0, 0.0, 20.0], [7.5, 0.0, 20.0], [5.0, 0.0, 20.0]])
    depths, outward = standing.depths(centres, 2.0)
    assert depths == pytest.approx([-1.0, 0.5, 3.0], abs=0.01)
    assert outward[:, 0] == pytest.approx(1.0, abs=0.01)


def test_a_ball_that_rises_from_its_contact_enters_nothing_anew() -> None:
    standing = StandingMesh(Cylinder(6.0, 0.0, 40.0).mesh(0.001))
    contact = np.array([[7.5, 0.0, 20.0]])
    up, aside = np.array([[0.2, 0.0, 0.0]]), np.array([[0.0, 1.0, 0.0]])
    assert not standing.entered_anew(contact + up, contact, 2.0, 0.01).any()
    assert standing.entered_anew(contact + aside, contact, 2.0, 0.01).all()
