"""The contacts of a lump with a groove for a stubby tool, and their certified cones."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from bonecam.job import PathJob
from bonecam.machine.bodies import Frustum
from bonecam.machine.limits import MachineLimits
from bonecam.planning.axes.cones import AxisCones, admissible_cones
from bonecam.planning.scene import Scene
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import ContactPath
from bonecam.workholding.clamping import Clamping

JOB = PathJob(pattern="along")


@pytest.fixture(scope="session")
def made(lump: Callable[..., Any], roughing_cutter: Cutter) -> tuple[ContactPath, Scene]:
    """Contacts along a lump with a groove, with a stubby tool: holder and spindle come near it."""
    holder, nose = (Frustum(20.0, 16.0, 16.0),), (Frustum(30.0, 40.0, 40.0),)
    stubby = replace(roughing_cutter, overhang=14.0, holder=holder, nose=nose)
    _, contacts, scene = lump(JOB, Clamping(clearance=1.0), stubby)
    return contacts, scene


@pytest.fixture(scope="session")
def cones(made: tuple[ContactPath, Scene]) -> AxisCones:
    """The widest cones of these contacts."""
    return admissible_cones(*made, MachineLimits(np.radians(115.0)), JOB)
