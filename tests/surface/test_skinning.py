"""Skinning: ends met, sections met within the tolerance, smooth seam and poles, open rows, few knots, wrong
input refused.

The surface through an open mesh with four corners: near the mesh, faced as it is, its parameters along the sides.

Rows of points from files, skinned.

The closed solid of a skin without poles, and blunt edges.

Knot reduction: the bound holds everywhere, closed and open, alone and together; nothing needless is
kept.
"""

import numpy as np
import pytest
from scipy.interpolate import BSpline
from scipy.spatial import Delaunay
from tsplines import SECTION_POLES, sections, write_rows

from bonecam.errors import FileError, SurfaceError
from bonecam.mesh import TriangleMesh
from bonecam.mesh.distance import hausdorff
from bonecam.mesh.healing import holes_of
from bonecam.surface import TSpline, blade_solid, skin, skinning
from bonecam.surface.basis import collocation, interpolate, periodic_collocation, sites
from bonecam.surface.skinning import (
    Reduction,
    RowCurves,
    control_curves,
    has_blunt_edge,
    holds_rows,
    patch_surface,
    read_rows,
    row_parameters,
)

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


def test_open_rows_of_four_points_have_no_knots_between():
    rows = [np.column_stack([[0.0, 1.0, 2.5, 3.0], np.full(4, y), [0.0, 0.5, 0.5, 0.0]]) for y in (0.0, 1.0, 2.0, 4.0)]
    surface = skin(rows, 0.01, closed=False)
    assert surface.tmesh.size == 16
    assert surface.project(np.vstack(rows)).distances.max() < 0.01


@pytest.mark.parametrize("count", [39, 40, 64])
def test_knots_of_rows_that_differ_by_rounding_are_one(count):
    """Half a turn on from points evenly round a circle are others, but for rounding."""
    s, z = 2 * np.pi * np.arange(count) / count, np.linspace(0, 1, 9)[1:-1, None]
    circles = np.stack(
        [np.sin(np.pi * z) * np.cos(s), np.sin(np.pi * z) * np.sin(s), -3 * np.cos(np.pi * z) + 0 * s], axis=2
    )
    for tolerance in (0.005, 0.02, 0.05):
        surface = skin(circles, tolerance, poles=POLES)
        assert surface.project(circles.reshape(-1, 3)).distances.max() < 1.01 * tolerance


def test_the_surface_begins_and_ends_in_the_poles():
    surface = skin(ellipsoid_rows(), 0.01, poles=POLES)
    s = np.linspace(0, 0.99, 12)
    for t, pole in ((0.0, POLES[0]), (1.0, POLES[1])):
        assert np.allclose(surface.evaluate(s, np.full(12, t)), pole, rtol=0, atol=1e-15 * 8)


@pytest.mark.parametrize("tolerance", [0.1, 0.01, 0.001, 1e-9])
def test_every_section_first_and_last_too_is_met_within_the_tolerance(tolerance):
    curves = RowCurves.through(ellipsoid_rows(), closed=True)
    reduced = skin(ellipsoid_rows(), tolerance, poles=POLES)
    assert worst_miss(reduced, curves, row_parameters(curves, POLES)[1:-1]) < tolerance
    assert reduced.tmesh.size < np.prod(control_curves(curves, POLES).points.shape[:2])


@pytest.mark.parametrize("tolerance", [0.1, 0.01, 0.001])
def test_the_whole_surface_stays_within_the_tolerance_of_the_one_through_all_points(tolerance):
    s, t = (v.ravel() for v in np.meshgrid(np.linspace(0, 0.999, 57), np.linspace(0, 1, 80)))
    exact = skin(ellipsoid_rows(), 1e-10, poles=POLES).positions(s, t)
    assert (
        np.linalg.norm(exact - skin(ellipsoid_rows(), tolerance, poles=POLES).positions(s, t), axis=1).max() < tolerance
    )


def test_open_rows_of_different_counts_are_met_with_their_corners():
    rows = wing_rows((9, 12, 7, 15, 9, 10))
    curves = RowCurves.through(rows, closed=False)
    for tolerance in (0.3, 0.03, 0.003, 1e-8):
        surface = skin(rows, tolerance, closed=False)
        assert worst_miss(surface, curves, row_parameters(curves)) < tolerance
        corners = surface.positions(np.array([0.0, 1, 0, 1]), np.array([0.0, 0, 1, 1]))
        assert np.allclose(corners, [rows[0][0], rows[0][-1], rows[-1][0], rows[-1][-1]], atol=1e-10)


def test_closed_rows_of_different_counts_are_met_with_and_without_poles():
    rows = [row[:: 1 + k % 2] for k, row in enumerate(ellipsoid_rows(7, 44))]
    curves = RowCurves.through(rows, closed=True)
    for poles, inner in ((None, slice(None)), (POLES, slice(1, -1))):
        surface = skin(rows, 0.01, poles=poles)
        assert worst_miss(surface, curves, row_parameters(curves, poles)[inner]) < 0.01


@pytest.mark.parametrize("count", [2, 3, 4, 5])
def test_few_rows_are_enough(count):
    rows = wing_rows((9, 12, 7, 15, 9)[:count])
    curves = RowCurves.through(rows, closed=False)
    assert worst_miss(skin(rows, 0.01, closed=False), curves, row_parameters(curves)) < 0.01


def test_few_rows_of_knots_are_kept_where_the_rows_are_simple():
    simple = [
        np.column_stack([np.linspace(0, 4, 15), np.full(15, y), y * np.linspace(-1, 1, 15) ** 2]) for y in range(5)
    ]
    assert skin(simple, 1e-6, closed=False).tmesh.size < 5 * 15
    bumpy = [row + 0.3 * (k == 2) * np.sin(5 * row[:, :1]) * np.array([0, 0, 1]) for k, row in enumerate(simple)]
    counts = np.diff(skin(bumpy, 0.01, closed=False).tmesh.row_starts)
    assert counts[0] < counts[2]


def test_open_elements_evaluate_as_the_blended_rows_do():
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


def test_the_control_curves_leave_the_poles_in_odd_directions():
    curves = RowCurves.through(ellipsoid_rows(), closed=True)
    control = control_curves(curves, POLES)
    assert np.allclose(control.points[0], POLES[0], atol=1e-12)
    assert np.allclose(control.points[-1], POLES[1], atol=1e-12)
    s = np.arange(17) / 17
    near, far = (periodic_collocation(control.fine, x) @ control.points[1] - POLES[0] for x in (s, np.mod(s + 0.5, 1)))
    assert np.allclose(near, -far, atol=1e-10)


@pytest.mark.whole
def test_too_few_control_points_say_what_they_reach():
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


def test_rows_of_noise_are_refused_soon():
    """Before knots are taken out again, which took minutes, where they need far more than are allowed."""
    random = np.random.default_rng(1)
    rows = [row[: 36 + k % 5] for k, row in enumerate(ellipsoid_rows())]
    noise = [row + random.normal(size=row.shape) for row in rows]
    with pytest.raises(SurfaceError, match=r"needs more than 60 control points, which reach .*: smooth the rows"):
        skin(noise, 0.1, poles=POLES, max_control_points=60)


def test_rows_whose_knots_would_fill_the_memory_are_refused():
    random = np.random.default_rng(1)
    angles = [np.sort(random.uniform(0, 2 * np.pi, 450 + k)) for k in range(200)]
    rows = [np.column_stack([np.cos(a), np.sin(a), np.full(len(a), k)]) for k, a in enumerate(angles)]
    with pytest.raises(ValueError, match=r"200 rows have .* knots together: give all rows equal counts"):
        skin(rows, 0.1)


def test_wrong_rows_are_refused():
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


def patch(across: int = 24, along: int = 36, *, flipped: bool = False) -> TriangleMesh:
    """A bent, twisted patch of 50 x 30 mm, its inner vertices moved at random."""
    u, v = (side.ravel() for side in np.meshgrid(np.linspace(0, 1, along), np.linspace(0, 1, across)))
    inner = (u > 0) & (u < 1) & (v > 0) & (v < 1)
    moved = np.random.default_rng(4).uniform(-0.3, 0.3, (2, len(u))) * inner
    u, v = u + moved[0] / along, v + moved[1] / across
    bent = np.column_stack([50 * u, 30 * v, 6 * np.sin(3 * u) * np.cos(2 * v) + 4 * u * v])
    faces = Delaunay(np.column_stack([u, v])).simplices
    return TriangleMesh(bent, faces[:, ::-1] if flipped else faces)


@pytest.mark.parametrize("flipped", [False, True])
def test_it_lies_within_the_tolerance_and_faces_as_the_triangles_do(flipped):
    mesh = patch(flipped=flipped)
    surface = patch_surface(mesh, 0.05)
    skinned = surface.tessellate(0.005)
    assert max(hausdorff(skinned, mesh)) <= 0.06
    facing = mesh.face_vectors.sum(axis=0)[2]
    (low, high), (first, last) = surface.domain
    inside = np.random.default_rng(0).uniform(size=(40, 2))
    normals = surface.normals(low + (high - low) * inside[:, 0], first + (last - first) * inside[:, 1])
    assert (np.sign(facing) * normals[:, 2] > 0.3).all()
    assert surface.area == pytest.approx(mesh.area, rel=2e-3)


def test_the_corners_of_its_domain_are_the_corners_of_the_mesh():
    mesh = patch()
    surface = patch_surface(mesh, 0.05)
    s, t = (np.array(side) for side in surface.domain)
    corners = surface.positions(np.repeat(s, 2), np.tile(t, 2))
    wanted = np.array(
        [
            mesh.vertices[np.argmin(np.hypot(*(mesh.vertices[:, :2] - xy).T))]
            for xy in ((0, 0), (0, 30), (50, 0), (50, 30))
        ]
    )
    away = np.linalg.norm(corners[:, None] - wanted, axis=2).min(axis=1)
    assert away.max() < 0.02


def test_a_mesh_that_is_no_patch_is_refused():
    mesh = patch()
    middle = np.hypot(*(mesh.vertices[mesh.faces].mean(axis=1)[:, :2] - [25, 15]).T) < 4
    with pytest.raises(SurfaceError, match="has 2 edges: cut it open"):
        patch_surface(TriangleMesh(mesh.vertices, mesh.faces[~middle]), 0.05)
    corners = np.array([[0, 0, 0], [20, 0, 0], [0, 20, 0], [0, 0, 20.0]])
    with pytest.raises(SurfaceError, match="is closed"):
        patch_surface(
            TriangleMesh(corners, np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]], dtype=np.int32)), 0.05
        )


def test_a_mesh_too_rough_for_the_tolerance_is_refused_with_what_is_reached(monkeypatch):
    monkeypatch.setattr(skinning, "MOST", 2 * skinning.FEWEST)
    mesh = patch()
    rough = mesh.vertices + np.random.default_rng(1).normal(0, 0.4, mesh.vertices.shape)
    with pytest.raises(SurfaceError, match=r"misses it by .* mm: smooth the mesh, or raise surface.tolerance"):
        patch_surface(TriangleMesh(rough, mesh.faces), 0.01)


def test_rows_between_two_poles_are_skinned_to_a_closed_outward_surface(tmp_path):
    rows = read_rows(write_rows([SECTION_POLES[:1], *sections(), SECTION_POLES[1:]], tmp_path / "rows.csv"))
    assert rows.closed
    assert rows.poles is not None
    surface = rows.skin(0.02)
    assert surface.volume == pytest.approx(4 / 3 * np.pi * 4 * 3 * 9, rel=0.02)
    assert surface.project(np.vstack(rows.rows)).distances.max() < 0.02


@pytest.mark.parametrize("turned", [False, True])
def test_rows_that_run_the_wrong_way_or_start_anywhere_are_put_right(turned, tmp_path):
    straight = read_rows(write_rows([SECTION_POLES[:1], *sections(), SECTION_POLES[1:]], tmp_path / "straight.csv"))
    rng = np.random.default_rng(3)
    mixed = [np.roll(row, rng.integers(len(row)) if k else 0, axis=0) for k, row in enumerate(sections())]
    mixed = [np.roll(row[::-1], 1, axis=0) for row in mixed] if turned else mixed
    found = read_rows(write_rows([SECTION_POLES[:1], *mixed, SECTION_POLES[1:]], tmp_path / "mixed.csv"))
    for row, expected in zip(found.rows, straight.rows):
        np.testing.assert_allclose(row, expected, rtol=0, atol=1e-12)


def test_rows_that_end_where_they_began_are_closed_and_others_open(tmp_path):
    looped = read_rows(write_rows([np.vstack([row, row[:1]]) for row in sections()], tmp_path / "looped.txt"))
    assert looped.closed
    assert looped.poles is None
    assert [len(row) for row in looped.rows] == [len(row) for row in sections()]
    open_rows = read_rows(write_rows([row[:12] for row in sections()], tmp_path / "blade.txt"))
    assert not open_rows.closed
    assert np.diff(open_rows.skin(0.05).domain).tolist() == [[1.0], [1.0]]


def test_the_sections_of_the_measuring_data_are_open_rows(shared, tmp_path):
    files = [shared / "tspline" / "skinning_sections" / f"door{k}.txt" for k in range(1, 11)]
    (tmp_path / "door.txt").write_text("\n".join(file.read_text() for file in files))
    rows = read_rows(tmp_path / "door.txt")
    assert [len(row) for row in rows.rows[:2]] == [6, 5]
    assert not rows.closed


def test_a_file_holds_rows_or_one_cloud(tmp_path):
    assert holds_rows(write_rows(sections(), tmp_path / "rows.xyz"))
    assert not holds_rows(write_rows(sections()[:1], tmp_path / "cloud.xyz"))
    assert not holds_rows(tmp_path / "part.stl")


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("one.csv", "holds one block of 24 points: give two rows or more"),
        ("poles.csv", "has no row between its poles"),
        ("between.csv", "has one row only between its poles"),
        ("pole.csv", "has one pole only"),
        ("short.csv", "row 1 has 3 points"),
        ("twice.csv", "row 1: points 1 and the next coincide"),
    ],
)
def test_bad_rows_are_refused_in_one_line_that_names_the_row(name, reason, tmp_path):
    rows = sections()
    blocks = {
        "one.csv": rows[:1],
        "poles.csv": [SECTION_POLES[:1], SECTION_POLES[1:]],
        "between.csv": [SECTION_POLES[:1], rows[0], SECTION_POLES[1:]],
        "pole.csv": [SECTION_POLES[:1], *rows],
        "short.csv": [rows[0], rows[1][:3]],
        "twice.csv": [rows[0], rows[1][[0, 1, 1, 2, 3]]],
    }
    with pytest.raises(FileError, match=name) as caught:
        read_rows(write_rows(blocks[name], tmp_path / name))
    assert reason in str(caught.value)
    assert "\n" not in str(caught.value)


def wandering(count: int, closed: bool, seed: int = 3) -> np.ndarray:
    points = np.random.default_rng(seed).normal(size=(count, 3)).cumsum(axis=0) * 0.1
    return points - closed * np.linspace(0, 1, count)[:, None] * (points[-1] - points[0])


@pytest.mark.parametrize("closed", [True, False])
def test_reduction_keeps_its_bound_everywhere(closed):
    knots = np.arange(48) / 48 if closed else np.arange(1, 48) / 48
    points = wandering(48 if closed else 51, closed)
    kept, found = Reduction(knots, knots, closed).least_of_all([points], 0.2)[0]
    s = np.linspace(0, 1, 2000, endpoint=closed is False)
    assert len(found) < len(points)
    assert (
        np.linalg.norm(collocation(knots, s, closed) @ points - collocation(kept, s, closed) @ found, axis=1).max()
        < 0.2
    )
    if not closed:
        assert np.array_equal(found[[0, -1]], points[[0, -1]])


@pytest.mark.parametrize("closed", [True, False])
def test_a_curve_with_inserted_knots_gives_them_back(closed):
    few, many = (np.array([0.05, 0.2, 0.5, 0.6, 0.9]), np.array([0.05, 0.1, 0.2, 0.3, 0.5, 0.55, 0.6, 0.75, 0.9, 0.95]))
    points = np.random.default_rng(4).normal(size=(len(sites(few, closed)), 3))
    at = sites(many, closed)
    fine = interpolate(many, at, collocation(few, at, closed) @ points, closed)
    kept, found = Reduction(many, many, closed).least_of_all([fine], 1e-9)[0]
    assert np.array_equal(kept, few)
    assert np.allclose(found, points, atol=1e-8)


LONG, THICK, HIGH = 20.0, 3.0, 6.0


def blade_of(width: float) -> TSpline:
    """A blade of parabolic sections that ends at a blunt edge of this width, wound counter-clockwise."""
    u = np.linspace(-1.0, 1.0, 81)
    side = (width / 2 + (1 - u**2) * THICK / 2) * np.sign(u)
    section = np.column_stack([LONG * u**2, np.where(u == 0, 0.0, -side)])
    return skin(
        [np.column_stack([section, np.full(len(u), z)]) for z in np.linspace(0.0, HIGH, 3)], 0.001, closed=False
    )


@pytest.mark.parametrize("width", [0.3, 5.0])
def test_the_solid_of_an_open_skin_is_closed_between_its_edges(width):
    solid = blade_solid(blade_of(width), 0.01)
    assert not holes_of(solid)
    assert solid.volume == pytest.approx(HIGH * LONG * (width + THICK / 2), rel=0.03)


def test_a_surface_up_to_a_blunt_edge_is_told_from_one_side():
    assert has_blunt_edge(blade_of(0.3))
    assert not has_blunt_edge(blade_of(5.0))


def test_a_blade_whose_sections_run_the_wrong_way_round_is_refused():
    angle = np.linspace(0, -2 * np.pi, 24, endpoint=False)
    rows = [np.column_stack([np.cos(angle), np.sin(angle), np.full(24, z)]) for z in range(3)]
    with pytest.raises(SurfaceError, match="give sections that run once round it"):
        blade_solid(skin(rows, 0.01), 0.01)
