"""Depths at single points: what the pictures and the coloured layers show."""

import numpy as np
import pytest
from level_parts import waisted

from bonecam.levels import RoundedLevel, levels_in, step_depths
from bonecam.levels.measure import POINTS, line_depths
from bonecam.report.pictures import draw_depths
from bonecam.setup import Capsule, Cylinder, Schedule

BAR = Cylinder(4.5, 0.0, 20.0)


@pytest.fixture(scope="module")
def made():
    return levels_in(waisted(), BAR, Schedule((0.2,), 1.0), chord_tolerance=0.05)


def test_no_point_of_the_line_is_deeper_than_the_cut_may_be(made):
    depths = line_depths(made.levels, BAR)
    body = next(level for level in made.levels if isinstance(level, RoundedLevel))
    assert depths.shape == (body.index, POINTS)
    limits = np.array([level.limit for level in made.levels[1 : body.index + 1]])
    assert (depths.max(axis=1) <= limits + 0.003).all()
    assert depths[0].mean() > 0.8 * limits[0]


def test_the_last_cut_s_depths_are_smooth_whatever_the_stock_s_mesh():
    stock = Capsule(np.array([0.0, 0.0, 4.5]), np.array([0.0, 0.0, 15.5]), 4.5)
    made = levels_in(waisted(), stock, Schedule((0.2,), 1.0), chord_tolerance=0.05)
    last = line_depths(made.levels, stock)[-1]
    assert np.abs(np.diff(last, 3)).max() < 5e-4  # 0.0001; to the mesh within 0.05 mm of the capsule 0.008


def test_every_vertex_carries_the_depth_of_its_cut(made):
    found = step_depths(made.levels)
    assert not found[0].any()
    for level, depth in zip(made.levels, found):
        assert len(depth) == len(level.mesh.vertices)
        assert depth.max() <= level.limit + 0.002


def test_the_picture_of_depths_is_drawn(made, tmp_path):
    draw_depths(made.levels, line_depths(made.levels, BAR), tmp_path / "depths.png")
    assert (tmp_path / "depths.png").read_bytes().startswith(b"\x89PNG")
