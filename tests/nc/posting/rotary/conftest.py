"""Machines whose table has limits, and tool axes round it."""

from collections.abc import Callable

import numpy as np
import pytest

from bonecam.machine.machine import Machine, read_machine
from bonecam.tool.path import MoveKind


@pytest.fixture(scope="session")
def pointing() -> Callable[..., np.ndarray]:
    """Makes unit tool axes of tilts and azimuths, degrees."""

    def make(tilt_deg: object, azimuth_deg: object) -> np.ndarray:
        given = np.broadcast_arrays(np.asarray(tilt_deg, float), np.asarray(azimuth_deg, float))
        tilt, azimuth = np.radians(given)
        return np.column_stack([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)])

    return make


@pytest.fixture(scope="session")
def cuts() -> Callable[..., np.ndarray]:
    """Makes the kinds of a path that cuts but for its first row and some more, which are rapids."""

    def make(count: int, *rapids: int) -> np.ndarray:
        kinds = np.full(count, int(MoveKind.CUT))
        kinds[[0, *rapids]] = MoveKind.RAPID
        return kinds

    return make


@pytest.fixture
def winding(axis, write_machine, machine_text, tmp_path) -> Callable[..., Machine]:
    """Makes a machine whose table turns between two angles (deg), as an endless axis that winds or as another."""

    def build(low, high, endless=False, tilts=(-100, 0)):
        rotary = {
            "C": {**axis([0, 0, 1], [0, 0, 0], -1, low, high), "endless": endless},
            "B": axis([0, 1, 0], [0, 0, 0], -1, *tilts),
        }
        return read_machine(write_machine(tmp_path, machine_text(["C", "B", "XYZ"], rotary)))

    return build
