"""Certificates of the levels' depth, nesting and stock beside what the check measures and beside dense
samples, on the same levels.

    python tests/benchmarks/bench_certificate.py [MESH:UNITS]... [--samples N]

Without meshes the shared bones in BONES. One row a bone: control points, cuts; the worst of all cuts, in
microns, of

    depth over the limit   measured at the check's points | of N samples of each level | certified
    outside the next level measured                       | of N samples               | certified
    out of the stock       measured                       | of N samples               | certified
    last cut, over limit   measured                       | of a fine mesh of the stock | certified

and seconds on one thread: of the check (wall), of the certificates (CPU), of one of them. Samples' feet are
the nearest of those found from many starts (`surface.project`): a sample may seem farther than it is, never
nearer. "not certified" counts cuts with a bound beyond a tolerance.
"""

import argparse
import time
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy import ndarray
from threadpoolctl import threadpool_limits

from bonecam.job import Job, MeshJob
from bonecam.levels.certificates import certify
from bonecam.levels.closed_morph import morph
from bonecam.mesh.part import prepare_part
from bonecam.setup.placement import place
from bonecam.setup.stock import Stock
from bonecam.surface.part_surface import fit_surface
from bonecam.surface.tspline import TSpline

SHARED = Path(__file__).resolve().parents[3] / "shared" / "meshes" / "bones"
FINE = 0.002
"""Chord tolerance (mm) of the mesh of the stock on which the last cut is sampled."""
BONES = ("3midph_m.stl", "3distph_m.stl", "scaphoid_m.stl", "1mc_m.stl", "capitate_m.stl")


def sampled(surfaces: list[TSpline], stock: Stock, limits: list[float], count: int) -> tuple[float, float, float]:
    """The largest depth over its limit, the farthest outside the next level and out of the stock, of samples
    of the levels."""
    rng = np.random.default_rng(1)
    s, t = rng.random(count), rng.random(count)
    deep = behind = outside = -np.inf
    for (inner, outer), limit in zip(pairwise(surfaces), limits):
        points = outer.positions(s, t)
        deep = max(deep, float(inner.project(points).distances.max()) - limit)
        outside = max(outside, float(stock.signed_distance(points).max()))
        behind = max(behind, float(_signed(inner.positions(s, t), outer).max()))
    return deep, behind, outside


def _signed(points: ndarray, surface: TSpline) -> ndarray:
    foot = surface.project(points)
    across = ((points - foot.points) * surface.normals(foot.s, np.clip(foot.t, 1e-6, 1 - 1e-6))).sum(1)
    return np.copysign(foot.distances, across)


def row(mesh: Path, units: str, count: int) -> str:
    """The figures of one bone."""
    job = Job(mesh=MeshJob(units=units))
    setup = place(prepare_part(mesh, job.mesh), job)
    stock = setup.stock
    made = morph(fit_surface(setup.part, job).surface, stock, setup.schedule)
    surfaces, cuts = [level.surface for level in made.levels if level.surface], made.levels[1:]
    limits = [level.limit for level in cuts]
    certify(surfaces[:2], stock, limits[:2])  # compiles
    began = time.process_time()
    found = certify(surfaces, stock, limits)
    seconds = time.process_time() - began
    inner = cuts[:-1]
    measured = (
        max(x.depth_max - x.limit for x in inner),
        -min(x.nesting_min for x in inner),
        max(x.outside for x in inner),
    )
    known = found[:-1]
    certified = (
        max(x.depth - limit for x, limit in zip(known, limits)),
        -min(x.nesting for x in known),
        max(x.outside for x in known),
    )
    around = stock.mesh(FINE).vertices
    last = (x - limits[-1] for x in (cuts[-1].depth_max, surfaces[-1].project(around).distances.max(), found[-1].depth))
    columns = [*zip(measured, sampled(surfaces, stock, limits, count), certified), last]
    figures = " | ".join("{:7.2f} {:7.2f} {:7.2f}".format(*(1000 * value for value in three)) for three in columns)
    doubtful = sum(bool(one.shortfalls(limit)) for one, limit in zip(found, limits))
    name = f"{mesh.name:22} {surfaces[0].tmesh.size:5} {len(cuts):4}"
    return f"{name} | {figures} | {made.check_seconds:6.2f} {seconds:6.2f} {seconds / len(cuts):6.3f} | {doubtful}"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("meshes", nargs="*", default=[f"{SHARED / bone}:m" for bone in BONES])
    parser.add_argument("--samples", type=int, default=20_000)
    given = parser.parse_args()
    print(
        f"{'':33} | depth over the limit, um | outside the next level   | out of the stock         | last "
        "cut, over the limit | seconds"
    )
    three = "measured sampled certif."
    print(
        f"{'bone':22} {'c.p.':>5} {'cuts':>4} | {three} | {three} | {three} | {three} |  check  certify  "
        "a cut | not certified"
    )
    with threadpool_limits(1):
        for mesh in given.meshes:
            file, _, units = mesh.rpartition(":")
            print(row(Path(file), units, given.samples), flush=True)


if __name__ == "__main__":
    main()
