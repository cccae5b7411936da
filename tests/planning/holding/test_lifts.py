"""How much higher a ball must be, against all slices of its tool over table and columns."""

import numpy as np

from bonecam.arrays import unit
from bonecam.planning.axes.lead import LEAVING, ROOM
from bonecam.planning.post_length import SLICE, needed_lifts
from bonecam.tool.cutter import Cutter
from bonecam.workholding.clamping import Clamping
from bonecam.workholding.post import Column


def test_a_lift_is_the_largest_that_any_slice_asks_for_over_table_and_columns(finishing_cutter: Cutter) -> None:
    random = np.random.default_rng(3)
    columns = Column(14.0, 20.0, 0.0), Column(40.0, 6.0, 0.0)
    clamping = Clamping(columns, closed=True, clearance=1.0, stub=Column(6.0, 30.0, 20.0))
    centres = random.normal(size=(40, 3)) * [9.0, 9.0, 12.0] + [0.0, 0.0, 36.0]
    axes = unit(random.normal(size=(60, 3)))
    found = needed_lifts(centres, axes, finishing_cutter, clamping)
    expected = np.full(found.shape, -np.inf)
    low, over = np.maximum(-axes[:, 2], 0.0) * LEAVING, 0
    flat = np.hypot(axes[:, 0], axes[:, 1])
    for section in finishing_cutter.profile:
        count = int(np.ceil((section.end - section.start) / SLICE)) + 1
        for height in np.linspace(section.start, section.end, count) - finishing_cutter.radius:
            at = centres[:, None] + height * axes
            under = at[..., 2] - section.widest * flat - low
            expected = np.maximum(expected, clamping.clearance + ROOM - under)
            for column in clamping.solids:
                room = clamping.room(column, section.name) + ROOM
                near = np.hypot(at[..., 0], at[..., 1]) < column.radius + room + section.widest
                over += near.sum()
                expected = np.where(near, np.maximum(expected, room + column.top - under), expected)
    assert over > 1000
    np.testing.assert_allclose(found, expected, atol=1e-9)
    assert (found > clamping.clearance + ROOM).any()
