"""The triangulation's counts and empty circles, on scattered points, grids and lines, and against scipy's."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy import ndarray
from scipy.spatial import Delaunay

from bonecam.mesh.facets import delaunay

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
def test_counts_and_circles_hold(name: str) -> None:
    require_delaunay(CASES[name], delaunay(CASES[name]))


def test_scattered_points_give_scipys_triangles() -> None:
    ours = {tuple(sorted(face)) for face in delaunay(SCATTERED).tolist()}
    theirs = {tuple(sorted(face)) for face in Delaunay(SCATTERED).simplices.tolist()}
    assert ours == theirs


def test_a_row_between_two_rows_loses_no_facet_on_the_straight_hull() -> None:
    row = np.column_stack([np.linspace(0, 1, 40), np.zeros(40)])
    bowed = np.column_stack([row[:, 0], 1e-13 * np.sin(9 * row[:, 0]) + 0.01])
    points = np.vstack([row, bowed, row + np.array([0, 0.02])])
    require_delaunay(points, delaunay(points))


@settings(max_examples=60)
@given(st.sets(st.tuples(st.integers(0, 6), st.integers(0, 6)), min_size=4, max_size=30))
def test_any_points_of_a_lattice(lattice: set[tuple[int, int]]) -> None:
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
def test_bad_points_are_refused(points: ndarray, match: str) -> None:
    with pytest.raises(ValueError, match=match):
        delaunay(points)
