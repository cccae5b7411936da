"""The six public .tsm models beside the values of an independent T-spline library, kept as `.oracle.json` beside
each model: local knot vectors of all control points, and the surface with its derivatives up to the second at
samples of every face.

The diagnosis by a second method that shares no code with it: exact fractions, junctions from the half
edges of the file.

SUMS: the largest |sum B - 1| at the oracle's own samples (two a face), as published (samples unknown), and on
a dense set of places, where exact fractions at the worst one agree with it. MEETINGS: pairs that cross, and
that touch at an end of one; gearbox2-9 has 74 of both.
"""

import json
import math
from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from bonecam_plugins.tsplines import TMesh, diagnose, read_tsm
from exact_cubic import exact_cubic
from scipy.spatial import KDTree

from bonecam.surface import TSpline

MODELS = ("simple", "fan", "Bike", "mouse", "face", "gearbox2-9")


def model(shared: Path, name: str) -> tuple[TSpline[TMesh], dict]:
    folder = shared / "tspline" / "tsm"
    return read_tsm(folder / f"{name}.tsm"), json.loads((folder / f"{name}.oracle.json").read_text())


@pytest.mark.parametrize("name", MODELS)
def test_every_local_knot_vector_is_the_oracles(shared, name):
    surface, oracle = model(shared, name)
    u, v, p = (np.array([node[key] for node in oracle["nodes"]]) for key in "uvp")
    scale = [np.ptp(u)] * 5 + [np.ptp(v)] * 5 + [np.ptp(p)] * 3
    mine = np.column_stack([*surface.tmesh.local_knots, surface.control_points]) / scale
    distance, nearest = KDTree(mine).query(np.column_stack([u, v, p]) / scale)
    assert surface.tmesh.size == len(u) == len(np.unique(nearest))
    assert distance.max() <= 1e-12


@pytest.mark.parametrize("name", MODELS)
def test_the_surface_and_its_derivatives_are_the_oracles(shared, name):
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
            sum(math.comb(a, i) * math.comb(b, j) * A[a - i, b - j][3] * S[i, j][d] for i, j in rest) for d in range(3)
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


SUMS = {"mouse": (0.068, 0.068, 0.084), "face": (0.196, 0.31, 0.464), "gearbox2-9": (0.429, 0.45, 0.572)}
MEETINGS = {"simple": (0, 0), "fan": (0, 16), "Bike": (0, 0), "mouse": (0, 0), "face": (16, 0), "gearbox2-9": (50, 24)}


def exact_sum(nodes: list[dict], s: float, t: float) -> float:
    """The sum of all blending functions at a place, from the oracle's local knots."""
    return float(sum(exact_cubic(node["u"], Fraction(s)) * exact_cubic(node["v"], Fraction(t)) for node in nodes))


@pytest.mark.parametrize("name", SUMS)
def test_the_sums_go_as_far_off_as_the_diagnosis_says(shared, name):
    folder = shared / "tspline" / "tsm"
    surface, oracle = (read_tsm(folder / f"{name}.tsm"), json.loads((folder / f"{name}.oracle.json").read_text()))
    elements = surface.elements()
    x = (np.arange(16) + 0.5) / 16
    u, v = (a.ravel() for a in np.meshgrid(x, x))
    low, wide = elements.boxes[:, [0, 2]], elements.boxes[:, [1, 3]] - elements.boxes[:, [0, 2]]
    s, t = (low[:, [0]] + wide[:, [0]] * u).ravel(), (low[:, [1]] + wide[:, [1]] * v).ravel()
    unit = type(surface)(surface.tmesh, surface.control_points, np.ones(surface.tmesh.size))
    sums = sum_of(oracle["nodes"], s, t)
    worst = int(np.argmax(np.abs(sums - 1)))
    assert abs(exact_sum(oracle["nodes"], float(s[worst]), float(t[worst])) - sums[worst]) < 1e-12
    sampled, published, dense = SUMS[name]
    assert abs(sums[worst] - 1) == pytest.approx(dense, abs=2e-3)
    samples = np.array([sample[:2] for face in oracle["faces"] for sample in face["samples"]])
    assert np.abs(sum_of(oracle["nodes"], *samples.T) - 1).max() == pytest.approx(sampled, abs=5e-4)
    assert sampled <= published < dense
    assert diagnose(unit).sum_error == pytest.approx(dense, abs=1e-3)


def sum_of(nodes: list[dict], s: np.ndarray, t: np.ndarray) -> np.ndarray:
    """The sums in floating point, function by function on its own knots (scipy's B-splines)."""
    from scipy.interpolate import BSpline

    total = np.zeros(len(s))
    for node in nodes:
        parts = []
        for knots, x in ((node["u"], s), (node["v"], t)):
            padded = np.concatenate([[knots[0] - 1] * 3, knots, [knots[-1] + 1] * 3])
            one = np.zeros(len(padded) - 4)
            one[3] = 1.0
            parts.append(np.where((x >= knots[0]) & (x < knots[-1]), BSpline(padded, one, 3)(x), 0.0))
        total += parts[0] * parts[1]
    return total


@pytest.mark.parametrize("name", MEETINGS)
def test_extensions_meet_as_often_as_integer_segments_do(shared, name):
    """Extensions rebuilt from the diagnosis' junctions and the oracle's knots as integer ranks, met pair by
    pair in plain Python."""
    from bonecam_plugins.tsplines.diagnosis import junctions

    folder = shared / "tspline" / "tsm"
    surface, oracle = (read_tsm(folder / f"{name}.tsm"), json.loads((folder / f"{name}.oracle.json").read_text()))
    if any(surface.tmesh.period):
        pytest.skip("a closed direction has no integer ranks of its own")
    nodes = oracle["nodes"]
    grid = [sorted({round(k, 9) for node in nodes for k in node[key]}) for key in "uv"]
    rank = [{k: n for n, k in enumerate(values)} for values in grid]
    by_place = {}
    for node in nodes:
        u, v = ([rank[d][round(k, 9)] for k in node[key]] for d, key in enumerate("uv"))
        by_place[u[2], v[2], round(sum(node["p"]), 6)] = (u, v)
    segments: list[list[tuple[int, int, int]]] = [[], []]
    for vertex, direction in zip(*(part.tolist() for part in junctions(surface.tmesh))):
        own = [[rank[d][round(float(k), 9)] for k in surface.tmesh.local_knots[d][vertex]] for d in (0, 1)]
        u, v = by_place[own[0][2], own[1][2], round(float(surface.control_points[vertex].sum()), 6)]
        axis = direction % 2
        along, other = ((u, v), (v, u))[axis]
        segments[axis].append((other[2], *((along[1], along[4]) if direction < 2 else (along[0], along[3]))))
    crossing = touching = 0
    for y, a, b in segments[0]:
        for x, c, d in segments[1]:
            inner = a < x < b and c < y < d
            crossing += inner
            touching += (a <= x <= b and c <= y <= d) and not inner
    assert (crossing, touching) == MEETINGS[name]
