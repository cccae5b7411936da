"""Every stock answers the same questions: exact distances, nearest points, a closed even mesh, and refuses
what is no body.

The capsule: exact distances, a closed mesh on its surface, and refusals that name the distance and the
place.

The depths of the cuts and the fewest cuts there can be.
"""

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mesh_bodies import is_closed, moved, together

from bonecam.arrays import ROUNDING
from bonecam.errors import JobError, LevelError, StockError
from bonecam.job import Job, LevelsJob
from bonecam.mesh import TriangleMesh, exact_closest
from bonecam.setup import (
    Box,
    Capsule,
    ConvexStock,
    Cylinder,
    Schedule,
    Stock,
    schedule_of,
    smallest_capsule,
    stock_figures,
)
from bonecam.setup.rounding import require_inside
from bonecam.setup.stock import even_out, finite_numbers, stock_text
from bonecam.setup.stocks.capsule import capsule_of_size

BOX = Box(np.array([-6.0, -7.5, 3.0]), np.array([6.0, 7.5, 40.0]))
CYLINDER = Cylinder(7.5, 3.0, 40.0)
BODIES: dict[str, Stock] = {
    "capsule": Capsule(np.array([0, 0, 10.5]), np.array([0, 0, 32.5]), 7.5),
    "cylinder": CYLINDER,
    "box": BOX,
    "mesh": ConvexStock(BOX.mesh(2.0)),
    "prism": ConvexStock(Cylinder(7.0, 0.0, 30.0).mesh(2.0)),
}


@pytest.fixture(params=BODIES, name="body")
def each_body(request):
    return BODIES[request.param]


def cloud(count: int = 500) -> np.ndarray:
    return np.random.default_rng(5).uniform([-14, -14, -8], [14, 14, 50], (count, 3))


def test_nearest_points_lie_on_the_surface_at_the_signed_distance(body):
    points, rounding = cloud(), 1e-12 if isinstance(body, Capsule) else 1e-9
    distance, nearest = body.signed_distance(points), body.closest_points(points)
    assert isinstance(body, Stock)
    assert np.abs(body.signed_distance(nearest)).max() < rounding
    assert np.allclose(np.linalg.norm(points - nearest, axis=1), np.abs(distance), atol=rounding)
    assert np.allclose(nearest + distance[:, None] * body.normals(points), points, atol=rounding)


def test_distances_agree_with_the_mesh(body):
    points = cloud()
    closest, _ = exact_closest(body.mesh(0.002), points)
    off = 0.003 if isinstance(body, Capsule) else 0.004
    assert np.allclose(np.linalg.norm(points - closest, axis=1), np.abs(body.signed_distance(points)), atol=off)


def test_no_planes_of_nearest_points_cut_the_body(body):
    points = cloud(200)
    normals, touch, probes = body.normals(points), body.closest_points(points), body.mesh(0.05).vertices
    assert np.allclose(np.linalg.norm(normals, axis=1), 1)
    assert (probes @ normals.T - (normals * touch).sum(1)).max() < 1e-9


def test_the_mesh_is_closed_outward_and_on_the_surface(body):
    mesh = body.mesh(0.02)
    assert is_closed(mesh)
    assert np.abs(body.signed_distance(mesh.vertices)).max() < 1e-9
    assert np.abs(body.signed_distance(mesh.vertices[mesh.faces].mean(1))).max() < 0.02
    assert np.linalg.norm(mesh.face_vectors, axis=1).min() > 0
    assert np.allclose(mesh.bounds, body.bounds, atol=0.05)
    assert mesh.volume > 0


def test_a_moved_body_is_the_same_elsewhere(body):
    shift, points = np.array([1.0, -2.0, 3.0]), cloud(50)
    moved = body.move(shift)
    assert np.allclose(moved.signed_distance(points + shift), body.signed_distance(points), atol=1e-9)
    assert (moved.kind, moved.diameter, moved.length) == pytest.approx((body.kind, body.diameter, body.length))


SIZES = {
    "capsule": {"diameter": 15.0, "length": 37.0},
    "cylinder": {"diameter": 15.0, "length": 37.0},
    "box": {"width": 12.0, "depth": 15.0, "length": 37.0},
    "mesh": {"width": 12.0, "depth": 15.0, "length": 37.0},
}


@pytest.mark.parametrize("kind", SIZES)
def test_a_stock_is_described_by_its_own_sizes(kind):
    assert stock_figures(BODIES[kind]) == {"kind": kind, **{f"{name}_mm": size for name, size in SIZES[kind].items()}}
    assert (
        stock_text(stock_figures(BODIES[kind]))
        == f"{kind} {' x '.join(f'{size:.2f}' for size in SIZES[kind].values())} mm"
    )


def test_a_mesh_that_is_not_convex_is_refused_with_distance_and_place():
    mesh = Box(np.zeros(3), np.full(3, 10.0)).mesh(2.0)
    vertices = mesh.vertices.copy()
    middle = int(np.argmin(np.linalg.norm(vertices - [5, 5, 10], axis=1)))
    vertices[middle, 2] -= 1.0
    with pytest.raises(StockError, match="not convex: it lies 1") as caught:
        ConvexStock(TriangleMesh(vertices, mesh.faces))
    assert caught.value.evidence["distance"] == pytest.approx(1.0)
    assert caught.value.evidence["place"][2] == pytest.approx(9.0)


def test_vertices_without_faces_are_no_part_of_a_body():
    mesh = BOX.mesh(1.0)
    stock = ConvexStock(TriangleMesh(np.vstack([BOX.middle, [99.0, 0, 0], mesh.vertices]), mesh.faces + 2))
    assert np.array_equal(stock.bounds, BOX.bounds)


NAN, INF = float("nan"), float("inf")
CAPSULE = Capsule(np.array([0.0, 0.0, 7.5]), np.array([0.0, 0.0, 29.5]), 7.5)


def near_cloud(seed: int, count: int = 400) -> np.ndarray:
    return np.random.default_rng(seed).uniform([-4, -3, 10], [4, 3, 26], (count, 3))


@pytest.mark.parametrize(
    "capsule",
    [
        Capsule(np.array([1.0, 2, -3]), np.array([1.5, 4, 20]), 7.5),
        Capsule(np.zeros(3), np.array([10.0, 1, 3]), 0.01),
        Capsule(np.array([3e3, 7e2, 0]), np.array([3e3, 7e2, 1000]), 0.1),
    ],
)
def test_points_on_a_leaning_axis_lead_across_it(capsule):
    points = capsule.start + np.linspace(0, 1, 1001)[:, None] * (capsule.end - capsule.start)
    assert np.abs(capsule.normals(points) @ (capsule.end - capsule.start)).max() < 1e-4 * np.linalg.norm(
        capsule.end - capsule.start
    )
    assert np.abs(capsule.signed_distance(capsule.closest_points(points))).max() < 1e-9


@given(st.integers(0, 10_000), st.floats(0.05, 5.0))
def test_the_smallest_capsule_leaves_exactly_the_allowance(seed, allowance):
    points = near_cloud(seed, 40)
    capsule = smallest_capsule(points, allowance)
    assert capsule.signed_distance(points).max() == pytest.approx(-allowance, abs=1e-6)
    assert (capsule.start[:2] == 0).all()
    assert (capsule.end[:2] == 0).all()


def test_a_part_that_leaves_the_given_capsule_is_refused_with_distance_and_place():
    points = np.vstack([near_cloud(3), [[7.9, 0.0, 18.0]]])
    capsule = capsule_of_size(15.0, 37.0, 18.0)
    with pytest.raises(StockError, match=r"leaves it by 0.400 mm at \(7.90, 0.00, 18.00\)") as caught:
        require_inside(capsule, points, 0.05)
    assert caught.value.evidence["distance"] == pytest.approx(0.4)
    assert np.allclose(caught.value.evidence["place"], [7.9, 0, 18])


@pytest.mark.parametrize(
    ("x", "said", "more"),
    [
        (7.451, "within 0.049 mm of its wall", "15.01"),
        (7.5, "within 0.000 mm of its wall", "15.10"),
        (7.52, "leaves it by 0.020 mm", "15.14"),
        (7.523, "by 0.023 mm", "15.15"),
    ],
)
def test_what_is_missing_is_told_rounded_up(x, said, more):
    with pytest.raises(StockError, match=f"{said} .* give stock.diameter at least {more}$"):
        require_inside(CAPSULE, np.array([[x, 0.0, 18.0]]), 0.05)


def test_the_papers_schedule_needs_sixteen_cuts_for_its_finger_bone():
    schedule = schedule_of(LevelsJob())
    assert [schedule.limit(k) for k in (1, 4, 5, 16)] == [0.1, 0.1, 0.5, 0.5]
    assert schedule.lower_bound(6.34) == 16


@given(st.floats(0.01, 60.0), st.lists(st.floats(0.05, 1.0), max_size=6), st.floats(0.1, 2.0))
def test_the_lower_bound_is_the_first_sum_of_depths_that_reaches(distance, first, beyond):
    schedule = Schedule(tuple(first), beyond)
    bound = schedule.lower_bound(distance)
    assert schedule.reach(bound) >= distance - ROUNDING
    assert bound == 1 or schedule.reach(bound - 1) < distance


def test_a_sum_of_depths_that_rounding_leaves_short_reaches():
    assert Schedule((0.1,) * 10, 0.5).lower_bound(1.0) == 10
    assert Schedule((), 0.5).lower_bound(2.000000000000013) == 4
    assert Schedule((), 0.5).lower_bound(2.0001) == 5


def test_more_cuts_than_anybody_wants_are_refused():
    with pytest.raises(
        LevelError, match=r"^100\.0 mm .* more than 2000 cuts, which take 2\.0 mm: give deeper cuts"
    ) as caught:
        Schedule((), 0.001).lower_bound(100.0)
    assert caught.value.evidence["distance"] == 100.0
    with pytest.raises(LevelError, match="nan"):
        Schedule((), 0.5).lower_bound(float("nan"))


def test_a_list_of_depths_rules_and_its_last_holds_for_all_others():
    schedule = schedule_of(LevelsJob(depths="0.05, 0.1 0.4", finishing_levels=7))
    assert [schedule.limit(k) for k in (1, 2, 3, 9)] == [0.05, 0.1, 0.4, 0.4]
    assert schedule_of(LevelsJob(depths="0.3")) == Schedule((), 0.3)


def test_the_fewest_levels_are_all_at_the_roughing_depth():
    job, distance = LevelsJob(schedule="fewest"), 6.34
    assert schedule_of(job) == Schedule((), 0.5)
    assert schedule_of(job).lower_bound(distance) == 13 < schedule_of(LevelsJob()).lower_bound(distance)


def test_a_list_may_be_an_array():
    assert LevelsJob(depths=np.array([0.1, 0.3])).cuts == ((0.1,), 0.3)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("levels", "finishing"),
    [
        ({}, 4),
        ({"finishing_levels": 0}, 1),
        ({"schedule": "fewest"}, 1),
        ({"depths": "0.1 0.05 0.2 0.5"}, 2),
        ({"depths": "0.3 0.1"}, 20),
    ],
)
def test_the_finishing_cutter_machines_what_is_cut_no_deeper_than_finishing(levels, finishing):
    job = Job().with_values(levels=levels)
    kinds = [job.is_finishing(level) for level in range(20)]
    assert kinds[0]
    assert sum(kinds) == finishing


@given(st.floats(0.2, 1.0), st.floats(0.8, 1.0), st.integers(2, 30), st.floats(0.02, 0.98))
def test_evened_cuts_share_what_the_last_had_left(beyond, share, count, left):
    """`count` cuts that each gain `share` of their depth and a last one of `left` of its depth."""
    first = (0.1, 0.1)
    rest = left * beyond
    distance = sum(first) + count * share * beyond + rest
    even = even_out(Schedule(first, beyond), distance, 2 + count + 1, rest)
    assert even.beyond <= beyond
    assert distance - sum(first) - count * share * even.beyond == pytest.approx(min(even.beyond, distance))


CUBE, BAR, BLOCK = (box.mesh(2.0) for box in (Box(np.zeros(3), np.ones(3)), BOX, Box(np.zeros(3), np.full(3, 10.0))))
ABSURD = r"reaches 1e\+07 mm from the origin: give one in mm"
FLAT = "is flat and holds nothing: give a solid body"
NO_SINGLE = r"no single convex body: its faces hold 2\.0 mm3, their convex hull 1\.0: give the hull$"
SHORT = r"stock\.length = 10: .* diameter 15 mm .*: give at least 15, or a smaller stock\.diameter"
NO_ENDS = [[0.0, 1.0], [0.0, 1.0, NAN], [0.0, 1.0, INF], [0.0, 1.0, "up"], ["0", "1", "2"], None, [[0.0, 1.0, 2.0]]]
NO_DEPTHS = [((0.1, 0.0), 0.5), ((), -1.0), ((), NAN), ((), 1e-300), ((), INF), ((INF,), 0.5)]
REFUSED: list[tuple[Callable[[], object], type[Exception], str]] = [
    (lambda: ConvexStock(TriangleMesh(1e6 * BLOCK.vertices, BLOCK.faces)), StockError, ABSURD),
    (lambda: ConvexStock(BLOCK).scale(2e6), StockError, ABSURD),
    (lambda: ConvexStock(together(CUBE, moved(CUBE, (3, 3, 3)))), StockError, "not convex"),
    (lambda: ConvexStock(together(CUBE, CUBE)), StockError, NO_SINGLE),
    (lambda: ConvexStock(TriangleMesh(BAR.vertices, BAR.faces[1:])), StockError, "not closed at"),
    (lambda: ConvexStock(TriangleMesh(BAR.vertices, BAR.faces[:, ::-1])), StockError, "inside out"),
    *(
        (partial(ConvexStock, TriangleMesh(BAR.vertices * [1.0, 1.0, thick], BAR.faces)), StockError, FLAT)
        for thick in (0.0, 1e-6, -1e-6)
    ),
    (lambda: Cylinder(0.0, 0.0, 1.0), StockError, "positive"),
    (lambda: Cylinder(1.0, 2.0, 1.0), StockError, "positive"),
    (lambda: Box(np.zeros(3), np.array([1.0, 1, 0])), StockError, "positive"),
    (lambda: capsule_of_size(15.0, 10.0, 18.0), StockError, SHORT),
    (lambda: capsule_of_size(0.0, 10.0, 18.0), StockError, r"stock\.diameter = 0: .*: give the diameter"),
    (lambda: capsule_of_size(-1.0, 3.0, 18.0), StockError, r"stock\.diameter = -1: .*: give the diameter"),
    (lambda: smallest_capsule(near_cloud(6), 0.0), StockError, "allowance"),
    *(
        (
            partial(finite_numbers, "an end", ends, 3),
            StockError,
            r"^an end is .*: give 3 finite numbers \(mm, 1e\+06 at",
        )
        for ends in (*NO_ENDS, [0.0, 1.0, 1e7])
    ),
    *(
        (partial(Capsule, CAPSULE.start, CAPSULE.end, radius), StockError, "^a capsule")
        for radius in (0.0, -1.0, NAN, INF, 1e7)
    ),
    *((partial(Schedule, *depths), LevelError, "finite depth of at least") for depths in NO_DEPTHS),
    *(
        (partial(LevelsJob, depths=text), JobError, "^depths = ")
        for text in ("deep", "0.1;0.2", "0.1 0 0.5", "0.1 -1", "nan", "0.1 inf")
    ),
    (lambda: LevelsJob(depths=[]), JobError, r"^depths = \[\]: give one at least"),
    (
        lambda: LevelsJob(depths="0.1 0.5", schedule="fewest"),
        JobError,
        r"^depths = '0\.1 0\.5': .*schedule = 'fewest'.* leave one of them out$",
    ),
    (lambda: LevelsJob(depths="0.1 " * 2001), JobError, "^depths = .*give at most 2000; the last holds for all others"),
]


@pytest.mark.parametrize(("make", "error", "why"), REFUSED)
def test_what_is_no_stock_and_no_schedule_is_refused(make, error, why):
    with pytest.raises(error, match=why):
        make()
