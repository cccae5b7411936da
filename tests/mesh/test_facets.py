"""The triangulation's counts and empty circles, on scattered points, grids and lines, and against scipy's.

Curvature by moving least squares against a torus, whose curvatures are known, and on plain shapes.

Eq. 22 on facets against its closed forms.

Voronoi cells on faces: closed forms, and that they share the area out.
"""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy import ndarray

from bonecam.errors import MeshError
from bonecam.mesh import SurfaceShape, TriangleMesh, delaunay, mls_curvature, vertex_normals
from bonecam.mesh.facets import voronoi_areas

SCATTERED = np.random.default_rng(1).random((300, 2))
GRID = np.stack(np.meshgrid(np.arange(12) * 0.1, np.arange(7) * 0.3), axis=-1).reshape(-1, 2)
ANGLE = np.arange(24) * np.pi / 12
RINGS = np.vstack([r * np.column_stack([np.cos(ANGLE), np.sin(ANGLE)]) for r in (1.0, 2.0)] + [[[0.0, 0.0]]])
CASES = {"scattered": SCATTERED, "grid": GRID, "rings": RINGS, "moved by 1e9": GRID + 1e9}


def exact(points: ndarray) -> list[tuple[Fraction, Fraction]]:
    return [(Fraction(x), Fraction(y)) for x, y in points.tolist()]


def turn(a: tuple, b: tuple, c: tuple) -> Fraction:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def hull_count(points: ndarray) -> int:
    """Points on the hull, those between its corners included, by exact fractions."""
    rows = sorted(exact(points))

    def chain(ordered: list) -> list:
        kept: list = []
        for p in ordered:
            while len(kept) > 1 and turn(kept[-2], kept[-1], p) < 0:
                kept.pop()
            kept.append(p)
        return kept

    return len(set(chain(rows)) | set(chain(rows[::-1])))


def circle_holds(a: tuple, b: tuple, c: tuple, p: tuple) -> bool:
    rows = [(q[0] - p[0], q[1] - p[1], (q[0] - p[0]) ** 2 + (q[1] - p[1]) ** 2) for q in (a, b, c)]
    (a0, a1, a2), (b0, b1, b2), (c0, c1, c2) = rows
    return a0 * (b1 * c2 - b2 * c1) - a1 * (b0 * c2 - b2 * c0) + a2 * (b0 * c1 - b1 * c0) > 0


def require_delaunay(points: ndarray, faces: ndarray) -> None:
    """Counts, orientation, and that no circle holds the far corner of a neighbour, which is enough for all."""
    n, k, at = len(points), hull_count(points), exact(points)
    assert len(faces) == 2 * n - 2 - k
    edges = {(f[i], f[(i + 1) % 3]): f[(i + 2) % 3] for f in faces.tolist() for i in range(3)}
    assert len({tuple(sorted(edge)) for edge in edges}) == 3 * n - 3 - k
    assert len(edges) == 3 * len(faces)
    assert set(faces.ravel().tolist()) == set(range(n))
    assert all(turn(at[a], at[b], at[c]) > 0 for a, b, c in faces.tolist())
    for (a, b), c in edges.items():
        beyond = edges.get((b, a))
        if beyond is not None:
            assert not circle_holds(at[a], at[b], at[c], at[beyond])


@pytest.mark.parametrize("name", CASES)
def test_counts_and_circles_hold(name):
    require_delaunay(CASES[name], delaunay(CASES[name]))


def test_a_row_between_two_rows_loses_no_facet_on_the_straight_hull():
    row = np.column_stack([np.linspace(0, 1, 40), np.zeros(40)])
    bowed = np.column_stack([row[:, 0], 1e-13 * np.sin(9 * row[:, 0]) + 0.01])
    points = np.vstack([row, bowed, row + np.array([0, 0.02])])
    require_delaunay(points, delaunay(points))


@settings(max_examples=60)
@given(st.sets(st.tuples(st.integers(0, 6), st.integers(0, 6)), min_size=4, max_size=30))
def test_any_points_of_a_lattice(lattice):
    points = np.array(sorted(lattice)) * 0.1
    at = exact(points)
    if all(turn(at[0], at[1], p) == 0 for p in at):
        with pytest.raises(ValueError, match="lie on a line"):
            delaunay(points)
    else:
        require_delaunay(points, delaunay(points))


@pytest.mark.parametrize(
    ("points", "match"),
    [
        (np.zeros((2, 2)), "2 points span no triangle"),
        (np.array([[0.0, 0], [1, np.nan], [0, 1]]), "point 1 is not finite"),
        (np.array([[0.0, 0], [1, 0], [0, 1], [1, 0]]), "points 1 and 3 are equal"),
        (np.column_stack([np.arange(5.0), np.arange(5.0)]), "all 5 points lie on a line"),
    ],
)
def test_bad_points_are_refused(points, match):
    with pytest.raises(ValueError, match=match):
        delaunay(points)


RING, TUBE = 20.0, 6.0


def torus(around: int, across: int) -> tuple[TriangleMesh, ndarray, ndarray]:
    """The mesh, and at its vertices the angle round the tube and the exact normals."""
    u, v = (
        grid.ravel()
        for grid in np.meshgrid(
            np.arange(around) * 2 * np.pi / around, np.arange(across) * 2 * np.pi / across, indexing="ij"
        )
    )
    radial = np.column_stack([np.cos(u), np.sin(u), 0 * u])
    normals = np.cos(v)[:, None] * radial + np.sin(v)[:, None] * [0, 0, 1]
    index = np.arange(around * across).reshape(around, across)
    a, b = index, np.roll(index, -1, axis=0)
    c, d = np.roll(b, -1, axis=1), np.roll(a, -1, axis=1)
    quads = np.stack([a, b, c, d], axis=-1).reshape(-1, 4)
    faces = np.vstack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.int32)
    return TriangleMesh(RING * radial + TUBE * normals, faces), v, normals


def errors(around: int, across: int) -> tuple[float, float]:
    """Median errors of k1 and k2 as shares."""
    mesh, v, _ = torus(around, across)
    found = mls_curvature(mesh)
    along = np.cos(v) / (RING + TUBE * np.cos(v))
    clear = np.abs(np.cos(v)) > 0.2
    return (float(np.median(np.abs(found.k1 * TUBE - 1))), float(np.median(np.abs(found.k2 / along - 1)[clear])))


def test_errors_on_a_torus_fall_with_the_square_of_the_edge():
    coarse, fine = errors(60, 30), errors(120, 60)
    assert max(fine) < 0.012
    for large, small in zip(coarse, fine):
        assert 3.2 < large / small < 4.8


def test_shapes_on_a_torus_are_convex_outside_and_saddles_inside():
    mesh, v, normals = torus(120, 60)
    found = mls_curvature(mesh)
    assert set(found.shapes[np.cos(v) > 0.4]) == {SurfaceShape.CONVEX}
    assert set(found.shapes[np.cos(v) < -0.4]) == {SurfaceShape.SADDLE}
    assert set(found.shapes[np.abs(np.cos(v)) < 1e-9]) == {SurfaceShape.PARABOLIC}
    assert np.abs(np.einsum("ij,ij->i", found.direction1, normals)).max() < 0.02


def test_a_ball_is_convex_and_turned_inside_out_concave():
    mesh, _, _ = torus(60, 30)
    inside_out = TriangleMesh(mesh.vertices, mesh.faces[:, ::-1].copy())
    outer = mls_curvature(mesh)
    inner = mls_curvature(inside_out)
    np.testing.assert_allclose(inner.k2, -outer.k1, rtol=1e-9)
    assert (inner.k1 >= inner.k2).all()


def test_a_plane_is_planar_everywhere():
    places = np.random.default_rng(3).random((60, 2)) * 10
    mesh = TriangleMesh(np.column_stack([places, np.zeros(60)]), delaunay(places))
    found = mls_curvature(mesh, radius=4.0)
    assert np.abs(found.k1).max() < 1e-12
    assert set(found.shapes) == {SurfaceShape.PLANAR}


def test_a_patch_on_a_tilted_frame_needs_both_fundamental_forms():
    """z = x^2/20 - y^2/12 + 0.3 x: its Hessian alone, in its upright frame, errs; ours agrees with the formula."""
    x, y = (grid.ravel() for grid in np.meshgrid(np.linspace(-1, 1, 21), np.linspace(-1, 1, 21)))
    places = np.column_stack([x, y])
    mesh = TriangleMesh(np.column_stack([places, x**2 / 20 - y**2 / 12 + 0.3 * x]), delaunay(places))
    middle = int(np.argmin(x**2 + y**2))
    found = mls_curvature(mesh, radius=0.35)
    slope = 1 + 0.3**2
    exact = (1 / 6 / slope**0.5, -1 / 10 / slope**1.5)
    np.testing.assert_allclose((found.k1[middle], found.k2[middle]), exact, rtol=2e-3)
    assert abs(-2 / 20 - exact[1]) > 0.01  # what the Hessian alone would say


def test_the_other_side_of_a_thin_plate_does_not_count():
    grid = np.stack(np.meshgrid(np.arange(12.0), np.arange(12.0)), axis=-1).reshape(-1, 2)
    faces = delaunay(grid)
    below = np.column_stack([grid, np.full(len(grid), -0.5)])
    above = np.column_stack([grid, np.zeros(len(grid))])
    plate = TriangleMesh(np.vstack([above, below]), np.vstack([faces, faces[:, ::-1] + len(grid)]).astype(np.int32))
    found = mls_curvature(plate, radius=2.5)
    assert np.abs([found.k1, found.k2]).max() < 1e-12


def test_too_few_neighbours_are_told():
    mesh, _, _ = torus(12, 6)
    with pytest.raises(MeshError, match=r"vertex 0 has 0 neighbours, too few .* larger radius"):
        mls_curvature(mesh, radius=0.1)
    with pytest.raises(ValueError, match="above 0"):
        mls_curvature(mesh, radius=0.0)


def test_neighbours_on_a_line_or_at_one_place_are_told():
    """A strip of two rows 1 mm apart; and eight copies of it."""
    x, y = (grid.ravel() for grid in np.meshgrid(np.linspace(0, 1, 12), [0.0, 1.0], indexing="ij"))
    strip = TriangleMesh(np.column_stack([x, y, 0 * x]), delaunay(np.column_stack([x, y])))
    with pytest.raises(MeshError, match="neighbours of vertex 0 lie on a line"):
        mls_curvature(strip, radius=0.9)
    copies = 24 * np.arange(8)[:, None, None]
    faces = (strip.faces + copies).reshape(-1, 3).astype(np.int32)
    again = TriangleMesh(np.tile(strip.vertices, (8, 1)), faces)
    with pytest.raises(MeshError, match="merge equal vertices"):
        mls_curvature(again, radius=0.05)


def test_normals_of_a_torus():
    mesh, _, normals = torus(120, 60)
    cosines = np.einsum("ij,ij->i", vertex_normals(mesh), normals)
    assert np.degrees(np.arccos(np.clip(cosines, -1, 1))).max() < 0.2


def test_a_vertex_without_faces_has_no_normal():
    mesh = TriangleMesh(np.eye(4)[:, :3], np.array([[0, 1, 2]], dtype=np.int32))
    with pytest.raises(MeshError, match="vertex 3 has no normal"):
        vertex_normals(mesh)


def flat(places: np.ndarray, faces: np.ndarray) -> TriangleMesh:
    return TriangleMesh(np.column_stack([places, np.zeros(len(places))]), faces)


def test_a_point_has_the_places_nearer_to_it_than_to_any_other():
    """Eq. 10, by counting random places of the hull, away from its obtuse triangles."""
    random = np.random.default_rng(3)
    grid = np.stack(np.meshgrid(np.arange(9.0), np.arange(9.0)), axis=-1).reshape(-1, 2)
    places = grid + random.uniform(-0.15, 0.15, grid.shape)
    areas = voronoi_areas(flat(places, delaunay(places)))
    inner = np.flatnonzero(((grid > 1) & (grid < 7)).all(axis=1))
    asked = random.uniform(-1, 9, (400_000, 2))
    nearest = np.argmin([((asked - place) ** 2).sum(axis=1) for place in places], axis=0)
    counted = np.bincount(nearest, minlength=len(places)) * 100 / len(asked)
    np.testing.assert_allclose(areas[inner], counted[inner], rtol=0.06)


def test_of_an_obtuse_face_its_widest_corner_has_half():
    mesh = flat(np.array([[0.0, 0.0], [4.0, 0.0], [2.0, 0.5]]), np.array([[0, 1, 2]], dtype=np.int32))
    np.testing.assert_allclose(voronoi_areas(mesh), [0.25, 0.25, 0.5])


def test_cells_add_up_to_the_area_and_lone_vertices_have_none():
    places = np.random.default_rng(7).random((200, 2))
    mesh = flat(np.vstack([places, [[5.0, 5.0]]]), delaunay(places))
    areas = voronoi_areas(mesh)
    assert areas[-1] == 0
    assert areas[:-1].min() > 0
    assert abs(areas.sum() - mesh.area) < 1e-12
