"""The compliance of cutters against cantilevers that are known."""

import numpy as np
import pytest

from bonecam.job import Job
from bonecam.machine.bodies import Frustum
from bonecam.mechanics.edges import CARBIDE, CORE, across, cutter_compliance
from bonecam.tool.cutter import Cutter

HOLDER = (Frustum(50.0, 20.0, 20.0),)


def ball(radius, flutes, shank, overhang):
    return Cutter(1, "finishing", radius, flutes, shank, overhang, HOLDER, 4500.0, 900.0, 0.01)


def test_a_straight_shank_bends_as_a_cantilever_from_the_balls_centre():
    made = ball(1.0, 1.0, 2.0, 25.0)  # no flutes above the ball
    second = np.pi / 4
    assert cutter_compliance(made) == pytest.approx(24.0**3 / (3 * CARBIDE * second), rel=1e-12)


def test_flutes_and_shank_are_steps_of_one_beam():
    made = ball(1.0, 4.0, 4.0, 15.0)
    flutes = 3.0**3 / (3 * np.pi / 4 * CORE**4)
    shank = (14.0**3 - 3.0**3) / (3 * np.pi / 4 * 2.0**4)
    assert cutter_compliance(made) == pytest.approx((flutes + shank) / CARBIDE, rel=1e-12)


@pytest.mark.parametrize(("name", "most"), [("roughing", 0.5e-3), ("finishing", 2.5e-3)])
def test_the_default_cutters_bend_by_mohrs_integral(name, most):
    cutter = Cutter.from_job(1, name, Job().tool(name))
    x = np.linspace(0, cutter.overhang - cutter.radius, 200_001)
    radius = np.empty_like(x)
    for piece in cutter.profile:
        here = (x >= piece.start - cutter.radius) & (x <= piece.end - cutter.radius)
        radius[here] = (CORE if piece.name == "cutter" else 1.0) * (
            piece.radius + piece.taper * (x[here] - piece.start + cutter.radius)
        )
    y = x**2 / (CARBIDE * np.pi / 4 * radius**4)
    mohr = float(((y[1:] + y[:-1]) / 2 * np.diff(x)).sum())
    assert cutter_compliance(cutter) == pytest.approx(mohr, rel=1e-3)
    assert cutter_compliance(cutter) < most


def test_a_force_along_the_axis_bends_nothing():
    axes = np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8]])
    made = across(2e-3, axes)
    assert np.abs(np.einsum("nij,nj->ni", made, axes)).max() < 1e-15
    assert made[0] @ np.array([1.0, 0.0, 0.0]) == pytest.approx([2e-3, 0.0, 0.0])
