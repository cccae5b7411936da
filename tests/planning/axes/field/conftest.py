"""Contacts all round a cylinder."""

from collections.abc import Callable

import numpy as np
import pytest

from bonecam.surface.tspline import TSpline
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import ContactPath


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
