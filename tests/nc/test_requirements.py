"""What a job may ask of a machine: here the time for its passes."""

import numpy as np
import pytest

from bonecam.errors import JobError
from bonecam.job import Job
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.nc.requirements import check_length, least_length
from bonecam.setup.capsule import Capsule

CORNERS = np.array([[0, 0, 0], [10, 0, 0], [0, 10, 0], [0, 0, 10]], dtype=float)
FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]], dtype=np.int32)
PART = TriangleMesh(CORNERS, FACES)
"""A corner of a cube: 1000 / 6 mm^3."""


def test_the_least_length_of_the_passes_is_volume_by_depth_and_step() -> None:
    fine, coarse = (2 * np.sqrt(h * (2 * r - h)) for r, h in ((1.0, 0.01), (2.0, 0.05)))
    levels = {"depths": "0.1 0.2 0.5"}
    left = 700 - PART.area * (0.1 + 0.2)
    told = PART.area / fine + PART.area / coarse + left / (0.5 * coarse)
    found = least_length(PART, 700 + PART.volume, Job().with_values(levels=levels))
    assert found == pytest.approx(told, rel=1e-12)
    assert least_length(PART, PART.volume - 1, Job()) == 0


def test_a_stock_that_takes_days_to_cut_is_refused_with_the_hours() -> None:
    stock = Capsule(np.zeros(3), np.array([0.0, 0.0, 30.0]), 50.0)
    what = r"\[path\] most_length = 500: .* 7\.55e\+05 mm3 .* takes 1702 m of passes or more, 32 h: give a"
    with pytest.raises(JobError, match=what):
        check_length(PART, stock, Job())
    check_length(PART, stock, Job().with_values(path={"most_length": 3000.0}))
    deep = {"levels": {"roughing_depth": 2.0}, "roughing": {"radius": 8.0, "scallop": 0.2}}
    check_length(PART, stock, Job().with_values(**deep))
