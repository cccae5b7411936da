"""Open surfaces: from a blade's side, or a blade open at both ends, to an offset or a given surface."""

from itertools import pairwise

import numpy as np
import pytest
from test_morph import waisted

from bonecam.errors import JobError, LevelError, StockError, SurfaceError
from bonecam.levels.morph import Morph
from bonecam.levels.open_morph import morph_open
from bonecam.levels.rounding import levels_in
from bonecam.levels.schedule import Schedule
from bonecam.levels.stock import Capsule
from bonecam.surface.skin import skin
from bonecam.surface.tspline import TSpline

SCHEDULE = Schedule((0.1,), 0.5)


def side() -> TSpline:
    """A twisted, bent sheet of 20 x 30 mm."""
    u = np.linspace(-1, 1, 21)
    rows = [np.column_stack([10 * u, 2 * u**2 + 3 * u * v, 15 * v + 0 * u]) for v in np.linspace(-1, 1, 9)]
    return skin(rows, 0.02, closed=False)


def tube() -> TSpline:
    """A blade of elliptic section, 12 x 4 mm, twisted by 20 degrees over 25 mm, open at both ends."""
    angle = 2 * np.pi * np.arange(40) / 40
    rows = []
    for v in np.linspace(0, 1, 8):
        x, y, turn = 6 * np.cos(angle), 2 * np.sin(angle), np.radians(20) * v
        rows.append(np.column_stack([x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn), 25 * v + 0 * x]))
    return skin(rows, 0.02, closed=True)


BLADES = {"side": side, "tube": tube}


@pytest.mark.parametrize("blade", BLADES)
def test_the_morph_of_a_closed_part_refuses_an_open_one_at_once(blade: str) -> None:
    with pytest.raises(SurfaceError, match=r"not closed between two poles: morph an open one with .*morph_open"):
        levels_in(BLADES[blade](), Capsule(np.array([0.0, 0, -30]), np.array([0.0, 0, 60]), 40.0), SCHEDULE)


@pytest.fixture(scope="module", params=[(blade, edges) for blade in BLADES for edges in ("free", "fixed")], ids="-".join)
def made(request: pytest.FixtureRequest) -> tuple[TSpline, str, Morph]:
    blade, edges = request.param
    surface = BLADES[blade]()
    return surface, edges, morph_open(surface, 2.0, SCHEDULE, edges=edges, chord_tolerance=0.02)


def moves_of(morph: Morph, s: np.ndarray, t: np.ndarray) -> list[np.ndarray]:
    surfaces = [level.surface for level in morph.levels[:-1] if level.surface is not None]
    return [outer.positions(s, t) - inner.positions(s, t) for inner, outer in pairwise(surfaces)]


def test_as_few_levels_as_the_depths_allow_or_one_more(made: tuple[TSpline, str, Morph]) -> None:
    morph = made[2]
    assert morph.lower_bound <= morph.cuts <= morph.lower_bound + 1


def test_no_point_moves_further_than_the_depth_or_falls_behind(made: tuple[TSpline, str, Morph]) -> None:
    s, t = np.random.default_rng(9).random((2, 2000))
    for level, move in zip(made[2].levels[1:], moves_of(made[2], s, t)):
        assert np.linalg.norm(move, axis=1).max() <= level.limit + 1e-9
        assert level.depth_max <= level.limit + 0.002
        assert level.nesting_min >= -0.001
        assert level.self_intersections == 0


def test_fixed_edges_stay_and_free_ones_go_with_the_stock(made: tuple[TSpline, str, Morph]) -> None:
    surface, edges, morph = made
    s = np.linspace(0.02, 0.98, 50)
    for end in surface.domain[1]:
        moved = sum(np.linalg.norm(move, axis=1) for move in moves_of(morph, s, np.full(50, end)))
        assert (np.max(moved) < 1e-9) == (edges == "fixed")


def test_the_last_level_is_the_offset() -> None:
    surface, morph = side(), morph_open(side(), -1.3, SCHEDULE, chord_tolerance=0.02)
    feet = surface.project(morph.levels[-1].mesh.vertices)
    assert np.abs(feet.distances - 1.3).max() < 0.02
    ahead = morph.levels[-1].mesh.vertices - feet.feet
    assert (ahead * surface.normals(*feet.parameters.T)).sum(1).max() < 0


def test_a_given_surface_is_met() -> None:
    u = np.linspace(-1.3, 1.3, 25)
    plane = skin([np.column_stack([10 * u, 0 * u + 8.0 + 0.5 * v, 17 * v + 0 * u]) for v in np.linspace(-1, 1, 6)], 0.01, closed=False)
    for stock in (plane, plane.tessellate(0.01)):
        morph = morph_open(side(), stock, SCHEDULE, chord_tolerance=0.05)
        assert np.abs(plane.project(morph.levels[-1].mesh.vertices).distances).max() < 0.05
        assert morph.distance == pytest.approx(9.4, abs=0.1)


def test_a_stock_through_the_part_is_refused_with_its_place() -> None:
    flat = skin(
        [np.column_stack([np.linspace(-12, 12, 9), np.full(9, 1.0), np.full(9, z)]) for z in np.linspace(-18, 18, 5)], 0.01, closed=False
    )
    with pytest.raises(StockError, match="behind the part at") as caught:
        morph_open(side(), flat, SCHEDULE)
    assert caught.value.evidence["distance"] > 0.5


def test_an_offset_beyond_the_thickness_is_an_error_with_the_level() -> None:
    with pytest.raises((LevelError, StockError), match=r"behind|cuts itself"):
        morph_open(tube(), -3.0, SCHEDULE, chord_tolerance=0.05)


def test_wrong_calls_are_refused() -> None:
    with pytest.raises(SurfaceError, match=r"the surface is closed: .*levels_in\(surface, stock, schedule\)"):
        morph_open(waisted(), 1.0, SCHEDULE)
    with pytest.raises(JobError, match="edges = 'loose': choose one of free, fixed"):
        morph_open(side(), 1.0, SCHEDULE, edges="loose")
    with pytest.raises(StockError, match="no stock"):
        morph_open(side(), 0.0, SCHEDULE)
