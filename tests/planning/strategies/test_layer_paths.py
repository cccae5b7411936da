"""The links of the strategies in layers, held against what stands when they run."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest

from bonecam.job import Job
from bonecam.levels.measure import Level
from bonecam.machine.limits import MachineLimits
from bonecam.material.dexels import CutDexels, uncut_rays
from bonecam.planning.strategies import plan_layer_paths
from bonecam.setup.capsule import Capsule
from bonecam.surface.tspline import TSpline
from bonecam.tool.path import MoveKind, ToolPath

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
def test_links_of_layers_remove_nothing_that_the_proof_would_refuse(
    grooved_pebble: Callable[..., TSpline], level_of: Callable[..., Level], upright_capsule: Capsule
) -> None:
    job = COARSE.with_values(path={"strategy": "rotary"})
    paths = plan_layer_paths([level_of(grooved_pebble(1.2))], upright_capsule, job, MachineLimits(np.radians(115.0)))
    rays = uncut_rays(upright_capsule)
    worst = []
    for path in paths:
        volumes, rays = replayed(path, rays)
        worst += volumes
    assert len(worst) > len(paths)
    assert max(worst) <= 0.02
