"""Pruning: needless knots go, needed ones stay, and the surface without them is where it was."""

import numpy as np
import pytest

from bonecam.mesh.rows import Rows, harmonic_rows
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.surface.fitting import FitTarget, first_tmesh, harmonic_parameters, through_loops, transfer
from bonecam.surface.growth import Aim, prune, settle
from bonecam.surface.skinning import skin
from bonecam.surface.tmesh import RowTMesh
from bonecam.surface.tspline import TSpline

POLES = np.array([[0.0, 0.0, -3.0], [0.0, 0.0, 3.0]])


@pytest.fixture(scope="module")
def body() -> tuple[Rows, TriangleMesh]:
    t, s = np.meshgrid(np.pi * np.arange(1, 20) / 20, 2 * np.pi * np.arange(40) / 40, indexing="ij")
    points = np.stack([2 * np.sin(t) * np.cos(s), 1.6 * np.sin(t) * np.sin(s), -3 * np.cos(t)], axis=2)
    mesh = skin(points, 1e-4, poles=POLES).tessellate(0.004)
    return harmonic_rows(mesh, 16, 60), mesh


@pytest.fixture(scope="module")
def settled(body: tuple[Rows, TriangleMesh]) -> tuple[TSpline, FitTarget]:
    surface = through_loops(body[0], first_tmesh(9, 16))
    aim = Aim(0.02, 1000)
    return settle(surface, FitTarget.of(body[1], body[0], 3000).on(surface, 0.02), aim, 4)


def test_an_ellipsoid_spares_many_knots_and_stays_where_it_is(settled: tuple[TSpline, FitTarget]) -> None:
    surface, target = settled
    tmesh = prune(surface, target, 0.02, 1000)
    assert tmesh.size < 0.8 * surface.tmesh.size
    fewer = transfer(surface, tmesh)
    assert target.on(fewer, 0.02).worst < 0.04


def test_no_more_knots_go_than_may(settled: tuple[TSpline, FitTarget]) -> None:
    surface, target = settled
    assert prune(surface, target, 0.02, 5).size == surface.tmesh.size - 5
    assert prune(surface, target, 1e-9, 1000).size == surface.tmesh.size


def test_a_surface_moved_to_a_finer_tmesh_that_holds_it_is_the_same(settled: tuple[TSpline, FitTarget]) -> None:
    surface = settled[0]
    assert isinstance(surface.tmesh, RowTMesh)
    finer = RowTMesh.from_rows(
        surface.tmesh.t_knots,
        [np.union1d(k, [k[0], 0.013, 0.77])[: None if len(k) > 1 else 1] for k in surface.tmesh.s_knots],
    )
    s, t = np.random.default_rng(1).random((2, 300))
    assert np.abs(transfer(surface, finer).positions(s, t) - surface.positions(s, t)).max() < 1e-4


def test_harmonic_parameters_of_the_rows_are_their_own(body: tuple[Rows, TriangleMesh]) -> None:
    rows = body[0]
    s, t = harmonic_parameters(rows, rows.points.reshape(-1, 3))
    wanted = np.tile(np.arange(60) / 60, 16)
    assert np.abs(np.mod(s - wanted + 0.5, 1) - 0.5).max() < 0.02
    assert np.abs(t - np.repeat(rows.heights, 60)).max() < 0.02


def test_rows_next_to_poles_keep_a_knot_every_quarter_turn(settled: tuple[TSpline, FitTarget]) -> None:
    """Round a gap of half a turn the surface folds at its pole."""
    surface, target = settled
    tmesh = surface.tmesh
    assert isinstance(tmesh, RowTMesh)
    ring = np.array([0.0, 0.125, 0.25, 0.5, 0.625, 0.75])
    rings = [tmesh.s_knots[0], ring, *tmesh.s_knots[2:-2], ring, tmesh.s_knots[-1]]
    denser = transfer(surface, RowTMesh.from_rows(tmesh.t_knots, rings))
    fewer = prune(denser, target.on(denser, 0.02), 10.0, 1000)
    for knots in (fewer.s_knots[1], fewer.s_knots[-2]):
        assert len(knots) < len(ring)
        assert np.diff(knots, append=knots[0] + 1).max() <= 0.25
