"""Balls in the mesh of what stands while a layer is cut."""

import numpy as np

from bonecam.planning.layers import CELL, DEVIATION, FlatChart, HeightMesh, stock_field
from bonecam.setup.stocks.cylinder import Cylinder


def test_a_ball_enters_no_deeper_than_is_told() -> None:
    stock = Cylinder(6.0, 0.0, 20.0)
    across = np.arange(-7.0, 7.0, CELL)
    chart = FlatChart(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]), across, np.arange(-1.0, 21.0, CELL))
    standing = HeightMesh(stock_field(chart, stock, 8.0).mesh())
    around, along = (each.ravel() for each in np.meshgrid(np.linspace(0.0, 6.2, 60), np.linspace(-1.0, 21.0, 40)))
    centres = np.column_stack([7.5 * np.cos(around), 7.5 * np.sin(around), along])
    over = standing.depths(centres, 2.0)[0] - (2.0 - stock.signed_distance(centres))
    assert over.min() >= 0.0, "the mesh ends up to a cell before the edge of what stands"
    assert over.max() <= 1.5 * DEVIATION


def test_a_ball_that_rises_from_its_contact_enters_nothing_anew() -> None:
    standing = HeightMesh(Cylinder(6.0, 0.0, 40.0).mesh(0.001))
    contact = np.array([[7.5, 0.0, 20.0]])
    up, aside = np.array([[0.2, 0.0, 0.0]]), np.array([[0.0, 1.0, 0.0]])
    assert not standing.entered_anew(contact + up, contact, 2.0, 0.01).any()
    assert standing.entered_anew(contact + aside, contact, 2.0, 0.01).all()
