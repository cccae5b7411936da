"""Contacts on closed and open surfaces, without poles and with.

Contacts all round a cylinder.

The contacts of a lump with a groove for a stubby tool, and their certified cones.
"""

from dataclasses import replace

import numpy as np
import pytest
from small_lump import lattice_on, lump, round_capsule
from small_parts import ROUGHING_CUTTER

from bonecam.job import PathJob
from bonecam.machine import MachineLimits
from bonecam.machine.bodies import Frustum
from bonecam.planning import admissible_cones
from bonecam.workholding import Clamping


@pytest.fixture(scope="session")
def capsule():
    """Closed, with both poles: a body of revolution 12 mm high with round ends."""
    return round_capsule()


@pytest.fixture(scope="session")
def lattice(capsule):
    """Contacts all over the capsule."""
    return lattice_on(capsule)


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
