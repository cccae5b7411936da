"""Skinning: control points of the T-spline beside B-splines through the same sections within the same
verified tolerance.

    python tests/benchmarks/bench_skin.py [FOLDER]

FOLDER, by default that of the shared data, has files name1.txt, name2.txt, ... whose first line is "npoints dim".

Columns: the T-spline of `skin`; the tensor-product B-spline whose knots are the union of those the sections
keep when each is reduced alone (classical skinning); the B-spline whose knots are chosen for all sections
together (the best a tensor product can do by the same reduction); both with as many rows as sections.
Verified: the largest distance of a data point from the T-spline at its parameters and of the T-spline from
the skin within 1e-6 of the tolerance on a dense grid, each in parts of the tolerance. Seconds are CPU
seconds.
"""

import sys
import time
from pathlib import Path

import numpy as np

from bonecam.surface.skinning import Reduction, RowCurves, control_curves, row_parameters, skin

FOLDER = Path(__file__).resolve().parents[3] / "shared" / "tspline" / "skinning_sections"
EXACT = 1e-6  # of the tolerance: the skin that is taken as exact
CASES = (
    ("bonnet", 1e-3, 175, 290),
    ("bonnet", 1e-2, 78, 120),
    ("door", 1e-3, 50, 60),
    ("ring", 1e-3, 45, 45),
    ("helicoidal", 1e-3, 55, 55),
)


def sections(folder: Path, name: str) -> list[np.ndarray]:
    """The rows of one body, in order."""
    files = sorted(folder.glob(f"{name}[0-9]*.txt"), key=lambda file: int(file.stem.removeprefix(name)))
    return [np.loadtxt(file, skiprows=1) for file in files]


def b_splines(rows: list[np.ndarray], tolerance: float) -> tuple[int, int]:
    """Control points of both B-splines."""
    curves = RowCurves.through(rows, closed=False)
    control = control_curves(curves)
    reduction = Reduction(control.fine, control.candidates, False)
    points = list(_on_fine(curves, control.fine))
    sections, stacked = (reduction.least_of_all(each, tolerance) for each in (points, [np.stack(points, axis=1)]))
    assert sections is not None
    assert stacked is not None
    alone, (together, _) = np.unique(np.concatenate([knots for knots, _ in sections])), stacked[0]
    return len(rows) * (len(alone) + 4), len(rows) * (len(together) + 4)


def _on_fine(curves: RowCurves, fine: np.ndarray) -> np.ndarray:
    from bonecam.surface.basis import interpolate, sites

    at = sites(fine, False)
    return np.array([interpolate(fine, at, section, False) for section in curves.at(at)])


def main(folder: Path) -> None:
    """Print the table and check it."""
    print(
        "body        tolerance    mm      T-spline  B union  B together  published T / B   points/tol  "
        "skin/tol  T CPU s"
    )
    for name, share, published, published_b in CASES:
        rows = sections(folder, name)
        tolerance = share * float(np.linalg.norm(np.ptp(np.vstack(rows), axis=0)))
        start = time.process_time()
        surface = skin(rows, tolerance, closed=False)
        seconds = time.process_time() - start
        curves = RowCurves.through(rows, closed=False)
        t = row_parameters(curves)
        miss = max(
            np.linalg.norm(surface.positions(s, np.full(len(s), x)) - p, axis=1).max()
            for p, s, x in zip(rows, curves.parameters, t)
        )
        s, t = (v.ravel() for v in np.meshgrid(np.linspace(0, 1, 301), np.linspace(0, 1, 301)))
        exact = skin(rows, EXACT * tolerance, closed=False)
        away = np.linalg.norm(surface.positions(s, t) - exact.positions(s, t), axis=1).max()
        union, together = b_splines(rows, tolerance)
        size = surface.tmesh.size
        print(
            f"{name:12s} {share:7.0e} {tolerance:8.4f} {size:9d} {union:8d} {together:11d}      "
            f"{published:4d} / {published_b:<4d} "
            f"{miss / tolerance:12.2f} {away / tolerance:9.2f} {seconds:8.2f}"
        )
        assert max(miss, away) <= tolerance
        assert size <= published


if __name__ == "__main__":
    main(Path(sys.argv[1]) if sys.argv[1:] else FOLDER)
