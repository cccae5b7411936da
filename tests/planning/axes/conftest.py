"""Contacts on closed and open surfaces, without poles and with.

Contacts all round a cylinder.

The contacts of a lump with a groove for a stubby tool, and their certified cones.
"""

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
from bonecam.surface.tspline import TSpline
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import ContactPath
from bonecam.workholding.clamping import Clamping


@pytest.fixture(scope="session")
def capsule(revolved: Callable[..., TSpline]) -> TSpline:
    """Closed, with both poles: a body of revolution 12 mm high with round ends."""
    return revolved(lambda share, azimuth: 4 * np.sqrt(np.maximum(1 - (2 * share - 1) ** 4, 0)), 0.0, 12.0)


@pytest.fixture(scope="session")
def at_parameters(finishing_cutter: Cutter) -> Callable[..., ContactPath]:
    """Makes the contacts of a surface at parameters (n, 2), of one pass or of the passes given."""

    def build(surface: TSpline, parameters: np.ndarray, passes: np.ndarray | None = None) -> ContactPath:
        s, t = parameters.T
        count = len(s)
        points, normals = surface.positions(s, t), surface.normals(s, t)
        return ContactPath(
            level=0,
            cutter=finishing_cutter,
            pass_index=np.zeros(count, dtype=np.int64) if passes is None else passes,
            parameters=parameters,
            contacts=points,
            normals=normals,
            feeds=np.zeros((count, 3)),
            centres=points + finishing_cutter.radius * normals,
            lifts=np.zeros(count),
            ramp=np.zeros(count, dtype=bool),
            uncut=np.zeros((0, 3)),
            reasons=(),
        )

    return build


@pytest.fixture(scope="session")
def lattice(capsule: TSpline, at_parameters: Callable[..., ContactPath]) -> ContactPath:
    """Contacts all over the capsule on 30 lines from pole to pole, each turned a little on: the seam is crossed, and
    each line ends in both poles."""
    s, t = np.meshgrid(np.arange(30) / 30, np.linspace(0, 1, 41), indexing="ij")
    s = np.mod(s + 0.3 * t / 30, 1.0)
    (low, high), (bottom, top) = capsule.domain
    parameters = np.column_stack([low + s.ravel() * (high - low), bottom + t.ravel() * (top - bottom)])
    return at_parameters(capsule, parameters, np.repeat(np.arange(30), 41))


@pytest.fixture(scope="session")
def cylinder_contacts(finishing_cutter: Cutter) -> Callable[[TSpline], ContactPath]:
    """Makes contacts on 24 lines along the middle of a closed surface."""

    def build(surface: TSpline) -> ContactPath:
        (low, high), (bottom, top) = surface.domain
        s, t = np.meshgrid(np.arange(24) / 24, np.linspace(0.3, 0.7, 15), indexing="ij")
        s, t = low + s.ravel() * (high - low), bottom + t.ravel() * (top - bottom)
        points, normals, count = surface.positions(s, t), surface.normals(s, t), len(s)
        return ContactPath(
            level=0,
            cutter=finishing_cutter,
            pass_index=np.repeat(np.arange(24), 15),
            parameters=np.column_stack([s, t]),
            contacts=points,
            normals=normals,
            feeds=np.zeros((count, 3)),
            centres=points + normals,
            lifts=np.zeros(count),
            ramp=np.zeros(count, dtype=bool),
            uncut=np.zeros((0, 3)),
            reasons=(),
        )

    return build


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
