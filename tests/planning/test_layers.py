"""Balls that come down on a part, the material that they leave, and parallel passes limited in scallop.

Roughing passes whose straight moves would gouge the part between places where the ball is free.

Balls in the mesh of what stands while a layer is cut.
"""

import numpy as np
import pytest
from sphere_on_lines import MIDDLE, RADIUS, X, Y, flat_chart, sphere

from bonecam.job import Job, PathJob
from bonecam.mesh import MeshDistance
from bonecam.planning.layers import (
    CELL,
    DEVIATION,
    Ball,
    FlatChart,
    HeightField,
    HeightMesh,
    Rough,
    drop,
    drop_balls,
    flat_step,
    rough_layer,
    sample,
    scan_lines,
)
from bonecam.setup import Cylinder
from bonecam.tool import Cutter
from bonecam.workholding import Post


@pytest.fixture(scope="module")
def ball():
    return Ball(1.0, 0.0, MeshDistance(sphere()), Post(1.0, 5.0))


def test_a_ball_comes_to_rest_where_it_touches_the_sphere(ball):
    rng = np.random.default_rng(1)
    a, b = rng.uniform(-4.5, 4.5, (2, 400))
    beside = np.hypot(a, b)
    heights = drop_balls(flat_chart(), a, b + MIDDLE, ball, 9.0, -3.0)
    over = beside < 4.9
    np.testing.assert_allclose(heights[over], np.sqrt(25 - beside[over] ** 2), atol=3e-3)
    assert (heights[beside > 5.01] == -3.0).all()


def test_material_and_what_a_ball_removes_add_up():
    cell = 0.05
    chart = FlatChart(-Y, X, np.arange(-3, 3.01, cell), np.arange(20, 26.01, cell))
    shape = len(chart.a), len(chart.b)
    block = HeightField(chart, np.full(shape, 2.0), np.full(shape, -2.0))
    depth, radius = 0.5, 1.0
    place = np.zeros(1), np.array([23.0]), np.array([2.0 + radius - depth])
    left = block.lowered(*place, radius)
    cap = np.pi * depth**2 * (radius - depth / 3)
    assert block.mesh().volume - left.mesh().volume == pytest.approx(cap, rel=0.01)
    assert block.cut(*place, radius)[0] == pytest.approx(depth, abs=1e-9)
    assert left.cut(*place, radius)[0] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("scallop", [0.02, 0.05])
def test_parallel_passes_leave_no_more_than_the_scallop(ball, scallop):
    chart, floor = flat_chart(), 0.5

    def height_of(a, b):
        return drop_balls(chart, a, b, ball, 9.0, floor)

    lines = scan_lines(chart, ball, scallop, height_of, (29.0, 36.0), 1.0)
    curves = sample(lines, chart, height_of, 1.0, 0.002)
    centres = chart.bases(curves.a, curves.b) + curves.heights[:, None] * chart.axes(curves.a)
    moves = np.flatnonzero(curves.joined())
    starts, along = centres[moves], centres[moves + 1] - centres[moves]

    rng = np.random.default_rng(3)
    normals = rng.normal(size=(300, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    normals = normals[(normals @ -Y > 0.35) & (normals[:, 2] > -0.1)]
    left = []
    for normal in normals:
        point = RADIUS * normal + MIDDLE * np.eye(3)[2]
        heights = np.linspace(0, 3 * scallop, 61)
        places = point + heights[:, None] * normal
        away = places[:, None] - starts
        share = np.clip((away * along).sum(2) / np.maximum((along**2).sum(1), 1e-30), 0, 1)
        cut = (np.linalg.norm(away - share[..., None] * along, axis=2) < ball.radius + 1e-4).any(1)
        left.append(heights[np.argmax(cut)] if cut.any() else np.inf)
    assert max(left) <= scallop + 0.003
    length = np.linalg.norm(along, axis=1).sum()
    assert length < 2.2 * 1.2 * np.pi * 25 / flat_step(ball.radius, scallop)


PART = MeshDistance(Cylinder(4.0, 20.0, 40.0).mesh(0.001))
JOB = PathJob(gouge_tolerance=0.01, chord_tolerance=0.01)


def roughed(across: float, height: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Ball centres, and the moves between them by their first, of a straight pass over the part along Z: its ball's
    centre is so far beside the axis and above it, mm."""
    cutter = Cutter.from_job(1, "roughing", Job().tool("roughing"))
    chart = FlatChart(-Y, X, np.arange(-8.0, 8.0, 0.15), np.arange(18.0, 42.0, 0.15))
    shape = len(chart.a), len(chart.b)
    material = HeightField(chart, np.full(shape, 6.0), np.full(shape, -6.0))
    line = np.array([[across, 22.0], [across, 38.0]])
    rough = Rough(cutter, PART, JOB, 0.02, 1.0)
    layer, _ = rough_layer([[line]], lambda a, b: np.full(len(a), height), material, rough)
    moves = np.flatnonzero(np.diff(layer.path.pass_index) == 0)
    return layer.path.centres, moves


def deepest(centres: np.ndarray, moves: np.ndarray, radius: float) -> float:
    shares = np.linspace(0.0, 1.0, 21)[:, None, None]
    way = (1 - shares) * centres[moves] + shares * centres[moves + 1]
    return float(radius - PART.signed(way.reshape(-1, 3)).min())


def test_a_roughing_pass_rises_off_the_part_where_it_would_gouge():
    radius, across = Job().roughing.radius, 3.0
    rest = float(np.sqrt((4.0 + radius) ** 2 - across**2))
    free, moves = roughed(across, rest + 0.1)
    np.testing.assert_allclose(free[:, 1], -rest - 0.1, atol=1e-12)
    raised, raised_moves = roughed(across, rest - 0.05)
    assert len(raised_moves) == len(moves)
    assert deepest(raised, raised_moves, radius) <= JOB.gouge_tolerance
    np.testing.assert_allclose(raised[:, 1], -rest, atol=2 * JOB.gouge_tolerance)


def test_a_roughing_pass_is_left_out_where_it_would_have_to_rise_too_far():
    centres, _ = roughed(2.0)
    assert not len(centres)


def test_a_ball_enters_no_deeper_than_is_told():
    stock = Cylinder(6.0, 0.0, 20.0)
    across = np.arange(-7.0, 7.0, CELL)
    chart = FlatChart(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]), across, np.arange(-1.0, 21.0, CELL))
    a, b = (each.ravel() for each in np.meshgrid(chart.a, chart.b, indexing="ij"))
    lines, shape = (chart.bases(a, b), chart.axes(a)), (len(chart.a), len(chart.b))
    tops = drop(*lines, stock.signed_distance, 8.0, 0.0).reshape(shape)
    standing = HeightMesh(HeightField(chart, tops, -tops).mesh())
    around, along = (each.ravel() for each in np.meshgrid(np.linspace(0.0, 6.2, 60), np.linspace(-1.0, 21.0, 40)))
    centres = np.column_stack([7.5 * np.cos(around), 7.5 * np.sin(around), along])
    over = standing.depths(centres, 2.0)[0] - (2.0 - stock.signed_distance(centres))
    assert over.min() >= 0.0, "the mesh ends up to a cell before the edge of what stands"
    assert over.max() <= 1.5 * DEVIATION


def test_a_ball_that_rises_from_its_contact_enters_nothing_anew():
    standing = HeightMesh(Cylinder(6.0, 0.0, 40.0).mesh(0.001))
    contact = np.array([[7.5, 0.0, 20.0]])
    up, aside = np.array([[0.2, 0.0, 0.0]]), np.array([[0.0, 1.0, 0.0]])
    assert not standing.entered_anew(contact + up, contact, 2.0, 0.01).any()
    assert standing.entered_anew(contact + aside, contact, 2.0, 0.01).all()
