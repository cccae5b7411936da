"""Contacts on closed and open surfaces, without poles and with.

Contacts all round a cylinder.

The contacts of a lump with a groove for a stubby tool, and their certified cones.
"""

from dataclasses import replace

import numpy as np
import pytest
from small_lump import at_parameters, lump
from small_parts import ROUGHING_CUTTER, revolved

from bonecam.job import PathJob
from bonecam.machine import MachineLimits
from bonecam.machine.bodies import Frustum
from bonecam.planning import admissible_cones
from bonecam.workholding import Clamping


@pytest.fixture(scope="session")
def capsule():
    """Closed, with both poles: a body of revolution 12 mm high with round ends."""
    return revolved(lambda share, azimuth: 4 * np.sqrt(np.maximum(1 - (2 * share - 1) ** 4, 0)), 0.0, 12.0)


@pytest.fixture(scope="session")
def lattice(capsule):
    """Contacts all over the capsule on 30 lines from pole to pole, each turned a little on: the seam is crossed, and
    each line ends in both poles."""
    s, t = np.meshgrid(np.arange(30) / 30, np.linspace(0, 1, 41), indexing="ij")
    s = np.mod(s + 0.3 * t / 30, 1.0)
    (low, high), (bottom, top) = capsule.domain
    parameters = np.column_stack([low + s.ravel() * (high - low), bottom + t.ravel() * (top - bottom)])
    return at_parameters(capsule, parameters, np.repeat(np.arange(30), 41))


JOB = PathJob(pattern="along")


@pytest.fixture(scope="session")
def made():
    """Contacts along a lump with a groove, with a stubby tool: holder and spindle come near it."""
    holder, nose = (Frustum(20.0, 16.0, 16.0),), (Frustum(30.0, 40.0, 40.0),)
    stubby = replace(ROUGHING_CUTTER, overhang=14.0, holder=holder, nose=nose)
    _, contacts, scene = lump(JOB, Clamping(clearance=1.0), stubby)
    return contacts, scene


@pytest.fixture(scope="session")
def cones(made):
    """The widest cones of these contacts."""
    return admissible_cones(*made, MachineLimits(np.radians(115.0)), JOB)
