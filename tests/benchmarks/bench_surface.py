"""Speed of the T-spline kernel beside splinepy's NURBS and scipy's NdBSpline: `PYTHONPATH=tests/checking python
tests/benchmarks/bench_surface.py`.

The surface is a closed rational tube with two poles, 19 rows of 15 control points; evaluated are S, S_s and
S_t at 100,000 random parameters, all in float64. The libraries get the surface as one rational tensor-product
B-spline of as many rows, unrolled over its seam (they have no periodic or per-row knots), and are first
compared with it. Times are CPU seconds, best of five (splinepy: of two). Needs the extra `bench`. One core:
CPU seconds count every thread, and splinepy is asked for one.
"""

import time
from collections.abc import Callable
from itertools import pairwise

import numpy as np
from rows_to_general import as_general
from scipy.interpolate import NdBSpline

from bonecam.surface import RowTMesh, TSpline

ROWS, AROUND, SAMPLES, POINTS = 19, 15, 100_000, 5_000
AIM = {"evaluate": 10e6, "splinepy": 20.0, "csr": 0.2, "project": 50_000.0}


def best(call: Callable[[], object], repeats: int = 5) -> float:
    """Least CPU seconds of a call; the first, which may compile, does not count."""
    call()
    times = []
    for _ in range(repeats):
        start = time.process_time()
        call()
        times.append(time.process_time() - start)
    return min(times)


def bone_like() -> TSpline[RowTMesh]:
    """A closed tube of 28 mm along z with its own random knots in every row and a pole at either end."""
    rng = np.random.default_rng(0)
    t = np.concatenate([[0.0] * 4, np.linspace(0, 1, ROWS - 2)[1:-1], [1.0] * 4])
    height = 28.0 * np.array([t[j + 1 : j + 4].mean() for j in range(ROWS)])
    height[1], height[-2] = height[0], height[-1]
    knots = [np.zeros(1)]
    points = [np.array([[0.0, 0.0, height[0]]])]
    for j in range(1, ROWS - 1):
        row = (np.arange(AROUND) + 0.6 * rng.random(AROUND)) / AROUND
        angle = 2 * np.pi * row
        radius = 5.0 * np.sin(np.pi * (0.1 + 0.8 * j / (ROWS - 1))) * (1 + 0.12 * np.cos(3 * angle))
        knots.append(row)
        points.append(np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.full(AROUND, height[j])]))
    knots.append(np.zeros(1))
    points.append(np.array([[0.0, 0.0, height[-1]]]))
    control = np.vstack(points)
    return TSpline(RowTMesh.from_rows(t, knots), control, rng.uniform(0.8, 1.2, len(control)))


def tube() -> TSpline[RowTMesh]:
    """The surface with equal even knots in every row, so that a tensor product can hold it."""
    spread = bone_like()
    knots = [row if len(row) == 1 else np.arange(AROUND) / AROUND for row in spread.tmesh.s_knots]
    return TSpline(RowTMesh.from_rows(spread.tmesh.t_knots, knots), spread.control_points, spread.weights)


def as_tensor(surface: TSpline[RowTMesh]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Homogeneous points (rows, around + 3, 4) and both flat knot vectors; s unrolled: S at [0, 1] needs
    three points more."""
    starts = surface.tmesh.row_starts
    homogeneous = np.column_stack([surface.control_points * surface.weights[:, None], surface.weights])
    rows = [homogeneous[a:b] if b - a > 1 else np.repeat(homogeneous[a:b], AROUND, axis=0) for a, b in pairwise(starts)]
    unrolled = np.array([row[np.arange(-1, AROUND + 2) % AROUND] for row in rows])
    return unrolled, np.arange(-3, AROUND + 4) / AROUND, surface.tmesh.t_knots


def splinepy_rate(surface: TSpline[RowTMesh], s: np.ndarray, t: np.ndarray) -> tuple[float, float]:
    """Points per CPU second of splinepy's NURBS, and how far its S is from ours."""
    import splinepy

    points, s_knots, t_knots = as_tensor(surface)
    weights = points[:, :, 3].reshape(-1, 1)
    control = (points[:, :, :3] / points[:, :, 3:]).reshape(-1, 3)
    nurbs = splinepy.NURBS(degrees=[3, 3], knot_vectors=[s_knots, t_knots], control_points=control, weights=weights)
    at = np.column_stack([s, t])

    def run() -> np.ndarray:
        nurbs.derivative(at, [1, 0], nthreads=1)
        nurbs.derivative(at, [0, 1], nthreads=1)
        found: np.ndarray = nurbs.evaluate(at, nthreads=1)
        return found

    return len(s) / best(run, 2), float(np.abs(run() - surface.evaluate(s, t)).max())


def scipy_rate(surface: TSpline[RowTMesh], s: np.ndarray, t: np.ndarray) -> tuple[float, float]:
    """The same of scipy's NdBSpline on homogeneous points, divided by the rational rule."""
    points, s_knots, t_knots = as_tensor(surface)
    spline = NdBSpline((t_knots, s_knots), points, 3)
    at = np.column_stack([t, s])

    def run() -> np.ndarray:
        A, As, At = spline(at), spline(at, nu=(0, 1)), spline(at, nu=(1, 0))
        S: np.ndarray = A[:, :3] / A[:, 3:]
        _ = (As[:, :3] - As[:, 3:] * S) / A[:, 3:], (At[:, :3] - At[:, 3:] * S) / A[:, 3:]
        return S

    return len(s) / best(run), float(np.abs(run() - surface.evaluate(s, t)).max())


def projection(surface: TSpline[RowTMesh]) -> tuple[float, int]:
    """Points per CPU second for points +-1 mm off the tube, and how many have a nearer point on a dense grid
    than their foot."""
    rng = np.random.default_rng(7)
    s, t = rng.random((2, POINTS))
    points = surface.evaluate(s, t) + surface.normals(s, t) * rng.uniform(-1, 1, (POINTS, 1))
    rate = POINTS / best(lambda: surface.project(points))
    grid = np.meshgrid(np.arange(1200) / 1200, np.linspace(0, 1, 1200))
    from scipy.spatial import KDTree

    nearest = KDTree(surface.evaluate(grid[0].ravel(), grid[1].ravel())).query(points)[0]
    return rate, int((surface.project(points).distances > nearest + 1e-9).sum())


def main() -> None:
    """Print the table and check it."""
    surface, rng = tube(), np.random.default_rng(3)
    s, t = rng.random((2, SAMPLES))
    own = SAMPLES / best(lambda: surface.evaluate(s, t, 1))
    rows = bone_like()
    uneven = SAMPLES / best(lambda: rows.evaluate(s, t, 1))
    whole = as_general(rows)
    general = SAMPLES / best(lambda: whole.evaluate(s, t, 1))
    nurbs, nurbs_error = splinepy_rate(surface, s, t)
    scipy, scipy_error = scipy_rate(surface, s, t)
    csr = best(lambda: rows.basis(s, t, 2))
    rate, failures = projection(rows)
    print(f"S, S_s, S_t, {ROWS} x {AROUND} control points, rational, {SAMPLES} random parameters, one core")
    print(f"  bonecam, knots of every row its own   {uneven / 1e6:8.2f} M points/s")
    print(
        f"  bonecam, one knot vector              {own / 1e6:8.2f} M points/s   {own / nurbs:6.1f} x "
        f"splinepy   {own / scipy:6.1f} x scipy"
    )
    print(f"  bonecam, as a general T-mesh          {general / 1e6:8.2f} M points/s")
    print(f"  splinepy NURBS                        {nurbs / 1e6:8.3f} M points/s   differs by {nurbs_error:.1e} mm")
    print(f"  scipy NdBSpline                       {scipy / 1e6:8.3f} M points/s   differs by {scipy_error:.1e} mm")
    print(f"six CSR matrices R ... R_tt, {SAMPLES} samples: {csr:.3f} s")
    print(
        f"projection of {POINTS} points +-1 mm off the tube: {rate:.0f} points/s, {failures} not at their nearest foot"
    )
    assert min(own, uneven) >= AIM["evaluate"]
    assert own >= AIM["splinepy"] * nurbs
    assert csr <= AIM["csr"]
    assert rate >= AIM["project"]
    assert failures == 0


if __name__ == "__main__":
    main()
