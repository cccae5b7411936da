"""A path repeated about the Z axis is the same path at every pitch.

The links of the strategies in layers, held against what stands when they run.

Outlines of slices whose cells show less than the balls that ask.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from small_parts import UPRIGHT_CAPSULE, grooved_pebble, level_of

from bonecam.job import Job
from bonecam.machine import MachineLimits
from bonecam.material.dexels import CutDexels, uncut_rays
from bonecam.planning import plan_layer_paths
from bonecam.planning.layers import FlatChart
from bonecam.planning.strategies import SPACED, STRAIGHT, indexed, offset_curves
from bonecam.tool import Cutter, FreeCones, MoveKind, ToolPath
from bonecam.tool.elliptic_cones import EllipticCones

RNG = np.random.default_rng(7)
ROWS = 6


def path(cutter: Cutter) -> ToolPath:
    """A pass of four cuts between two safe points over Z."""
    up = np.array([0.0, 0.0, 1.0])
    axes = RNG.normal(size=(ROWS, 3)) + 3 * up
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    axes[[0, -1]] = up
    tips = RNG.normal(size=(ROWS, 3)) + np.array([20.0, 0.0, 0.0])
    tips[[0, -1]] = 50 * up
    cut = np.array([False, True, True, True, True, False])
    contacts = np.where(cut[:, None], tips + 1.0, np.nan)
    shapes = EllipticCones.circular(axes[1:3], np.full(2, 0.1))
    cones = FreeCones(tips[1:3], shapes, np.array([-1, 0, 0, 1, 1, -1]))
    return ToolPath(
        level=2,
        cutter=cutter,
        kinds=np.where(cut, int(MoveKind.CUT), int(MoveKind.RAPID)),
        pass_index=np.where(cut, 0, -1),
        parameters=contacts[:, :2],
        contacts=contacts,
        tips=tips,
        axes=axes,
        feed_rates=np.full(ROWS, 1000.0),
        uncut=np.array([[20.0, 1.0, 2.0]]),
        reasons=("gouge",),
        trimmed=2.0,
        blocked_by={"shank": 1},
        cones=cones,
        lifts=np.array([[1, 2]]),
    )


@pytest.fixture
def cutter():
    import bonecam

    return Cutter.from_job(1, "roughing", bonecam.Job().tool("roughing"), ())


def test_each_copy_is_turned_by_a_pitch_more(cutter):
    one = path(cutter)
    made = indexed(one, 5)
    for k in range(5):
        turn = Rotation.from_euler("z", 72.0 * k, degrees=True).as_matrix()
        rows = slice(k * ROWS, (k + 1) * ROWS)
        for name in ("tips", "axes", "contacts"):
            np.testing.assert_allclose(getattr(made, name)[rows], getattr(one, name) @ turn.T, atol=1e-12)
        assert made.pass_index[rows].max() == k
        assert (made.lifts[k] == one.lifts[0] + k * ROWS).all()
        assert made.cones is not None
        assert one.cones is not None
        places = made.cones.cone_of[rows][1:5]
        np.testing.assert_allclose(made.cones.apexes[places], one.cones.apexes[[0, 0, 1, 1]] @ turn.T, atol=1e-12)
        np.testing.assert_allclose(
            made.cones.shapes.axes[places], one.cones.shapes.axes[[0, 0, 1, 1]] @ turn.T, atol=1e-12
        )
    assert (made.reasons, made.trimmed, made.blocked_by) == (("gouge",) * 5, 10.0, {"shank": 5})
    assert (made.kinds.reshape(5, ROWS) == one.kinds).all()


def test_a_path_that_does_not_end_over_the_axis_is_not_repeated(cutter):
    one = path(cutter)
    aside = replace(one, tips=one.tips + np.array([0.5, 0.0, 0.0]))
    with pytest.raises(ValueError, match="over Z"):
        indexed(aside, 3)


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
