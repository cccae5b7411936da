"""The links of the strategies in layers, held against what stands when they run.

Outlines of slices whose cells show less than the balls that ask.
"""

from itertools import pairwise

import numpy as np
import pytest
from small_parts import UPRIGHT_CAPSULE, grooved_pebble, level_of

from bonecam.job import Job
from bonecam.machine import MachineLimits
from bonecam.material.dexels import CutDexels, uncut_rays
from bonecam.planning import plan_layer_paths
from bonecam.planning.layers import FlatChart
from bonecam.planning.strategies import SPACED, STRAIGHT, offset_curves
from bonecam.tool import MoveKind, ToolPath

COARSE = Job().with_values(
    levels={"roughing_depth": 1.5, "finishing_depth": 0.3},
    roughing={"scallop": 0.4},
    finishing={"scallop": 0.2},
    path={"chord_tolerance": 0.05, "gouge_tolerance": 0.1},
    holding={"diameter": 2.0, "length": 30.0},
)


def replayed(path: ToolPath, rays: CutDexels) -> tuple[list[float], CutDexels]:
    """What each link of a path removes, mm^3, when its moves run one after the other; and what stands behind it."""
    radius, reach = path.cutter.radius, path.cutter.reach
    poses = path.tips + radius * path.axes, path.axes
    is_link = path.kinds == MoveKind.LINK
    edges = np.r_[1, 1 + np.flatnonzero(np.diff(is_link[1:])) + 1, len(is_link)]
    left, volumes = rays.cutters, []
    for first, end in pairwise(edges):
        line = tuple(each[first - 1 : end] for each in poses)
        if is_link[first]:
            volumes.append(float(left.removed_by([line], [tuple(e[:1] for e in line)], radius, reach)[0]))
        left = left.without(tuple(e[:-1] for e in line), tuple(e[1:] for e in line), radius, reach)
    return volumes, CutDexels(rays.balls, left)


@pytest.mark.slow
def test_links_of_layers_remove_nothing_that_the_proof_would_refuse():
    job = COARSE.with_values(path={"strategy": "rotary"})
    paths = plan_layer_paths([level_of(grooved_pebble(1.2))], UPRIGHT_CAPSULE, job, MachineLimits(np.radians(115.0)))
    rays = uncut_rays(UPRIGHT_CAPSULE)
    worst = []
    for path in paths:
        volumes, rays = replayed(path, rays)
        worst += volumes
    assert len(worst) > len(paths)
    assert max(worst) <= 0.02


X, Y = np.eye(3)[:2]


def test_an_outline_bends_round_a_bulge_that_is_lower_than_a_cell():
    """A wall along b with a bulge of 0.12 mm, which ends before the first line beside the wall."""
    chart = FlatChart(-Y, X, np.arange(-3.005, 4.0, 0.15), np.arange(0.0, 12.0, 0.15))

    def wall(b):
        return 0.12 * np.exp(-((b - 6.0) ** 2))

    a, b = np.meshgrid(chart.a, chart.b, indexing="ij")
    blocked = a < wall(b)
    assert (blocked == blocked[:, :1]).all(), "the cells show no bulge"
    rests = np.where(blocked, 2.0, 0.0)
    sets = offset_curves(chart, rests, 1.0, 0.8, lambda across, along: across >= wall(along))
    line = max(sets[-1], key=len)
    steps = np.linspace(0.0, 1.0, 50)[:, None, None]
    on_line = ((1 - steps) * line[:-1] + steps * line[1:]).reshape(-1, 2)
    inside = wall(on_line[:, 1]) - on_line[:, 0]
    assert inside.max() < STRAIGHT + SPACED**2 * 0.24 / 8 + 0.001
    assert np.abs(inside).max() < 2 * STRAIGHT
