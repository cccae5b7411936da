"""The capsule: exact distances, a closed mesh on its surface, and refusals that name the distance and the
place."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bonecam.errors import StockError
from bonecam.job import StockJob
from bonecam.mesh.distance import exact_closest
from bonecam.setup.capsule import Capsule, smallest_capsule
from bonecam.setup.placement import stock_for
from bonecam.setup.rounding import require_inside
from bonecam.setup.stock import Schedule, finite_numbers
from bonecam.setup.stocks.capsule import capsule_of_size

CAPSULE = Capsule(np.array([0.0, 0.0, 7.5]), np.array([0.0, 0.0, 29.5]), 7.5)


def cloud(seed: int, count: int = 400) -> np.ndarray:
    return np.random.default_rng(seed).uniform([-4, -3, 10], [4, 3, 26], (count, 3))


def test_nearest_points_lie_on_the_surface_at_the_signed_distance() -> None:
    points = np.random.default_rng(1).uniform(-12, 45, (500, 3))
    distance, nearest = CAPSULE.signed_distance(points), CAPSULE.closest_points(points)
    assert np.abs(CAPSULE.signed_distance(nearest)).max() < 1e-12
    assert np.allclose(np.linalg.norm(points - nearest, axis=1), np.abs(distance), atol=1e-12)
    assert np.allclose(nearest + distance[:, None] * CAPSULE.normals(points), points, atol=1e-12)


def test_points_on_the_axis_have_a_nearest_point_too() -> None:
    nearest = CAPSULE.closest_points(np.array([[0.0, 0.0, 20.0], [0.0, 0.0, 7.5]]))
    assert np.abs(CAPSULE.signed_distance(nearest)).max() < 1e-12


@pytest.mark.parametrize(
    "capsule",
    [
        Capsule(np.array([1.0, 2, -3]), np.array([1.5, 4, 20]), 7.5),
        Capsule(np.zeros(3), np.array([10.0, 1, 3]), 0.01),
        Capsule(np.array([3e3, 7e2, 0]), np.array([3e3, 7e2, 1000]), 0.1),
    ],
)
def test_points_on_a_leaning_axis_lead_across_it(capsule: Capsule) -> None:
    points = capsule.start + np.linspace(0, 1, 1001)[:, None] * (capsule.end - capsule.start)
    assert np.abs(capsule.normals(points) @ (capsule.end - capsule.start)).max() < 1e-4 * np.linalg.norm(
        capsule.end - capsule.start
    )
    assert np.abs(capsule.signed_distance(capsule.closest_points(points))).max() < 1e-9


@pytest.mark.parametrize("straight", [0.0, 0.3, 22.0])
def test_the_mesh_is_closed_outward_and_within_the_chord_tolerance(straight: float) -> None:
    capsule = Capsule(np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, 1.0 + straight]), 7.5)
    mesh = capsule.mesh(0.05)
    edges = np.sort(np.vstack([mesh.faces[:, [i, (i + 1) % 3]] for i in range(3)]), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()
    assert np.abs(capsule.signed_distance(mesh.vertices)).max() < 1e-12
    assert capsule.signed_distance(mesh.vertices[mesh.faces].mean(1)).min() > -0.05
    volume = np.pi * 7.5**2 * straight + 4 / 3 * np.pi * 7.5**3
    assert volume * 0.98 < mesh.volume < volume
    assert np.linalg.norm(mesh.face_vectors, axis=1).min() > 0


def test_the_signed_distance_agrees_with_the_mesh() -> None:
    points = cloud(2)
    closest, _ = exact_closest(CAPSULE.mesh(0.002), points)
    assert np.allclose(np.linalg.norm(points - closest, axis=1), -CAPSULE.signed_distance(points), atol=0.003)


@given(st.integers(0, 10_000), st.floats(0.05, 5.0))
def test_the_smallest_capsule_leaves_exactly_the_allowance(seed: int, allowance: float) -> None:
    points = cloud(seed, 40)
    capsule = smallest_capsule(points, allowance)
    assert capsule.signed_distance(points).max() == pytest.approx(-allowance, abs=1e-6)
    assert (capsule.start[:2] == 0).all()
    assert (capsule.end[:2] == 0).all()


def test_a_part_that_leaves_the_given_capsule_is_refused_with_distance_and_place() -> None:
    points = np.vstack([cloud(3), [[7.9, 0.0, 18.0]]])
    capsule = capsule_of_size(15.0, 37.0, 18.0)
    with pytest.raises(StockError, match=r"leaves it by 0.400 mm at \(7.90, 0.00, 18.00\)") as caught:
        require_inside(capsule, points, 0.05)
    assert caught.value.evidence["distance"] == pytest.approx(0.4)
    assert np.allclose(caught.value.evidence["place"], [7.9, 0, 18])


def test_a_part_that_touches_the_wall_is_refused() -> None:
    with pytest.raises(StockError, match="of its wall"):
        require_inside(CAPSULE, np.array([[7.49, 0.0, 18.0]]), 0.05)


@pytest.mark.parametrize(
    ("x", "said", "more"),
    [
        (7.451, "within 0.049", "15.01"),
        (7.5, "within 0.000", "15.10"),
        (7.52, "leaves it by 0.020", "15.14"),
        (7.523, "by 0.023", "15.15"),
    ],
)
def test_what_is_missing_is_told_rounded_up(x: float, said: str, more: str) -> None:
    with pytest.raises(StockError, match=f"{said} mm .* give stock.diameter at least {more}$"):
        require_inside(CAPSULE, np.array([[x, 0.0, 18.0]]), 0.05)


def test_a_given_capsule_is_centred_on_the_part() -> None:
    points = cloud(4)
    capsule, _ = stock_for(points, StockJob(diameter=15.0, length=37.0), Schedule((), 0.5))
    assert capsule.middle[2] == pytest.approx((points[:, 2].min() + points[:, 2].max()) / 2)
    assert (capsule.diameter, capsule.length) == pytest.approx((15.0, 37.0))


@pytest.mark.parametrize(
    ("diameter", "length", "told"),
    [
        (15.0, 10.0, r"stock\.length = 10: .* diameter 15 mm .*: give at least 15, or a smaller stock\.diameter"),
        (0.0, 10.0, r"stock\.diameter = 0: .*: give the diameter"),
        (-1.0, 3.0, r"stock\.diameter = -1: .*: give the diameter"),
    ],
)
def test_a_capsule_shorter_than_its_diameter_is_refused_with_setting_and_remedy(
    diameter: float, length: float, told: str
) -> None:
    with pytest.raises(StockError, match=told):
        capsule_of_size(diameter, length, 18.0)


def test_an_allowance_of_nothing_is_refused() -> None:
    with pytest.raises(StockError):
        smallest_capsule(cloud(6), 0.0)


@pytest.mark.parametrize(
    "values",
    [
        [0.0, 1.0],
        [0.0, 1.0, np.nan],
        [0.0, 1.0, np.inf],
        [0.0, 1.0, "up"],
        ["0", "1", "2"],
        None,
        [[0.0, 1.0, 2.0]],
        [0.0, 1.0, 1e7],
    ],
)
def test_ends_of_a_stock_are_three_finite_numbers(values: object) -> None:
    with pytest.raises(StockError, match=r"^a capsule's end is .*: give 3 finite numbers \(mm, 1e\+06 at most\)$"):
        finite_numbers("a capsule's end", values, 3)


@pytest.mark.parametrize("radius", [0.0, -1.0, np.nan, np.inf, 1e7])
def test_a_capsule_of_no_radius_is_refused(radius: float) -> None:
    with pytest.raises(StockError, match=r"^a capsule"):
        Capsule(CAPSULE.start, CAPSULE.end, radius)
