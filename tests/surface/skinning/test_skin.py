"""Skinning: ends met, sections met within the tolerance, smooth seam and poles, open rows, few knots, wrong
input refused."""

import numpy as np
import pytest
from scipy.interpolate import BSpline

from bonecam.errors import SurfaceError
from bonecam.surface.basis import periodic_collocation
from bonecam.surface.skinning import RowCurves, control_curves, row_parameters, skin
from bonecam.surface.tspline import TSpline

POLES = np.array([[0.0, 0.0, -3.0], [0.0, 0.0, 3.0]])


def ellipsoid_rows(rows: int = 9, points: int = 40) -> np.ndarray:
    t, s = np.meshgrid(
        np.pi * np.arange(1, rows + 1) / (rows + 1), 2 * np.pi * np.arange(points) / points, indexing="ij"
    )
    return np.stack(
        [2 * np.sin(t) * np.cos(s), np.sin(t) * np.sin(s) * (1 + 0.2 * np.cos(3 * s)), -3 * np.cos(t)], axis=2
    )


def wing_rows(counts: tuple[int, ...]) -> list[np.ndarray]:
    """Open arched rows with different counts of unevenly spaced points."""
    rows = []
    for k, count in enumerate(counts):
        x = np.linspace(0, 1, count) ** (1 + 0.1 * k)
        rows.append(
            np.column_stack(
                [10 * x, np.full(count, 3.0 * k), 2 * np.sin(np.pi * x) * (1 + 0.2 * k) + 0.4 * np.sin(9 * x)]
            )
        )
    return rows


def worst_miss(surface: TSpline, curves: RowCurves, t: np.ndarray) -> float:
    s = np.linspace(0, 1, 301)[:-1]
    points = surface.positions(np.tile(s, len(t)), np.repeat(t, len(s)))
    return float(np.linalg.norm(points - curves.at(s).reshape(-1, 3), axis=1).max())


def test_open_rows_of_four_points_have_no_knots_between() -> None:
    rows = [np.column_stack([[0.0, 1.0, 2.5, 3.0], np.full(4, y), [0.0, 0.5, 0.5, 0.0]]) for y in (0.0, 1.0, 2.0, 4.0)]
    surface = skin(rows, 0.01, closed=False)
    assert surface.tmesh.size == 16
    assert surface.project(np.vstack(rows)).distances.max() < 0.01


@pytest.mark.parametrize("count", [39, 40, 64])
def test_knots_of_rows_that_differ_by_rounding_are_one(count: int) -> None:
    """Half a turn on from points evenly round a circle are others, but for rounding."""
    s, z = 2 * np.pi * np.arange(count) / count, np.linspace(0, 1, 9)[1:-1, None]
    circles = np.stack(
        [np.sin(np.pi * z) * np.cos(s), np.sin(np.pi * z) * np.sin(s), -3 * np.cos(np.pi * z) + 0 * s], axis=2
    )
    for tolerance in (0.005, 0.02, 0.05):
        surface = skin(circles, tolerance, poles=POLES)
        assert surface.project(circles.reshape(-1, 3)).distances.max() < 1.01 * tolerance


def test_the_surface_begins_and_ends_in_the_poles() -> None:
    surface = skin(ellipsoid_rows(), 0.01, poles=POLES)
    s = np.linspace(0, 0.99, 12)
    for t, pole in ((0.0, POLES[0]), (1.0, POLES[1])):
        assert np.allclose(surface.evaluate(s, np.full(12, t)), pole, rtol=0, atol=1e-15 * 8)


@pytest.mark.parametrize("tolerance", [0.1, 0.01, 0.001, 1e-9])
def test_every_section_first_and_last_too_is_met_within_the_tolerance(tolerance: float) -> None:
    curves = RowCurves.through(ellipsoid_rows(), closed=True)
    reduced = skin(ellipsoid_rows(), tolerance, poles=POLES)
    assert worst_miss(reduced, curves, row_parameters(curves, POLES)[1:-1]) < tolerance
    assert reduced.tmesh.size < np.prod(control_curves(curves, POLES).points.shape[:2])


@pytest.mark.parametrize("tolerance", [0.1, 0.01, 0.001])
def test_the_whole_surface_stays_within_the_tolerance_of_the_one_through_all_points(tolerance: float) -> None:
    s, t = (v.ravel() for v in np.meshgrid(np.linspace(0, 0.999, 57), np.linspace(0, 1, 80)))
    exact = skin(ellipsoid_rows(), 1e-10, poles=POLES).positions(s, t)
    assert (
        np.linalg.norm(exact - skin(ellipsoid_rows(), tolerance, poles=POLES).positions(s, t), axis=1).max() < tolerance
    )


def test_open_rows_of_different_counts_are_met_with_their_corners() -> None:
    rows = wing_rows((9, 12, 7, 15, 9, 10))
    curves = RowCurves.through(rows, closed=False)
    for tolerance in (0.3, 0.03, 0.003, 1e-8):
        surface = skin(rows, tolerance, closed=False)
        assert worst_miss(surface, curves, row_parameters(curves)) < tolerance
        corners = surface.positions(np.array([0.0, 1, 0, 1]), np.array([0.0, 0, 1, 1]))
        assert np.allclose(corners, [rows[0][0], rows[0][-1], rows[-1][0], rows[-1][-1]], atol=1e-10)


def test_closed_rows_of_different_counts_are_met_with_and_without_poles() -> None:
    rows = [row[:: 1 + k % 2] for k, row in enumerate(ellipsoid_rows(7, 44))]
    curves = RowCurves.through(rows, closed=True)
    for poles, inner in ((None, slice(None)), (POLES, slice(1, -1))):
        surface = skin(rows, 0.01, poles=poles)
        assert worst_miss(surface, curves, row_parameters(curves, poles)[inner]) < 0.01


@pytest.mark.parametrize("count", [2, 3, 4, 5])
def test_few_rows_are_enough(count: int) -> None:
    rows = wing_rows((9, 12, 7, 15, 9)[:count])
    curves = RowCurves.through(rows, closed=False)
    assert worst_miss(skin(rows, 0.01, closed=False), curves, row_parameters(curves)) < 0.01


def test_two_straight_rows_make_a_flat_ruled_patch() -> None:
    rows = [np.column_stack([np.linspace(0, 4, 5), np.full(5, y), np.zeros(5)]) for y in (0.0, 3.0)]
    surface = skin(rows, 1e-6, closed=False)
    assert surface.tmesh.size == 16
    assert surface.area == pytest.approx(12)


def test_few_rows_of_knots_are_kept_where_the_rows_are_simple() -> None:
    simple = [
        np.column_stack([np.linspace(0, 4, 15), np.full(15, y), y * np.linspace(-1, 1, 15) ** 2]) for y in range(5)
    ]
    assert skin(simple, 1e-6, closed=False).tmesh.size < 5 * 15
    bumpy = [row + 0.3 * (k == 2) * np.sin(5 * row[:, :1]) * np.array([0, 0, 1]) for k, row in enumerate(simple)]
    counts = np.diff(skin(bumpy, 0.01, closed=False).tmesh.row_starts)
    assert counts[0] < counts[2]


def test_open_elements_evaluate_as_the_blended_rows_do() -> None:
    surface = skin(wing_rows((9, 12, 7, 15, 9, 10)), 0.02, closed=False)
    rng = np.random.default_rng(2)
    s, t = np.append(rng.random(200), [0, 1, 0, 1]), np.append(rng.random(200), [0, 0, 1, 1])
    tmesh = surface.tmesh
    rows = [
        BSpline(knots, points, 3)
        for knots, points in zip(tmesh.s_knots, np.split(surface.control_points, tmesh.row_starts[1:-1]))
    ]
    along = BSpline(tmesh.t_knots, np.eye(len(rows)), 3)
    orders = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
    for (a, b), basis, value in zip(orders, surface.basis(s, t, 2), surface.evaluate(s, t, 2)):
        direct = sum(along(t, b)[:, [j]] * row(s, a) for j, row in enumerate(rows))
        assert np.allclose(direct, value, atol=1e-8 * np.abs(value).max())
        assert np.allclose(basis @ surface.control_points, value, atol=1e-8 * np.abs(value).max())


def test_a_looser_tolerance_never_needs_more_control_points() -> None:
    sizes = [skin(ellipsoid_rows(), tolerance, poles=POLES).tmesh.size for tolerance in (1e-3, 1e-2, 1e-1)]
    assert sizes == sorted(sizes, reverse=True)


def test_the_control_curves_leave_the_poles_in_odd_directions() -> None:
    curves = RowCurves.through(ellipsoid_rows(), closed=True)
    control = control_curves(curves, POLES)
    assert np.allclose(control.points[0], POLES[0], atol=1e-12)
    assert np.allclose(control.points[-1], POLES[1], atol=1e-12)
    s = np.arange(17) / 17
    near, far = (periodic_collocation(control.fine, x) @ control.points[1] - POLES[0] for x in (s, np.mod(s + 0.5, 1)))
    assert np.allclose(near, -far, atol=1e-10)


def test_the_surface_is_c2_across_the_seam() -> None:
    surface = skin(ellipsoid_rows(), 0.01, poles=POLES)
    t = np.linspace(0.1, 0.9, 9)
    before, after = surface.evaluate(np.full(9, 1 - 1e-9), t, 2), surface.evaluate(np.zeros(9), t, 2)
    for a, b in zip(before, after):
        assert np.allclose(a, b, atol=1e-4)


@pytest.mark.whole
def test_too_few_control_points_say_what_they_reach() -> None:
    needed = skin(ellipsoid_rows(), 1e-3, poles=POLES).tmesh.size
    with pytest.raises(SurfaceError, match="reach") as caught:
        skin(ellipsoid_rows(), 1e-3, poles=POLES, max_control_points=needed // 2)
    reached = caught.value.evidence["reached"]
    assert reached > 1e-3
    assert skin(ellipsoid_rows(), reached, poles=POLES).tmesh.size <= needed // 2
    with pytest.raises(SurfaceError, match="at least"):
        skin(ellipsoid_rows(), 1e-3, poles=POLES, max_control_points=10)
    with pytest.raises(SurfaceError, match="below rounding"):
        skin(ellipsoid_rows(), 1e-15, poles=POLES)


def test_rows_of_noise_are_refused_soon() -> None:
    """Before knots are taken out again, which took minutes, where they need far more than are allowed."""
    random = np.random.default_rng(1)
    rows = [row[: 36 + k % 5] for k, row in enumerate(ellipsoid_rows())]
    noise = [row + random.normal(size=row.shape) for row in rows]
    with pytest.raises(SurfaceError, match=r"needs more than 60 control points, which reach .*: smooth the rows"):
        skin(noise, 0.1, poles=POLES, max_control_points=60)


def test_rows_whose_knots_would_fill_the_memory_are_refused() -> None:
    random = np.random.default_rng(1)
    angles = [np.sort(random.uniform(0, 2 * np.pi, 450 + k)) for k in range(200)]
    rows = [np.column_stack([np.cos(a), np.sin(a), np.full(len(a), k)]) for k, a in enumerate(angles)]
    with pytest.raises(ValueError, match=r"200 rows have .* knots together: give all rows equal counts"):
        skin(rows, 0.1)


def test_wrong_rows_are_refused() -> None:
    points = ellipsoid_rows()
    with pytest.raises(ValueError, match="two or more rows"):
        skin(points[:1], 0.1, poles=POLES)
    with pytest.raises(ValueError, match="row 2 has 4 points"):
        skin([points[0], points[1], points[2][::10]], 0.1)
    with pytest.raises(ValueError, match="shape"):
        skin(points[:, :, :2], 0.1)
    with pytest.raises(ValueError, match="tolerance"):
        skin(points, 0.0, poles=POLES)
    with pytest.raises(ValueError, match="rows 0 and 1 coincide"):
        skin(np.concatenate([points[:1], points]), 0.1, poles=POLES)
    with pytest.raises(ValueError, match="closed rows"):
        skin(points, 0.1, poles=POLES, closed=False)
    broken = points.copy()
    broken[3, 5, 1] = np.nan
    with pytest.raises(ValueError, match="row 3, point 5 is not finite"):
        skin(broken, 0.1)
    with pytest.raises(ValueError, match="row 0: points 39 and 0 coincide"):
        skin([np.vstack([row[:-1], row[:1]]) for row in points], 0.1)
