"""Lines that leave the Z axis, the layers of the strategies on a sphere, and outlines.

The links of the strategies in layers, held against what stands when they run.

Outlines of slices whose cells show less than the balls that ask.
"""

from itertools import pairwise

import numpy as np
import pytest
from bonecam_plugins.study import iso_height_layers, plan_layer_paths, rotary_layers
from bonecam_plugins.study.strategies import (
    SPACED,
    STRAIGHT,
    RoundChart,
    offset_curves,
    stock_field,
    thinned,
    turned_over,
)
from small_parts import UPRIGHT_CAPSULE, grooved_pebble, level_of
from sphere_on_lines import MIDDLE, RADIUS, X, Y, flat_chart, sphere

from bonecam.job import Job
from bonecam.machine import MachineLimits
from bonecam.material.dexels import CutDexels, uncut_rays
from bonecam.mesh import MeshDistance
from bonecam.mesh.solids import edges_of
from bonecam.planning import Ball, FlatChart, HeightField, drop_balls
from bonecam.setup import Capsule, Cylinder
from bonecam.tool import Cutter, MoveKind, ToolPath
from bonecam.tool.cutter import MAX_DEPTH_RADII
from bonecam.workholding import Post


@pytest.fixture(scope="module")
def ball():
    return Ball(1.0, 0.0, MeshDistance(sphere()), Post(1.0, 5.0))


def test_a_ball_that_comes_from_the_side_of_the_axis_rests_on_the_same_sphere(ball):
    chart = RoundChart.of(np.linspace(0, 2 * np.pi, 40, endpoint=False), np.arange(20.0, 40.0))
    up = np.linspace(-4.5, 4.5, 50)
    angles = np.linspace(0, 6, 50)
    heights = drop_balls(chart, angles, up + MIDDLE, ball, 9.0, 0.5)
    np.testing.assert_allclose(heights, np.sqrt(25 - up**2), atol=3e-3)


def test_the_stock_on_its_lines_has_the_volume_of_the_stock():
    stock = Cylinder(5.0, 25.0, 35.0)
    cell = 0.1
    flat = FlatChart(-Y, X, np.arange(-6, 6.05, cell), np.arange(24, 36.05, cell))
    turning = RoundChart.of(np.linspace(0, 2 * np.pi, 300, endpoint=False), np.arange(24, 36.05, cell))
    for chart in (flat, turning):
        mesh = stock_field(chart, stock, 8.0).mesh()
        assert mesh.volume == pytest.approx(np.pi * 25 * 10, rel=0.03)
        assert mesh.volume < np.pi * 25 * 10
        assert (edges_of(mesh)[1] == 2).all(), "it is not closed"


def test_material_that_is_turned_over_is_the_same_from_behind():
    chart = flat_chart()
    heights = np.add.outer(np.linspace(1.0, 2.0, len(chart.a)), np.linspace(0.0, 1.0, len(chart.b)))
    block = HeightField(chart, heights, np.full(heights.shape, -2.0))
    over = turned_over(block)
    np.testing.assert_array_equal(over.bottoms, -block.tops)
    assert over.mesh().volume == pytest.approx(block.mesh().volume)


def test_the_outline_of_a_slice_is_where_the_ball_meets_the_sphere(ball):
    chart = flat_chart(0.15)
    a, b = (each.ravel() for each in np.meshgrid(chart.a, chart.b, indexing="ij"))
    rests = drop_balls(chart, a, b, ball, 9.0, 0.0).reshape(len(chart.a), len(chart.b))
    height, step = 3.0, 0.8

    def is_free(across, along):
        return drop_balls(chart, across, along, ball, 9.0, height) <= height

    sets = offset_curves(chart, rests, height, step, is_free)
    outline = np.vstack(sets[-1])
    np.testing.assert_allclose(np.hypot(outline[:, 0], outline[:, 1] - MIDDLE), 4.0, atol=0.02)
    beside = np.vstack(sets[-2])
    np.testing.assert_allclose(np.hypot(beside[:, 0], beside[:, 1] - MIDDLE), 4.0 + step, atol=0.15)


@pytest.mark.parametrize("plan", [iso_height_layers, rotary_layers])
def test_the_layers_of_a_strategy_leave_a_sphere_alone_and_shrink_the_stock(plan):
    part, post = MeshDistance(sphere(4)), Post(1.0, 5.0)
    job = Job().with_values(
        levels={"roughing_depth": 1.5, "finishing_depth": 0.3},
        roughing={"scallop": 0.4},
        finishing={"scallop": 0.2},
        path={"chord_tolerance": 0.05, "gouge_tolerance": 0.1},
    )
    stock = Capsule(np.array([0, 0, MIDDLE - 1]), np.array([0, 0, MIDDLE + 1]), RADIUS + 0.6)
    cutters = [Cutter.from_job(k, name, job.tool(name)) for k, name in ((1, "roughing"), (2, "finishing"))]
    layers, unreached = plan(part, stock, post, *cutters, job)
    volumes = [layer.material.mesh().volume for layer in layers]
    assert all(after < before for before, after in pairwise(volumes))
    assert volumes[-1] > 4 / 3 * np.pi * RADIUS**3
    for layer in layers:
        path = layer.path
        away = np.linalg.norm(path.centres - MIDDLE * np.eye(3)[2], axis=1) - RADIUS
        allowance = job.levels.finishing_depth if path.cutter.name == "roughing" else 0.0
        assert away.min() > path.cutter.radius + allowance - 0.1
        np.testing.assert_allclose(layer.axes[:, 2], 0.0, atol=1e-12)
    finished = layers[-1].path
    from_part = np.linalg.norm(finished.contacts - MIDDLE * np.eye(3)[2], axis=1) - RADIUS
    on_part = np.abs(from_part) < 0.03
    assert (on_part | (from_part > 0.03)).all()
    assert on_part[len(on_part) // 3 :].all(), "only the first passes are steps through what is too deep"
    deep = cutters[1].radius - MeshDistance(layers[-1].material.mesh()).signed(finished.centres, 1.0)
    assert deep[~on_part].max() <= MAX_DEPTH_RADII * cutters[1].radius
    assert (deep[on_part] > MAX_DEPTH_RADII * cutters[1].radius).any(), "steps are needed"
    covered = np.abs(finished.uncut[:, 2] - MIDDLE) > 0.75 * RADIUS
    assert covered.all(), "all that a pass touches is cut but for the foot of what stands at the ends"
    assert covered.any() == (plan is rotary_layers)
    assert set(finished.reasons) <= {"covered"}
    poles = np.abs(unreached[:, 2] - MIDDLE) > 0.5 * RADIUS
    assert poles.all(), "only the ends are out of reach"
    assert poles.any() == (plan is rotary_layers)


def test_a_thinned_line_stays_within_its_tolerance():
    t = np.linspace(0, 2 * np.pi, 500)
    circle = np.column_stack([np.cos(t), np.sin(t)])
    few = thinned(circle, 0.01)
    assert len(few) < 40
    middles = (few[1:] + few[:-1]) / 2
    assert (1 - np.hypot(*middles.T) < 0.01 + 1e-9).all()


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
