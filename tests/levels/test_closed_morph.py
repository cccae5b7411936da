"""The morph of a small bone-like part: few levels, no deeper than allowed, nested, inside the stock, never
through itself.

The T-mesh of the levels: as fine as the cuts ask for, the surface unchanged.
"""

import re
import subprocess
import sys

import numpy as np
import pytest
from level_parts import CAPSULE, grooved, waisted

from bonecam.errors import Cancelled, JobError, LevelError, StockError, SurfaceError
from bonecam.levels import levels_in, morph
from bonecam.levels.closed_morph import refine_for_depth
from bonecam.levels.measure import MeasuredSurface, level_grid, measure_cut, require_none, violations
from bonecam.levels.problem import (
    DEPTH_TOLERANCE,
    NESTING_TOLERANCE,
    STOCK_TOLERANCE,
    integration_points,
    samples_of,
    thin_plate,
)
from bonecam.mesh import MeshDistance
from bonecam.setup import Box, Capsule, Cylinder, Schedule
from bonecam.surface import TSpline, save_surface

SCHEDULE = Schedule((0.1, 0.1), 0.5)
STOCK = Capsule(np.array([0.0, 0.0, 4.5]), np.array([0.0, 0.0, 15.5]), 4.5)


@pytest.mark.parametrize("stock", [STOCK, Cylinder(4.5, 0.0, 20.0)])
def test_a_surface_that_bounds_no_body_is_refused_at_once(stock):
    part = waisted()
    with pytest.raises(SurfaceError, match=r"^the part: .* is turned inside out, its normals point inwards: "):
        levels_in(part.with_control_points(part.control_points * [-1, 1, 1]), stock, SCHEDULE)
    P = np.array(part.control_points)
    P[np.abs(P[:, 2] - 10) < 3, :2] *= -0.3  # turned through the axis
    with pytest.raises(SurfaceError, match=r"^the part: .* cuts itself in \d+ faces, first near \(.*\): "):
        levels_in(part.with_control_points(P), stock, SCHEDULE)


CALLS = """
from fractions import Fraction

import numpy as np
from bonecam.errors import StockError
from bonecam.setup.stocks.mesh import ConvexStock
from bonecam.setup.stocks.cylinder import Cylinder
from bonecam.levels.closed_morph import morph
from bonecam.levels.open_morph import morph_open
from bonecam.levels.job_levels import levels_in
from bonecam.setup.stock import Schedule
from bonecam.setup.capsule import Capsule
from bonecam.surface import load_surface
SCHEDULE = Schedule((0.1, 0.1), 0.5)
STOCK = Capsule(np.array([0.0, 0.0, 4.5]), np.array([0.0, 0.0, 15.5]), 4.5)
part = load_surface("part.tspline")
for call in (
    lambda: levels_in(STOCK, part, SCHEDULE),
    lambda: morph(part, SCHEDULE, STOCK),
    lambda: levels_in(part, STOCK, 0.5),
    lambda: morph_open(part, 1.0, 0.5),
    lambda: Schedule(0.1, 0.5),
    lambda: Schedule([0.1], 0.5),
    lambda: Schedule((0.1,), None),
    lambda: print(
        Schedule((Fraction(1, 2),), np.int8(100)).reach(3),
        Capsule(np.zeros(3), [0, 0, 1], np.uint8(200)).length,
    ),
    lambda: print(
        Cylinder(np.int8(100), np.int8(-100), np.int8(100)).length, Cylinder(1, 2, 3, (np.int8(4), 5)).centre
    ),
    lambda: ConvexStock(np.zeros((4, 3))),
    lambda: morph(part, STOCK, SCHEDULE, attraction=["stock"]),
    lambda: morph(part, STOCK, SCHEDULE, method=["qp"]),
    lambda: Capsule(np.zeros(3), np.ones(3), "6"),
    lambda: Cylinder("3", 0, 1),
):
    try:
        call()
    except (TypeError, ValueError, StockError) as error:
        print(error)
"""


@pytest.mark.plugged
def test_arguments_of_another_kind_are_refused_with_what_to_give(tmp_path):
    """In a process of its own, without these tests' own check of types."""
    save_surface(waisted(), tmp_path / "part.tspline")
    ran = subprocess.run([sys.executable, "-c", CALLS], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert re.sub(", such as.*", "", ran.stdout).splitlines() == [
        "surface is a Capsule: give a TSpline",
        "stock is a Schedule: give a Capsule, Cylinder, Box or ConvexStock",
        *["schedule is a float: give a Schedule"] * 2,
        *[
            f"{told}: give depths in mm like Schedule((0.1, 0.1), 0.5)"
            for told in ("Schedule(0.1, 0.5)", "Schedule([0.1], 0.5)")
        ],
        "Schedule((0.1,), None): give depths in mm like Schedule((0.1, 0.1), 0.5)",
        "200.5 401.0",
        "200.0 (4.0, 5.0)",
        "surface is a ndarray: give a TriangleMesh",
        "attraction ['stock']: choose one of stock, sphere, nearest",
        "method ['qp']: choose one of qp, qcqp, published",
        "a capsule's radius is ['6']: give a finite number (mm, 1e+06 at most)",
        "a cylinder's radius, bottom and top is ['3', 0, 1]: give 3 finite numbers (mm, 1e+06 at most)",
    ]


@pytest.fixture(scope="module")
def made():
    return morph(waisted(), STOCK, SCHEDULE, chord_tolerance=0.02)


def test_no_more_than_one_cut_above_the_lower_bound(made):
    assert made.lower_bound <= made.cuts <= made.lower_bound + 1


def test_the_lower_bound_counts_the_depth_both_ways():
    """The bottom of this groove is 2.49 mm inside the stock, of which no point is farther than 2.28 mm from the
    part: 0.1, 0.1 and five cuts of 0.45 mm make 2.45 mm."""
    made = morph(grooved(0.5), STOCK, Schedule((0.1, 0.1), 0.45), chord_tolerance=0.02)
    assert made.distance < 2.3
    assert made.lower_bound == 8 == made.cuts


def test_levels_keep_the_tmesh_and_end_at_the_stock(made):
    first, *between, last = made.levels
    assert first.index == 0
    assert last.surface is None
    assert all(
        level.surface is not None and level.surface.tmesh is first.surface.tmesh for level in between if first.surface
    )
    assert [level.limit for level in made.levels[1:4]] == [0.1, 0.1, 0.5]


def test_every_measure_is_within_its_tolerance(made):
    for level in made.levels[1:]:
        assert level.deepest <= level.limit + DEPTH_TOLERANCE
        assert level.nesting_min >= -NESTING_TOLERANCE
        assert level.outside <= STOCK_TOLERANCE
        assert level.measures.self_intersections == 0
        assert sum(level.measures.depth_shares) == pytest.approx(1.0, abs=0.02)


def test_the_levels_use_their_depth_up(made):
    assert made.depth_used >= 0.95


def test_two_runs_give_the_same_control_points(made):
    again = morph(waisted(), STOCK, SCHEDULE, chord_tolerance=0.02)
    for a, b in zip(made.levels[:-1], again.levels[:-1]):
        assert a.surface is not None
        assert b.surface is not None
        assert (a.surface.control_points == b.surface.control_points).all()


def test_a_part_outside_the_stock_is_refused_at_once():
    with pytest.raises(StockError, match="does not hold the part"):
        morph(waisted(), Capsule(STOCK.start, STOCK.end, 2.5), SCHEDULE)


@pytest.mark.parametrize("stock", [STOCK, Cylinder(4.0, 0.0, 20.0)], ids=str)
def test_a_part_of_metres_in_a_stock_of_millimetres_is_not_tessellated_first(stock, monkeypatch):
    huge = waisted().with_control_points(1000 * waisted().control_points)
    monkeypatch.setattr(TSpline, "tessellate", None)
    with pytest.raises(StockError, match="does not hold the part"):
        levels_in(huge, stock, SCHEDULE)


def test_more_cuts_than_anybody_wants_are_refused_before_the_stock_is_looked_at_closely():
    """Within the chord tolerance of what is left the mesh of this stock has a million faces."""
    with pytest.raises(LevelError, match="more than 2000 cuts"):
        morph(waisted(), Capsule(np.zeros(3), np.array([0.0, 0, 1]), 2000.0), Schedule((), 0.5))


def test_an_unknown_attraction_is_refused():
    with pytest.raises(ValueError, match="choose one of"):
        morph(waisted(), STOCK, SCHEDULE, attraction="moon")


@pytest.mark.parametrize("name", ["stiffness", "chord_tolerance"])
@pytest.mark.parametrize("value", [-1.0, 1e6, float("nan"), float("inf")])
def test_a_number_out_of_its_range_is_refused_by_name(name, value):
    with pytest.raises(JobError, match=f"^{name} = {value}: keep it within"):
        morph(waisted(), STOCK, SCHEDULE, **{name: value})


def test_progress_that_answers_false_cancels():
    with pytest.raises(Cancelled):
        morph(waisted(), STOCK, SCHEDULE, progress=lambda fraction, message: False)


def measured(*surfaces: TSpline) -> list[MeasuredSurface]:
    grid = level_grid(surfaces[0], [surface.control_points for surface in surfaces], 0.02)
    return [MeasuredSurface(surface, grid) for surface in surfaces]


def test_a_level_that_falls_behind_is_an_error_with_its_place_and_patch(made):
    inner, outer = made.levels[3].surface, made.levels[2].surface
    assert inner is not None
    assert outer is not None
    a, b = measured(inner, outer)
    found = measure_cut(a, b, STOCK, 0.5)
    assert found.nesting_min < -0.05
    with pytest.raises(LevelError, match="behind the level before") as caught:
        require_none(3, violations(found, 0.5, b.mesh), b.mesh)
    assert caught.value.evidence["level"] == 3
    patch, place = caught.value.evidence["patch"], caught.value.evidence["place"]
    assert MeshDistance(patch).unsigned(place[None])[0] == pytest.approx(-found.nesting_min, abs=0.01)
    assert 0 < len(patch.faces) < len(b.mesh.faces)


def test_a_level_that_cannot_keep_its_limits_ends_its_sequence_with_the_place():
    """A part that folds over itself: no level can hold what lies in the fold."""
    coarse = waisted(rows=10, around=6)
    points = coarse.control_points
    fold = np.where(np.abs(points[:, 2] - 10) < 1.5, 6.0, 0.0)
    part = coarse.with_control_points(points + fold[:, None] * [0.0, 0.0, 1.0])
    with pytest.raises(LevelError, match=r"level \d+ breaks its limits by .* mm at \(") as caught:
        morph(part, STOCK, SCHEDULE, chord_tolerance=0.05)
    assert str(caught.value).startswith(f"level {caught.value.evidence['level']} ")
    assert abs(STOCK.signed_distance(caught.value.evidence["place"][None])[0]) < STOCK.radius


def test_a_cut_too_deep_is_an_error():
    surface = waisted()
    inner, outer = measured(*(surface.with_control_points(surface.control_points * [k, k, 1.0]) for k in (1.0, 1.2)))
    found = measure_cut(inner, outer, STOCK, 0.1)
    with pytest.raises(LevelError, match="deep, more than"):
        require_none(1, violations(found, 0.1, outer.mesh), outer.mesh)
    assert sum(found.depth_shares) == pytest.approx(1.0)  # what is deeper counts with the deepest


def test_a_groove_left_too_far_behind_is_an_error_at_its_bottom():
    part, filled = grooved(0.4), grooved(1.0)
    inner, outer = (
        MeasuredSurface(surface, level_grid(part, [part.control_points, filled.control_points], 0.02))
        for surface in (part, filled)
    )
    found = measure_cut(inner, outer, STOCK, 0.5)
    assert found.depth_max < found.reverse_depth_max
    limit = (found.depth_max + found.reverse_depth_max) / 2
    with pytest.raises(LevelError, match=f"level 1 is {found.reverse_depth_max:.4f} mm deep") as error:
        require_none(1, violations(found, limit, outer.mesh), outer.mesh)
    assert abs(filled.project(error.value.evidence["place"][None]).distances[0] - found.reverse_depth_max) < 0.01


def test_a_level_through_itself_is_an_error_with_its_place():
    surface = waisted()
    twisted = np.array(surface.control_points)
    twisted[len(twisted) // 2] = [-3.0, -3.0, 10.0]
    inner, outer = measured(surface, surface.with_control_points(twisted))
    found = measure_cut(inner, outer, STOCK, 9.0)
    assert found.self_intersections > 0
    with pytest.raises(LevelError, match=r"level 1 cuts itself in \d+ faces at \("):
        require_none(1, violations(found, 9.0, outer.mesh, nesting_tolerance=9.0), outer.mesh)


def test_distances_are_to_the_surface_not_to_its_tessellation():
    surface = waisted()
    rng = np.random.default_rng(5)
    s, t = rng.random(500), rng.uniform(0.05, 0.95, 500)
    places, normals = surface.evaluate(s, t), surface.normals(s, t)
    (level,) = measured(surface)
    found, _ = level.closest(places + 0.2 * normals, np.column_stack([s, t]))
    assert np.abs(found - 0.2).max() < 1e-4
    assert np.abs(level.mesh_distance.unsigned(places + 0.2 * normals) - 0.2).max() > 1e-3


def test_a_coarse_tessellation_does_not_mislead_about_the_side_of_a_point():
    surface = waisted()
    level = MeasuredSurface(surface, level_grid(surface, [surface.control_points], 0.2))
    rng = np.random.default_rng(5)
    s, t = rng.random(500), rng.uniform(0.05, 0.95, 500)
    points = surface.positions(s, t) - 0.11 * surface.normals(s, t)
    assert not level.mesh_distance.inside(points).all()
    assert np.abs(level.signed_distances_near(points, np.column_stack([s, t])) + 0.11).max() < 1e-4


def test_the_energy_matrices_are_the_integrals_of_the_paper():
    surface = waisted()
    s, t, weights = integration_points(surface)
    assert weights.sum() == pytest.approx(1.0)
    samples = samples_of(surface, s, t, weights)
    points, *_, ss, st, tt = surface.evaluate(s, t, 2)
    P = surface.control_points
    plate = (weights[:, None] * (ss**2 + 2 * st**2 + tt**2)).sum()
    assert np.einsum("ij,ij->", P, thin_plate(surface) @ P) == pytest.approx(plate)
    assert np.einsum("ij,ij->", P, samples.N @ P) == pytest.approx((weights[:, None] * points**2).sum())
    H = points + 1.0
    pull = (
        np.einsum("ij,ij->", P, samples.N @ P)
        - 2 * np.einsum("ij,ij->", P, samples.moments(H))
        + (weights[:, None] * H**2).sum()
    )
    assert pull == pytest.approx(3.0)


RNG = np.random.default_rng(7)
MANY_IN_CAPSULES, MOST_IN_CAPSULES = 800, 3000
"""A surface of so many control points is left alone; one of fewer gets at most so many."""
MOST_WITH_FLATS = 1000
"""Control points at most in a stock with flat faces."""


def box() -> Box:
    return Box(np.array([-4.5, -4.5, 0.0]), np.array([4.5, 4.5, 20.0]))


def test_the_surface_is_the_same_with_more_control_points(discretisation):
    part = discretisation.surface
    found = refine_for_depth(part, CAPSULE, 0.1)
    assert part.tmesh.size < found.tmesh.size <= MOST_IN_CAPSULES
    s, t = RNG.random((2, 500))
    assert np.abs(found.positions(s, t) - part.positions(s, t)).max() < 1e-12
    assert found.poles == part.poles


def test_no_more_control_points_than_allowed(discretisation):
    """Spans stay longer than cuts so shallow ask for."""
    part = discretisation.surface
    cases = ((CAPSULE, 0.04, MOST_IN_CAPSULES), (box().round_edges(3.0), 0.1, MOST_WITH_FLATS))
    for stock, depth, most in cases:
        assert part.tmesh.size < refine_for_depth(part, stock, depth).tmesh.size <= most


def test_a_surface_of_many_control_points_stays_as_it_is():
    many, fewer = waisted(rows=30, around=32), waisted(rows=22, around=32)
    assert fewer.tmesh.size < MANY_IN_CAPSULES <= many.tmesh.size
    assert refine_for_depth(many, CAPSULE, 0.05) is many
    assert refine_for_depth(fewer, CAPSULE, 0.05).tmesh.size > fewer.tmesh.size


def test_spans_are_shorter_in_a_stock_with_flats(discretisation):
    part = discretisation.surface
    assert (
        refine_for_depth(part, box().round_edges(3.0), 0.3).tmesh.size
        > 1.3 * refine_for_depth(part, CAPSULE, 0.3).tmesh.size
    )


def test_spans_across_the_stocks_axis_are_not_halved_for_ever(discretisation):
    """The nearest points of a short line across the axis lie a stock's diameter apart: that alone would
    double the control points."""
    part = discretisation.surface
    aside = CAPSULE.move(np.array([np.ptp(part.control_points[:, 0]) / 2, 0.0, 0.0]))
    assert refine_for_depth(part, aside, 0.2).tmesh.size < 1.5 * part.tmesh.size
