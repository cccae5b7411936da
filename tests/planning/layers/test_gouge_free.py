"""Roughing passes whose straight moves would gouge the part between places where the ball is free."""

import numpy as np

from bonecam.job import Job, PathJob
from bonecam.mesh.distance import MeshDistance
from bonecam.planning.layers import FlatChart, HeightField, Rough, rough_layer
from bonecam.setup.stocks.cylinder import Cylinder
from bonecam.tool.cutter import Cutter

X, Y = np.eye(3)[:2]
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


def test_a_roughing_pass_rises_off_the_part_where_it_would_gouge() -> None:
    radius, across = Job().roughing.radius, 3.0
    rest = float(np.sqrt((4.0 + radius) ** 2 - across**2))
    free, moves = roughed(across, rest + 0.1)
    np.testing.assert_allclose(free[:, 1], -rest - 0.1, atol=1e-12)
    raised, raised_moves = roughed(across, rest - 0.05)
    assert len(raised_moves) == len(moves)
    assert deepest(raised, raised_moves, radius) <= JOB.gouge_tolerance
    np.testing.assert_allclose(raised[:, 1], -rest, atol=2 * JOB.gouge_tolerance)


def test_a_roughing_pass_is_left_out_where_it_would_have_to_rise_too_far() -> None:
    centres, _ = roughed(2.0)
    assert not len(centres)
