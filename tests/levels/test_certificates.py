"""Certificates hold between the samples: what is known exactly is bounded tightly, nothing that is found
exceeds a bound.
"""

from dataclasses import replace

import numpy as np
import pytest
from level_parts import CAPSULE as STOCK
from level_parts import grooved, waisted
from numpy import ndarray

from bonecam.job import Job, MeshJob
from bonecam.kernels.hulls import halve, mapped_distance_bound, separation
from bonecam.levels import RoundedLevel, certify, levels_in, morph
from bonecam.levels.certificates import (
    HALVES,
    MARGIN,
    ROUNDING,
    bezier_nets,
    bound_inside,
    bound_mesh_depth,
    bound_outside,
    certify_cut,
    certify_last_cut,
    depth_target,
    faces_of_stock,
    triangle_nets,
)
from bonecam.levels.job_levels import make_levels
from bonecam.levels.measure import (
    MeasuredSurface,
    Rules,
    excess_bound,
    inspect,
    level_grid,
    measure_cut,
    require_none,
    violations,
)
from bonecam.levels.open_morph import body_surfaces
from bonecam.levels.problem import DEPTH_TOLERANCE, NESTING_TOLERANCE, STOCK_TOLERANCE
from bonecam.mesh import prepare_part
from bonecam.progress import silent
from bonecam.setup import Box, Capsule, Cylinder, Schedule, place
from bonecam.surface import TSpline
from bonecam.surface.part_surface import fit_surface

MIDDLE = np.array([0.0, 0.0, 10.0])
BUMP = 65
"""A control point whose bump has its peak between the points that the check measures at."""
FITTED = 0.004
"""How far the surfaces of two capsules may be off together, mm."""


def grown(surface: TSpline, share: float) -> TSpline:
    """The surface, star-shaped about its middle, larger by a share."""
    return surface.with_control_points(MIDDLE + (1 + share) * (surface.control_points - MIDDLE))


def dense(seed: int, count: int = 4000) -> tuple[ndarray, ndarray]:
    rng = np.random.default_rng(seed)
    return rng.random(count), np.concatenate(
        [rng.random(count - 400), rng.uniform(0, 0.01, 200), rng.uniform(0.99, 1, 200)]
    )


def distances(points: ndarray, surface: TSpline) -> ndarray:
    """Of points from a surface, negative inside."""
    foot = surface.project(points)
    across = ((points - foot.points) * surface.normals(foot.s, np.clip(foot.t, 1e-6, 1 - 1e-6))).sum(1)
    return np.copysign(foot.distances, across)


@pytest.fixture(scope="module")
def made():
    return morph(waisted(), STOCK, Schedule((0.1, 0.1), 0.5), chord_tolerance=0.02)


@pytest.fixture(scope="module")
def certified(made):
    return certify(
        [level.surface for level in made.levels if level.surface], STOCK, [level.limit for level in made.levels[1:]]
    )


@pytest.mark.whole
def test_the_bounds_of_concentric_capsules_are_their_distance():
    capsules = [Capsule(STOCK.start, STOCK.end, radius) for radius in (3.0, 3.4)]
    inner, outer = body_surfaces(capsules)
    found, last = certify([inner, outer], STOCK, [0.3, 0.0])
    assert found.depth == pytest.approx(0.4, abs=FITTED)
    assert found.outside == pytest.approx(3.4 - STOCK.radius, abs=0.05)
    assert found.nesting == pytest.approx(0.0, abs=1e-7)
    assert len(found.too_deep) > 0
    assert last.depth == pytest.approx(STOCK.radius - 3.4, abs=FITTED)
    assert last.nesting == pytest.approx(STOCK.radius - 3.4, abs=0.05)


def test_a_level_moved_along_the_axis_is_bounded_by_the_move_and_does_not_enclose():
    surface = waisted()
    moved = surface.with_control_points(surface.control_points + np.array([0.0, 0.0, 0.3]))
    found = certify_cut(surface, moved, STOCK, 0.3)
    assert 0.3 <= found.depth <= 0.3 + MARGIN + 2 * ROUNDING
    assert found.nesting == -np.inf
    assert certify_cut(surface, surface, STOCK, 0.3).depth <= 0.3 + MARGIN + ROUNDING


def test_a_level_on_the_one_before_falls_no_farther_behind_than_the_tolerance():
    surface = waisted()
    found = certify_cut(surface, surface, STOCK, 0.0)
    assert found.depth <= 2e-4
    assert -NESTING_TOLERANCE <= found.nesting <= 0.0


def test_levels_that_swap_places_are_not_nested():
    surface = waisted()
    assert certify_cut(surface, grown(surface, 0.05), STOCK, 0.5).nesting == pytest.approx(0.0, abs=1e-7)
    assert certify_cut(grown(surface, 0.05), surface, STOCK, 0.5).nesting == -np.inf


def test_a_level_far_off_does_not_enclose_although_nothing_meets():
    surface = waisted()
    away = surface.with_control_points(surface.control_points + np.array([50.0, 0.0, 0.0]))
    assert certify_cut(surface, away, STOCK, 60.0).nesting == -np.inf


@pytest.mark.parametrize("seed", range(6))
def test_no_sample_exceeds_a_bound_on_levels_moved_at_random(seed):
    rng = np.random.default_rng(seed)
    inner = waisted()
    moves = rng.normal(scale=0.15, size=inner.control_points.shape)
    moves[:11], moves[-11:] = moves[0], moves[-1]  # poles stay smooth
    outer = grown(inner, 0.06).with_control_points(grown(inner, 0.06).control_points + moves)
    found = certify_cut(inner, outer, STOCK, 0.3)
    points = outer.positions(*dense(seed))
    sampled = inner.project(points).distances.max()
    assert sampled <= found.depth <= sampled + 0.01
    assert STOCK.signed_distance(points).max() <= found.outside
    assert distances(inner.positions(*dense(seed)), outer).max() <= -found.nesting


def test_no_sample_exceeds_a_bound_on_a_sequence(made, certified):
    s, t = dense(3)
    surfaces = [level.surface for level in made.levels if level.surface]
    for inner, outer, found in zip(surfaces, surfaces[1:], certified):
        points = outer.positions(s, t)
        assert np.abs(distances(points, inner)).max() <= found.depth
        assert distances(inner.positions(s, t), outer).max() <= -found.nesting
        assert STOCK.signed_distance(points).max() <= found.outside
    around = STOCK.mesh(0.002).vertices
    assert surfaces[-1].project(around).distances.max() <= certified[-1].depth


def test_a_sequence_keeps_its_limits_everywhere(made, certified):
    for level, found in zip(made.levels[1:], certified):
        assert found.depth <= level.limit + DEPTH_TOLERANCE
        assert found.nesting >= -NESTING_TOLERANCE
        assert found.outside <= STOCK_TOLERANCE
        assert not len(found.too_deep)


def test_a_bump_with_its_peak_between_the_samples_passes_the_check_but_not_the_certificate():
    part = waisted(waist=-0.2)
    levels = [
        part.with_control_points(MIDDLE + [1 + k, 1 + k, 1 + k / 4] * (part.control_points - MIDDLE))
        for k in (0.0, 0.05, 0.1)
    ]
    bumped = levels[1].control_points.copy()
    bumped[BUMP, :2] *= 1 + 0.3 / np.linalg.norm(bumped[BUMP, :2])
    bump = part.with_control_points(bumped)
    inner, outer = (
        MeasuredSurface(level, level_grid(part, [level.control_points for level in levels], 0.02))
        for level in (part, bump)
    )
    limit = measure_cut(inner, outer, STOCK, 0.5).depth_max - 0.001
    measured = measure_cut(inner, outer, STOCK, limit)
    require_none(1, violations(measured, limit, outer.mesh), outer.mesh)
    found = certify_cut(part, bump, STOCK, limit)
    assert measured.depth_max <= limit + DEPTH_TOLERANCE < found.depth
    places = np.vstack([surface.positions(*found.too_deep.T) for surface in (part, bump)])
    assert np.linalg.norm(places - found.depth_place, axis=1).min() < 0.1
    assert part.project(places).distances.max() > limit + DEPTH_TOLERANCE


def test_depths_are_bounded_both_ways():
    inner, outer = grooved(0.4), grooved(1.0)
    found, s, t = certify_cut(inner, outer, STOCK, 0.1), *dense(5, 40_000)
    there, back = (to.project(of.positions(s, t)).distances.max() for of, to in ((outer, inner), (inner, outer)))
    assert there < back <= found.depth <= back + 0.05
    assert np.linalg.norm(inner.positions(s, t) - found.depth_place, axis=1).min() < 0.1


@pytest.mark.parametrize("limit", [0.1, 2.0, 5.0])
def test_the_last_cut_is_bounded_from_the_bottoms_of_hollows(limit):
    part = waisted(waist=0.5)
    bound, place = bound_inside(bezier_nets(part), STOCK, limit)
    sampled = -STOCK.signed_distance(part.positions(*dense(4, 40_000))).min()
    assert sampled <= bound
    assert bound <= max(limit, sampled + 0.001)
    assert bound <= limit or -STOCK.signed_distance(place[None])[0] > sampled - 0.1
    assert certify_last_cut(part, STOCK, limit).depth >= sampled


@pytest.mark.parametrize("stock", [STOCK, Box(np.array([-4.0, -4.0, 0.5]), np.array([4.0, 4.0, 19.5]))])
def test_what_leaves_the_stock_is_bounded_tightly(stock):
    outer = grown(waisted(), 0.5)
    bound, place = bound_outside(bezier_nets(outer), stock)
    sampled = stock.signed_distance(outer.positions(*dense(1, 40_000))).max()
    assert sampled <= bound <= sampled + 0.005
    assert stock.signed_distance(place[None])[0] == pytest.approx(bound, abs=0.05)


def test_what_is_not_certain_is_named_with_its_place():
    surface = waisted()
    found = certify_cut(surface, grown(surface, 0.5), STOCK, 0.5)
    deep, leaves = found.shortfalls(0.5)
    assert deep.startswith(f"may be {found.depth:.4f} mm deep, more than 0.5 mm, at (")
    assert leaves.startswith(f"may leave the stock by {found.outside:.4f} mm at (")
    (behind,) = certify_cut(grown(surface, 0.05), surface, STOCK, 0.5).shortfalls(0.5)
    assert behind.startswith("is not proven to hold the level before at (")
    assert certify_cut(surface, grown(surface, 0.05), STOCK, 0.5).shortfalls(0.5) == ()


@pytest.mark.whole
def test_the_levels_of_a_bar_are_certified_up_to_the_body_they_round_it_from():
    levels = levels_in(waisted(), Cylinder(4.5, 0.0, 20.0), Schedule((0.1, 0.1), 0.5), chord_tolerance=0.02).levels
    body = next(level.index for level in levels if isinstance(level, RoundedLevel))
    assert [level.certificate is None for level in levels] == [not 0 < level.index <= body for level in levels]
    assert all(level.certified for level in levels if level.certificate)


def test_a_surface_with_other_weights_is_morphed_without_certificates():
    surface = waisted()
    heavy = TSpline(surface.tmesh, surface.control_points, np.full(surface.tmesh.size, 2.0))
    assert all(
        level.certificate is None for level in morph(heavy, STOCK, Schedule((), 0.5), chord_tolerance=0.02).levels
    )


def test_a_cut_that_only_its_certificate_doubts_is_made_again(made):
    surfaces = [level.surface for level in made.levels if level.surface]
    rules = Rules(STOCK, Schedule((0.1, 0.1), 0.5), NESTING_TOLERANCE, STOCK_TOLERANCE, 0.02)
    inspection = inspect(surfaces[0], [surface.control_points for surface in surfaces], rules, silent)
    assert not inspection.failed + inspection.uncertain
    level = inspection.levels[3]
    assert level.certificate is not None
    doubted = replace(level, limit=level.certificate.depth - 2 * DEPTH_TOLERANCE)
    assert not doubted.certified
    assert excess_bound(doubted) == pytest.approx(2 * DEPTH_TOLERANCE)


def test_surfaces_that_are_not_polynomial_are_refused():
    surface = waisted()
    rational = TSpline(surface.tmesh, surface.control_points, np.linspace(1, 2, surface.tmesh.size))
    with pytest.raises(ValueError, match="weights of one"):
        certify_cut(surface, rational, STOCK, 0.5)
    with pytest.raises(ValueError, match="as many limits"):
        certify([surface], STOCK, [])


@pytest.mark.parametrize("seed", range(4))
def test_no_point_is_farther_from_its_image_than_the_bound_where_maps_cross_elements_seam_and_poles(seed):
    rng = np.random.default_rng(seed)
    surface = waisted()
    rough = surface.control_points + rng.normal(scale=0.5, size=surface.control_points.shape)
    rough[0], rough[-1] = surface.control_points[0], surface.control_points[-1]
    surface = surface.with_control_points(rough)
    on, net = depth_target(surface), bezier_nets(surface)[70]
    (s, t), u, v = on.boxes[70][::2], *rng.random((2, 2000))
    B = [np.column_stack([(1 - x) ** 3, 3 * x * (1 - x) ** 2, 3 * x**2 * (1 - x), x**3]) for x in (u, v)]
    points = np.einsum("ni,nj,jix->nx", *B, net.reshape(4, 4, 3))
    for _ in range(50):
        feet = np.column_stack(
            [rng.uniform(-0.15, 0.15, 4) + rng.choice([s, 0.0, 1.0]), rng.uniform(-0.1, 0.1, 4) + rng.choice([t, 0, 1])]
        )
        feet[:, 1] = np.clip(feet[:, 1], 0, 1)
        low, high = (feet[i] + u[:, None] * (feet[i + 1] - feet[i]) for i in (0, 2))
        at = low + v[:, None] * (high - low)
        assert (
            np.linalg.norm(points - surface.positions(*at.T), axis=1).max() <= mapped_distance_bound(net, feet, on)[0]
        )


def test_the_stock_between_the_vertices_of_its_mesh_is_bounded():
    (inner,) = body_surfaces([Capsule(STOCK.start, STOCK.end, 3.0)])
    for angle in np.linspace(0, 1, 5):
        moved = inner.with_control_points(inner.control_points + np.array([np.cos(angle), np.sin(angle), 0.0]))
        coarse = bound_mesh_depth(depth_target(moved), *faces_of_stock(STOCK, 0.4))[0]
        assert 2.5 - FITTED <= coarse <= 2.5 + 0.5


def test_hulls_of_parallel_planes_are_as_far_apart_as_the_planes():
    corners = np.array([[[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 2.0, 0.0]]])
    low, high = triangle_nets(corners), triangle_nets(corners + np.array([0.4, 0.3, 0.25]))
    assert separation(low, high, 9.0, 0.0, 0.02, 1e-3, 10**6)[0] == pytest.approx(0.25)
    assert separation(low, low, 9.0, 0.0, 0.02, 1e-3, 10**6)[0] <= 0


def test_halves_of_a_net_are_the_patch():
    surface = waisted()
    net = bezier_nets(surface)[40]
    low, high = np.empty((16, 3)), np.empty((16, 3))
    for axis in (0, 1):
        halve(net, axis, low, high)
        quarters = np.einsum("aik,bjl,klx->abijx", HALVES, HALVES, net.reshape(4, 4, 3))
        assert np.allclose(low[0], net[0])
        assert np.allclose(high[15], net[15])
        assert np.allclose(quarters[0, 0, 0, 0], low[0])
        halve(low.copy(), 1 - axis, low, high)
        assert np.allclose(low.reshape(4, 4, 3), quarters[0, 0])


@pytest.mark.slow
def test_a_shared_bone_keeps_its_limits_everywhere(shared):
    job = Job(mesh=MeshJob(units="m"))
    setup = place(prepare_part(shared / "meshes" / "bones" / "3distph_m.stl", job.mesh), job)
    for level in make_levels(fit_surface(setup.part, job).surface, setup.stock, job).levels[1:]:
        assert level.certificate is not None
        assert level.certificate.shortfalls(level.limit) == ()
        assert level.certificate.depth >= level.depth_max - 1e-4
