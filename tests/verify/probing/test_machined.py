"""The surface that a program leaves at any place is that of the simulation's own normal probes."""

import numpy as np


def test_places_of_the_simulation_come_out_as_it_tells_them(posted):
    probes = posted.removal.remaining.normal_probes
    some = np.flatnonzero(probes.owners >= 0)[::40]
    found = posted.machined(probes.points[some])
    assert np.abs(found.points - probes.points[some]).max() < 1e-6
    assert np.abs(found.cut - probes.heights[some]).max() < 1e-5
    assert (found.owners == probes.owners[some]).mean() > 0.95, "two moves that cut as deep may change places"
    assert (found.kept == found.cut).all(), "bending was not asked"


def test_what_no_ball_came_near_stands_as_the_rays_tell(posted):
    top = posted.part.positions(np.zeros(1), np.array([0.97]))
    found = posted.machined(top)
    assert found.owners[0] < 0
    assert found.cut[0] > 0.3
