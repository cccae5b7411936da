"""General T-meshes: the .tsm models beside an independent library's values, their files, and broken ones."""

import json
import math
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from general import damaged, grid
from scipy.spatial import KDTree

from bonecam.errors import FileError, SurfaceError
from bonecam.surface.files.tsm_borders import with_mirrored_borders
from bonecam.surface.files.tsm_write import tsm_text
from bonecam.surface.files.tspline_text import read_tsm, write_tsm
from bonecam.surface.tmesh.general import TMesh
from bonecam.surface.tspline import TSpline

MODELS = ("simple", "fan", "Bike", "mouse", "face", "gearbox2-9")
ARRAYS = ("s_lines", "t_lines", "vertices", "along_s", "along_t", "inside")


def model(shared: Path, name: str) -> tuple[TSpline[TMesh], dict]:
    folder = shared / "tspline" / "tsm"
    return read_tsm(folder / f"{name}.tsm"), json.loads((folder / f"{name}.oracle.json").read_text())


@pytest.mark.parametrize("name", MODELS)
def test_every_local_knot_vector_is_the_oracles(shared: Path, name: str) -> None:
    surface, oracle = model(shared, name)
    u, v, p = (np.array([node[key] for node in oracle["nodes"]]) for key in "uvp")
    scale = [np.ptp(u)] * 5 + [np.ptp(v)] * 5 + [np.ptp(p)] * 3
    mine = np.column_stack([*surface.tmesh.local_knots, surface.control_points]) / scale
    distance, nearest = KDTree(mine).query(np.column_stack([u, v, p]) / scale)
    assert surface.tmesh.size == len(u) == len(np.unique(nearest))
    assert distance.max() <= 1e-12


@pytest.mark.parametrize("name", MODELS)
def test_the_surface_and_its_derivatives_are_the_oracles(shared: Path, name: str) -> None:
    """Within 1e-10 of each quantity's largest value; where the oracle is off (Bike: two samples of 162),
    exact fractions agree with us."""
    surface, oracle = model(shared, name)
    samples = np.array([sample for face in oracle["faces"] for sample in face["samples"]])
    found = surface.evaluate(samples[:, 0], samples[:, 1], 2)
    expected = np.split(samples[:, 2:20], 6, axis=1)
    scale = [np.abs(one).max() for one in expected]
    off = np.flatnonzero(
        np.max([np.abs(f - e).max(axis=1) / x for f, e, x in zip(found, expected, scale)], axis=0) > 1e-10
    )
    assert len(off) == (2 if name == "Bike" else 0)
    for n in off:
        for f, exact, x in zip(found, exact_derivatives(oracle["nodes"], *samples[n, :2]), scale):
            assert np.abs(f[n] - exact).max() < 1e-12 * x


def exact_cubic(knots: list[float], x: Fraction) -> Fraction:
    k = [Fraction(value) for value in knots]
    values = [Fraction(int(a <= x < b)) for a, b in pairwise(k)]
    for p in (1, 2, 3):
        values = [
            (values[i] * (x - k[i]) / (k[i + p] - k[i]) if k[i + p] > k[i] else 0)
            + (
                values[i + 1] * (k[i + p + 1] - x) / (k[i + p + 1] - k[i + 1])
                if k[i + p + 1] > k[i + 1]
                else 0
            )
            for i in range(len(values) - 1)
        ]
    return values[0]


@pytest.mark.parametrize("homogeneous", [False, True])
@pytest.mark.parametrize("name", MODELS)
def test_a_tsm_round_trip_is_bit_equal(shared: Path, tmp_path: Path, name: str, homogeneous: bool) -> None:
    first = read_tsm(shared / "tspline" / "tsm" / f"{name}.tsm", homogeneous=homogeneous)
    write_tsm(first, tmp_path / "a.tsm", homogeneous=homogeneous)
    again = read_tsm(tmp_path / "a.tsm", homogeneous=homogeneous)
    for key in ARRAYS:
        np.testing.assert_array_equal(getattr(again.tmesh, key), getattr(first.tmesh, key))
    assert again.control_points.tobytes() == first.control_points.tobytes()
    assert again.weights.tobytes() == first.weights.tobytes()
    write_tsm(again, tmp_path / "b.tsm", homogeneous=homogeneous)
    assert (tmp_path / "a.tsm").read_bytes() == (tmp_path / "b.tsm").read_bytes()


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        ("#TS0200", "#TS9900", "first line"),
        ("l 11 14 1 0 0 0 0", "l 11 14 1 0 0 0", "line 29"),
        ("l 11 14 1 0 0 0 0", "l 11 14 99 0 0 0 0", "l 0: link 99 does not exist"),
        ("l 11 14 1 0 0 0 0", "l 12 14 1 0 0 0 0", "l 0: previous link"),
        ("l 11 14 1 0 0 0 0", "l 11 14 1 0 0 0 1", "direction contradicts|corners"),
        ("e 2 0.5", "e 2 -0.5", "negative: knots must not decrease"),
        ("e 2 0.5", "e 2 0.7", "do not add up"),
        ("e 2 0.5", "e 2 nan", "finite"),
        ("0g 15 0 0 1", "0g 15 0 0 0", "0g 2: weight 0"),
        ("0g 15 0 0 1", "0g 15 0 0", "expected 4 finite numbers"),
        ("0m gvp 3\n", "", "cg|no control point"),
        ("0m cg 1 4 1 0 0 0 7", "0m cg 1 4 1 0 0 0 8", "cg 1: control point 8"),
        ("0m cg 1 4 1 0 0 0 7", "0m cg 1 4 1 1 0 0 7", "cg 1: extents"),
        ("v 2 EAST", "v 2 UP", "EAST, NORTH"),
        ("degree 3", "degree 4", "degree '4'"),
        ("degree 3", "degree", "degree ''"),
    ],
)
def test_a_broken_tsm_names_the_record(shared: Path, tmp_path: Path, old: str, new: str, match: str) -> None:
    with pytest.raises(FileError, match=match):
        read_tsm(damaged(shared / "tspline" / "tsm" / "simple.tsm", tmp_path, old, new))


def torus_text(n: int = 5, m: int = 6, units: str = "1 meters") -> str:
    """A closed torus the way Fusion writes it: no 0m records, one 0g a vertex."""
    v = lambda i, j: (i % n) + n * (j % m)  # noqa: E731
    link = lambda i, j, k: 4 * v(i, j) + k  # noqa: E731  k: side of face (i, j): bottom, right, top, left
    lines = [
        "#TS0200",
        "",
        "degree 3",
        "cap-type G1CAPS",
        f"units {units}",
        "end-conditions SUBD_CREASES",
        "star-knot-rule NURCCS",
    ]
    lines += [f"f {link(i, j, 0)} 0" for j in range(m) for i in range(n)]
    horizontal, vertical = (lambda i, j: v(i, j)), (lambda i, j: n * m + v(i, j))
    lines += [f"e {link(i, j, 0)} 1" for j in range(m) for i in range(n)] + [
        f"e {link(i, j, 3)} 1" for j in range(m) for i in range(n)
    ]
    lines += [f"v {link(i, j, 0)} EAST" for j in range(m) for i in range(n)]
    for j in range(m):
        for i in range(n):
            f = v(i, j)
            corners = (v(i, j), v(i + 1, j), v(i + 1, j + 1), v(i, j + 1))
            opposite = (link(i, j - 1, 2), link(i + 1, j, 3), link(i, j + 1, 0), link(i - 1, j, 1))
            edges = (horizontal(i, j), vertical(i + 1, j), horizontal(i, j + 1), vertical(i, j))
            for k in range(4):
                lines.append(
                    f"l {4 * f + (k - 1) % 4} {4 * f + (k + 1) % 4} {opposite[k]} {corners[k]} {f} {edges[k]} 0"
                )
    a, b = 2 * np.pi * np.arange(n) / n, 2 * np.pi * np.arange(m) / m
    for y in b:
        for x in a:
            r = 0.03 + 0.01 * np.cos(y)
            lines.append(f"0g {r * np.cos(x):.17g} {r * np.sin(x):.17g} {0.01 * np.sin(y):.17g} 1")
    return "\n".join([*lines, "tol 1e-05", "behavior-version 14.2.0", ""])


def test_a_fusion_torus_is_closed_both_ways(tmp_path: Path) -> None:
    (tmp_path / "torus.tsm").write_text(torus_text())
    surface = read_tsm(tmp_path / "torus.tsm", to_mm=True)
    assert surface.tmesh.period == (5.0, 6.0)
    s, t = np.random.default_rng(1).uniform(-6, 12, (2, 300))
    np.testing.assert_allclose(surface.evaluate(s, t), surface.evaluate(s + 5, t - 6), atol=1e-12)
    np.testing.assert_allclose(surface.basis(s, t)[0].sum(axis=1), 1, atol=1e-14)
    assert 0.3 < surface.volume / (2 * np.pi**2 * 30 * 100) < 1
    write_tsm(surface, tmp_path / "again.tsm")
    again = read_tsm(tmp_path / "again.tsm")
    assert again.control_points.tobytes() == surface.control_points.tobytes()
    assert again.tmesh.period == surface.tmesh.period


def test_a_closed_direction_of_three_knots_is_refused(tmp_path: Path) -> None:
    (tmp_path / "thin.tsm").write_text(torus_text(3, 6))
    with pytest.raises(FileError, match="3 distinct knots"):
        read_tsm(tmp_path / "thin.tsm")
    (tmp_path / "odd.tsm").write_text(torus_text(units="1 cubits"))
    with pytest.raises(FileError, match="cubits"):
        read_tsm(tmp_path / "odd.tsm", to_mm=True)


def test_a_border_without_its_control_points_is_refused(shared: Path, tmp_path: Path) -> None:
    lines = (shared / "tspline" / "tsm" / "simple.tsm").read_text().splitlines()
    grips = [line for line in lines if line.startswith("0g ")]
    plain = [line for line in lines if not line.startswith(("0m", "0g", "ec"))]
    (tmp_path / "open.tsm").write_text("\n".join([*plain, *grips[:8], ""]))
    with pytest.raises(FileError, match="all functions vanish"):
        read_tsm(tmp_path / "open.tsm")
    (tmp_path / "short.tsm").write_text("\n".join([*plain, *grips[:7], ""]))
    with pytest.raises(FileError, match="8 vertices need as many control points"):
        read_tsm(tmp_path / "short.tsm")


def fusion_patch(points: np.ndarray, ends: str = "SUBD_CREASES") -> str:
    """An open grid of control points (a, b, 3) the way Fusion writes it: no 0m records, one 0g a vertex."""
    a, b = points.shape[:2]
    text = tsm_text(
        TSpline(grid(np.arange(float(a)), np.arange(float(b))), points.reshape(-1, 3), np.ones(a * b))
    )
    lines = [line for line in text.splitlines() if not line.startswith(("0m", "force-bezier"))]
    return "\n".join([*lines[:2], f"end-conditions {ends}", "star-knot-rule NURCCS", *lines[2:], ""])


def subdivided(points: np.ndarray) -> np.ndarray:
    """One round of Catmull-Clark along the first axis of a grid whose border is a crease: ends stay."""
    found = np.empty((2 * len(points) - 1, *points.shape[1:]))
    found[1::2] = (points[1:] + points[:-1]) / 2
    found[2:-1:2] = (points[2:] + 6 * points[1:-1] + points[:-2]) / 8
    found[[0, -1]] = points[[0, -1]]
    return found


def limit(points: np.ndarray) -> np.ndarray:
    """Where the vertices of a subdivided grid end, along its first axis."""
    return np.concatenate([points[:1], (points[2:] + 4 * points[1:-1] + points[:-2]) / 6, points[-1:]])


@pytest.mark.parametrize("shape", [(5, 4), (3, 6), (2, 2)])
def test_an_open_fusion_border_is_that_of_the_subdivision_surface(
    tmp_path: Path, shape: tuple[int, int]
) -> None:
    points = np.random.default_rng(3).normal(size=(*shape, 3))
    (tmp_path / "open.tsm").write_text(fusion_patch(points))
    surface = read_tsm(tmp_path / "open.tsm")
    assert np.array_equal(surface.control_points[: points.size // 3], points.reshape(-1, 3))
    finer = subdivided(subdivided(points).swapaxes(0, 1)).swapaxes(0, 1)
    expected = limit(limit(finer).swapaxes(0, 1)).swapaxes(0, 1)
    s, t = np.meshgrid(np.arange(2 * shape[0] - 1) / 2, np.arange(2 * shape[1] - 1) / 2, indexing="ij")
    np.testing.assert_allclose(surface.evaluate(s.ravel(), t.ravel()), expected.reshape(-1, 3), atol=1e-13)
    assert np.array_equal(surface.domain, [[0, shape[0] - 1], [0, shape[1] - 1]])
    assert surface.diagnose().standard
    assert len(surface.tessellate(0.05).faces)


def test_other_open_fusion_borders_are_refused(tmp_path: Path) -> None:
    points = np.random.default_rng(3).normal(size=(5, 4, 3))
    (tmp_path / "open.tsm").write_text(fusion_patch(points, "MULTIPLE_KNOTS"))
    with pytest.raises(FileError, match="all functions vanish"):
        read_tsm(tmp_path / "open.tsm")
    mesh = grid(np.arange(5.0), np.arange(4.0))
    homogeneous = np.column_stack([points.reshape(-1, 3), np.ones(20)])
    cut = mesh.along_t.copy()
    cut[1, 0] = False
    kept = (mesh.vertices != [1, 0]).any(axis=1)
    for changed, values, match in (
        ({"along_t": cut, "vertices": mesh.vertices[kept]}, homogeneous[kept], "a line ends beside"),
        ({"inside": np.pad(np.ones((3, 3), dtype=bool), ((0, 1), (0, 0)))}, homogeneous, "no rectangle"),
        ({}, homogeneous * np.where(mesh.vertices[:, :1] == 1, [[1, 1, 1, 3]], 1), "fall to -1"),
    ):
        with pytest.raises(SurfaceError, match=match):
            with_mirrored_borders(replace(mesh, **changed), values)


def test_wrong_grids_are_refused() -> None:
    lines = np.array([0.0, 0, 1, 2, 2])
    mesh = grid(lines, lines)
    parts = [mesh.s_lines, mesh.t_lines, mesh.vertices, mesh.along_s, mesh.along_t, mesh.inside]
    for k, value, match in (
        (0, np.array([0.0, 0, 1, 0.5, 2]), "s-line 3 is less"),
        (1, np.array([0.0, 0, 1, 1 + 1e-15, 2]), "differ by rounding only"),
        (2, np.vstack([mesh.vertices[:-1], [[0, 0]]]), "crossing of its own"),
        (2, np.vstack([mesh.vertices[:-1], [[0, 9]]]), "crossing of its own"),
        (4, np.where(np.indices((5, 4))[0] == 2, np.indices((5, 4))[1] < 2, mesh.along_t), "not a rectangle"),
        (5, np.zeros((4, 4), dtype=bool), "no face"),
    ):
        changed = [*parts]
        changed[k] = value
        if k == 4:
            changed[3] = np.where(np.indices((4, 5))[1] == 2, np.indices((4, 5))[0] < 2, mesh.along_s)
        with pytest.raises(SurfaceError, match=match):
            TMesh(*changed)
    with pytest.raises(SurfaceError, match="all functions vanish"):
        _ = grid(np.arange(6.0), lines).elements
    with pytest.raises(SurfaceError, match="3 distinct knots"):
        grid(np.arange(3.0), lines, (3.0, 0.0))
    with pytest.raises(SurfaceError, match="period"):
        grid(np.arange(5.0), lines, (4.0, 0.0))


def exact_derivatives(nodes: list[dict], s: float, t: float) -> list[np.ndarray]:
    """S, S_s, S_t, S_ss, S_st, S_tt of the rational surface in fractions, by the quotient rule."""
    s, t = Fraction(s), Fraction(t)
    orders = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
    A = {}
    for order in orders:
        A[order] = [Fraction(0)] * 4
        for node in nodes:
            value = (
                Fraction(node["w"])
                * exact_derivative(node["u"], s, order[0])
                * exact_derivative(node["v"], t, order[1])
            )
            A[order] = [a + value * x for a, x in zip(A[order], [*map(Fraction, node["p"]), 1])]
    S: dict[tuple[int, int], list[Fraction]] = {}
    for a, b in orders:
        rest = [(i, j) for i in range(a + 1) for j in range(b + 1) if (i, j) != (a, b)]
        lower = [
            sum(math.comb(a, i) * math.comb(b, j) * A[a - i, b - j][3] * S[i, j][d] for i, j in rest)
            for d in range(3)
        ]
        S[a, b] = [(A[a, b][d] - lower[d]) / A[0, 0][3] for d in range(3)]
    return [np.array([float(x) for x in S[order]]) for order in orders]


def exact_derivative(knots: list[float], x: Fraction, order: int) -> Fraction:
    """The order-th derivative of the cubic on five knots, from its pieces: exact differences of a polynomial
    of degree three."""
    k = [Fraction(value) for value in knots]
    if not k[0] <= x < k[-1]:
        return Fraction(0)
    low, high = next((a, b) for a, b in pairwise(k) if a <= x < b)
    places = [low + (high - low) * Fraction(i, 5) for i in range(4)]
    values = [exact_cubic(knots, place) for place in places]
    coefficients = [Fraction(0)] * 4  # of the polynomial through four values, in powers of (y - x)
    for i, value in enumerate(values):
        product = [Fraction(1)]
        for j, place in enumerate(places):
            if j != i:
                product = [
                    (product[m - 1] if m else 0) - (place - x) * (product[m] if m < len(product) else 0)
                    for m in range(len(product) + 1)
                ]
                product = [c / (places[i] - place) for c in product]
        coefficients = [c + value * p for c, p in zip(coefficients, product)]
    return coefficients[order] * math.factorial(order)
