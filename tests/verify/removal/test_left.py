"""What stays on a part, by the reason why."""

import numpy as np
import pytest

from bonecam.machine.machine import read_machine
from bonecam.nc.path_words import machine_limits
from bonecam.setup.capsule import Capsule
from bonecam.verify.findings import Left, Spot, beside_limits
from bonecam.verify.sweeping import NormalProbes

NOWHERE = Spot(0.0, 0, (0.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("name", "tilt_deg", "caps"),
    [("mill-4axis", 75.0, 2), ("mill-4axis", 60.0, 2), ("mikron-ucp600", 75.0, 0), ("mikron-ucp600", 30.0, 1)],
)
def test_places_that_no_tool_axis_faces_are_a_reason(name: str, tilt_deg: float, caps: int) -> None:
    """On a ball of 1 mm they are caps: about both ends under a level tool, about the lower one where it leans by 114
    degrees at most."""
    count = 20_000
    heights = 1 - (2 * np.arange(count) + 1) / count
    azimuths = np.pi * (1 + 5**0.5) * np.arange(count)
    level = np.sqrt(1 - heights**2)[:, None] * np.column_stack([np.cos(azimuths), np.sin(azimuths)])
    normals = np.column_stack([level, heights])
    areas = np.full(count, 4 * np.pi / count)
    mesh = Capsule(np.zeros(3), np.zeros(3), 1.0).mesh(0.1)
    probes = NormalProbes(mesh, normals, normals, areas)
    reasons = {"post": 7.0, "tailstock": 0.0, "gouge": 1.0, "reachable": float(areas.sum())}
    left = Left(mesh, probes.heights, NOWHERE, NOWHERE, reasons, reachable=np.arange(count))
    told = beside_limits(left, probes, machine_limits(read_machine(name)), np.radians(tilt_deg))
    half = 90.0 - tilt_deg if name == "mill-4axis" else 180.0 - 114.0 - tilt_deg
    expected = caps * 2 * np.pi * (1 - np.cos(np.radians(half)))
    assert told.by_reason["limits"] == pytest.approx(expected, rel=0.02)
    assert told.by_reason["limits"] + told.by_reason["reachable"] == pytest.approx(reasons["reachable"])
    assert told.area == pytest.approx(left.area)
    assert len(told.reachable) < len(left.reachable) or not caps
