"""Programs set up again where their samples are: targets slide beside the samples, but not at the poles."""

from collections.abc import Callable

import numpy as np

from bonecam.arrays import dots
from bonecam.levels.program import LevelProgram


def test_targets_keep_their_way_along_the_normals_and_stand_still_at_the_poles(
    first_program: Callable[[], LevelProgram],
) -> None:
    before = first_program()
    moves = np.tile([0.02, -0.01, 0.03], (before.R.shape[1], 1))
    after = before.at(moves)
    y, knots = before.x + before.R @ moves, np.unique(before.limits.before.tmesh.t_knots)
    free = (after.limits.t > knots[1]) & (after.limits.t < knots[-2])
    assert free.any()
    assert (~free).any()
    assert np.array_equal(after.H[~free], before.H[~free])
    along = dots(before.H - y, after.limits.n)
    assert np.allclose((after.H - y)[free], (along[:, None] * after.limits.n)[free], atol=1e-12)
    assert np.abs(after.H - before.H)[free].max() > 1e-3
