"""Fitting bones: control points of the adaptive T-spline beside a tensor-product B-spline fitted within the
same deviation.

    python tests/benchmarks/bench_fit.py [TOLERANCE_MM MOST BONE.stl[:m] ...]

":m" means a file in metres. Without arguments 0.05 mm and 4000 points, for the shared bones in NAMES. The
B-spline is fitted by the same steps from the same start and refined where it misses the mesh, but every knot
runs through all rows, and goes from all rows (its poles stay single points). It is asked for the same
tolerance, or for what the T-spline reached where that missed it with MOST control points, and may have twice
as many as the T-spline took. Where it comes no nearer than printed it would need more, and the share is below
the one printed ("<"). Deviations are two-sided, mm; seconds are CPU seconds, rows included. Where the
tolerance is missed, the spot is printed.
"""

import sys
import time
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from bonecam.job import MeshJob
from bonecam.mesh.part import prepare_part
from bonecam.mesh.rows import harmonic_rows
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.surface.fitting import FitTarget
from bonecam.surface.growth import (
    GROWTH_BY_MISS,
    LOWEST,
    MIN_GROWTH,
    Fit,
    Prune,
    Refine,
    Votes,
    fit,
    prune,
    refine,
    spare_knots,
)
from bonecam.surface.tmesh import RowTMesh
from bonecam.surface.tspline import TSpline

BONES = Path(__file__).resolve().parents[3] / "shared" / "meshes" / "bones"
NAMES = ("3midph", "3distph", "2midph", "scaphoid")


def tensor_refine(tmesh: RowTMesh, votes: Votes, room: int) -> RowTMesh:
    """The votes of `adapt`, but an s-knot goes into all rows and costs one control point in each."""
    knots, rows = tmesh.s_knots[2], len(tmesh.s_knots) - 4
    span = np.clip(np.searchsorted(tmesh.t_knots, votes.t, side="right") - 1, 3, len(tmesh.t_knots) - 5)
    index = np.mod(np.searchsorted(knots, votes.s, side="right") - 1, len(knots))
    gaps = np.diff(np.append(knots, knots[0] + 1))
    height = np.diff(tmesh.t_knots)[span] * votes.along
    tall = height > gaps[index] * votes.around
    cut = tall & (height > LOWEST * votes.goal)
    along = np.bincount(span[cut], votes.weight[cut], minlength=len(tmesh.t_knots)) / len(knots)
    around = np.bincount(index[~tall], votes.weight[~tall], minlength=len(knots)) / rows
    cuts = [(-w, 0, k) for k, w in enumerate(along) if w > 0] + [
        (-w, 1, k) for k, w in enumerate(around) if w > 0 and gaps[k] > 1 / 256
    ]
    wanted, s_new, found = (
        min(room, max(6, round((MIN_GROWTH + GROWTH_BY_MISS * votes.missed) * tmesh.size))),
        list(knots),
        tmesh,
    )
    t_new: list[float] = []
    for _, kind, k in sorted(cuts):
        if found.size - tmesh.size >= wanted:
            break
        tried_s = [*s_new, float(np.mod(knots[k] + gaps[k] / 2, 1))] if kind else s_new
        tried_t = t_new if kind else [*t_new, float(tmesh.t_knots[k : k + 2].mean())]
        t_knots = np.sort(np.concatenate([tmesh.t_knots, tried_t]))
        finer = RowTMesh.from_rows(t_knots, every_row(tmesh, np.sort(np.array(tried_s)), len(t_knots) - 8))
        if finer.size - tmesh.size <= room:
            found, s_new, t_new = finer, tried_s, tried_t
    return found


def tensor_prune(surface: TSpline, target: FitTarget, limit: float, most: int) -> RowTMesh:
    """As `prune`, but an s-knot goes from all rows at once: its moves are the sum over the rows."""
    tmesh = surface.tmesh
    assert isinstance(tmesh, RowTMesh)
    now, spared = spare_knots(surface, target)
    count, rows = len(tmesh.s_knots[2]), len(tmesh.s_knots) - 4
    moves = np.zeros((count, len(now)))
    for one in spared:
        moves[one.knot, one.samples] += one.moves
    gone: set[int] = set()
    for k in np.argsort(np.abs(now + moves).max(axis=1), kind="stable").tolist():
        near = {(k + d) % count for d in (-2, -1, 0, 1, 2)} & gone
        if (
            (len(gone) + 1) * rows <= most
            and count - len(gone) > 4
            and not near
            and np.abs(now + moves[k]).max() < limit
        ):
            gone.add(k)
            now = now + moves[k]
    return RowTMesh.from_rows(tmesh.t_knots, every_row(tmesh, np.delete(tmesh.s_knots[2], sorted(gone)), rows))


def every_row(tmesh: RowTMesh, knots: np.ndarray, rows: int) -> list[np.ndarray]:
    """The poles and the rings next to them as they are, and `rows` rows with the same knots."""
    return [*tmesh.s_knots[:2], *[knots] * rows, *tmesh.s_knots[-2:]]


def one(mesh: TriangleMesh, tolerance: float, most: int, how: tuple[Refine, Prune]) -> tuple[Fit, float]:
    """A fit and its CPU seconds."""
    start = time.process_time()
    with threadpool_limits(1):
        found = fit(mesh, tolerance, most, rows=harmonic_rows(mesh, 48, 100), refine=how[0], prune=how[1])
    return found, time.process_time() - start


def spot(found: Fit) -> str:
    """Where the fit misses the mesh the most, or that it meets itself; nothing where neither is so."""
    if found.reached:
        return ""
    if found.deviation.max <= found.tolerance:
        return " folded"
    return f" missed at ({', '.join(f'{x:.2f}' for x in found.deviation.place)})"


def main(tolerance: float, most: int, names: list[str]) -> None:
    """Print the table."""
    columns = "points    max    rms  CPU s reached"
    print(f"{tolerance} mm".ljust(26) + f"{columns} | B-spline: {columns} | share")
    for name in names:
        path, _, unit = name.partition(":")
        mesh = prepare_part(Path(path), MeshJob(units=unit or "mm")).mesh
        cells: list[str] = []
        fits: list[Fit] = []
        for how in ((refine, prune), (tensor_refine, tensor_prune)):
            asked = max(tolerance, fits[0].deviation.max) if fits else tolerance
            found, seconds = one(mesh, asked, 2 * fits[0].control_points if fits else most, how)
            fits.append(found)
            cells.append(
                f"{found.control_points:6d} {found.deviation.max:6.3f} {found.deviation.rms:6.4f} "
                f"{seconds:6.1f} {found.reached!s:>7}"
            )
        share = f"{' ' if fits[1].reached else '<'}{fits[0].control_points / fits[1].control_points:.0%}"
        print(
            f"{Path(path).stem:26s}{cells[0]} | {cells[1]} | {share}{''.join(spot(found) for found in fits)}",
            flush=True,
        )


if __name__ == "__main__":
    tolerance, most, *bones = sys.argv[1:] or ["0.05", "4000", *(f"{BONES / name}_m.stl:m" for name in NAMES)]
    main(float(tolerance), int(most), bones)
