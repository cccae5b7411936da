"""The levels of one bone by each solver of quadratic programs: CPU seconds of their stage, and the cuts.

    python tests/benchmarks/bench_osqp.py [MESH] [--depth MM]

Without a mesh the shipped phalanx, in cuts of DEPTH mm throughout. One thread; the surface is fitted once for each.
"""

import argparse

import bonecam_meshes
from threadpoolctl import threadpool_limits

import bonecam

SOLVERS = ("admm", "osqp")
DEPTH = 1.5
"""mm."""


def seconds(mesh: str, solver: str, depth: float) -> tuple[float, int, float]:
    """CPU seconds of the levels, their cuts, and the deepest of them, mm."""
    levels = {"solver": solver, "finishing_levels": 0, "roughing_depth": depth}
    made = bonecam.morph_levels(mesh, bonecam.Job().with_values(levels=levels))
    deepest = max(level.deepest for level in made.levels.levels[1:])
    return made.report["cpu_seconds"]["levels"], made.levels.cuts, deepest


def main() -> None:
    """Print a line a solver."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("mesh", nargs="?", default=str(bonecam_meshes.path("phalanx")))
    parser.add_argument("--depth", type=float, default=DEPTH)
    options = parser.parse_args()
    with threadpool_limits(1):
        found = {solver: seconds(options.mesh, solver, options.depth) for solver in SOLVERS}
    print(f"{'solver':8} {'CPU s':>8} {'factor':>7} {'cuts':>5} {'deepest mm':>11}")
    for solver, (cpu, cuts, deepest) in found.items():
        print(f"{solver:8} {cpu:8.2f} {cpu / found[SOLVERS[0]][0]:7.1f} {cuts:5} {deepest:11.4f}")


if __name__ == "__main__":
    main()
