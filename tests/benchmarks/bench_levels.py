"""The morph levels of one bone: time against the number of control points, beside the paper's program in
Clarabel and in CVXPY.

    python tests/benchmarks/bench_levels.py [MESH:UNITS[:DIAMETER:LENGTH]] [--quick]

Without a mesh the shared middle phalanx in the paper's capsule 15 x 37, or else the shipped one. CPU seconds,
one thread.

Growth: the same bone fitted with more and more control points; its levels may have more. "solve" is
everything that makes the sequence (sequences that were dropped and levels made again included), "check" the
measuring; "a level" one level's program and its projection; "cones" one level of the paper's sampled program
by Clarabel (`method = "qcqp"`), up to LARGEST_CONES points; "hull" the same with the depth on the control
points. Energy: of every third level's moves beside Clarabel's optimum of the same program (same energy, its
targets slid to where our samples are, and planes, set up again where its own are): what ADMM finds,
for its samples; and the finished level, after what denser samples still broke is projected away, for the
planes of these as well. CVXPY: the paper's formulation (thin plate, pull to the nearest stock point, depth
and capsule cones at 17 x 100 samples) with its default solver, from each of our levels to the next. Cuts: of
the program as the paper prints it, by what attracts. --quick leaves out CVXPY and what is above 600 control
points.
"""

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import clarabel
import numpy as np
import scipy.sparse as sp
from bonecam_plugins.study.levels import PublishedProgram, next_moves
from numpy import ndarray
from scipy.sparse.linalg import spsolve
from threadpoolctl import threadpool_limits

from bonecam.arrays import settled
from bonecam.job import Job, LevelsJob
from bonecam.levels.closed_morph import morph
from bonecam.levels.measure import level_grid
from bonecam.levels.problem import Cut, Discretisation, Remaining, StepParameters
from bonecam.levels.program import LevelProgram, LinearLimits, limits_at, program_of
from bonecam.levels.sequences import Morph
from bonecam.levels.solvers import admm
from bonecam.levels.solvers.exchange import ExchangeStep, next_level
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.part import prepare_part
from bonecam.setup.capsule import Capsule
from bonecam.setup.placement import place
from bonecam.setup.stock import Schedule
from bonecam.surface.part_surface import fit_surface
from bonecam.surface.tspline import TSpline

SHARED = Path(__file__).resolve().parents[3] / "shared" / "meshes" / "bones" / "3midph_m.stl"
FITS = ((0.12, 150), (0.075, 260), (0.05, 520), (0.03, 1000), (0.02, 2000))
BASE = 260
SCHEDULE, STIFFNESS = Schedule((0.1,) * 4, 0.5), LevelsJob().stiffness
LARGEST_CONES, RENEWALS, EVERY, NEAR = 600, 2, 3, 0.006
ROWS, ROW_POINTS = 17, 100
PRINTED_STIFFNESS, MOST_CUTS = 1e-6, 60


@dataclass(frozen=True, eq=False)
class Call:
    """One call of `next_level` by the morph, and its answer."""

    discretisation: Discretisation
    P: ndarray
    rest: Remaining
    cut: Cut
    parameters: StepParameters
    step: ExchangeStep

    @property
    def program(self) -> LevelProgram:
        """The program it solved."""
        return program_of(self.discretisation, self.P, self.rest, self.cut, self.parameters)

    def again(self) -> ExchangeStep:
        """The same call."""
        return next_level(self.discretisation, self.P, self.rest, self.cut, self.parameters)

    @property
    def free_moves(self) -> ndarray:
        """The answer's moves of the control points that are free."""
        B = self.discretisation.free
        return spsolve(sp.csc_matrix(B.T @ B), B.T @ self.step.moves).reshape(-1, 3)


@dataclass(frozen=True, eq=False)
class Case:
    """One fit of so many control points and what became of it: the same `surface` with those of the levels;
    `calls` made its levels below the stock, but for those that were mended."""

    fitted: int
    surface: TSpline
    stock: Capsule
    made: Morph
    calls: dict[int, Call]

    @property
    def nets(self) -> list[ndarray]:
        """Control points of levels 0, 1, ... below the stock."""
        return [level.surface.control_points for level in self.made.levels if level.surface is not None]


def seconds(work: Callable[[], Any]) -> tuple[float, Any]:
    """CPU seconds and the result."""
    began = time.process_time()
    result = work()
    return time.process_time() - began, result


def cases(mesh: str, largest: int) -> list[Case]:
    """The bone with more and more control points; CPU instead of wall seconds in what the morph reports."""
    name, units, *size = mesh.split(":")
    job = Job().with_values(mesh={"units": units})
    if size:
        job = job.with_values(stock={"diameter": float(size[0]), "length": float(size[1])})
    setup = place(prepare_part(name, job.mesh), job)
    stock = setup.stock
    assert isinstance(stock, Capsule)
    found: list[Case] = []
    for tolerance, most in FITS:
        if most <= largest:
            surface = fit_surface(
                setup.part, replace(job, surface=replace(job.surface, tolerance=tolerance, max_control_points=most))
            ).surface
            if not found:
                morph(surface, stock, Schedule((), 2.0))  # compiles and loads what the first call does
            found.append(recorded(surface, stock))
    return found


def recorded(surface: TSpline, stock: Capsule) -> Case:
    """The morph, with the calls that made the levels it answers."""
    calls: list[Call] = []

    def noted(
        discretisation: Discretisation,
        P: ndarray,
        *,
        rest: Remaining,
        cut: Cut,
        parameters: StepParameters,
        **options: Any,
    ) -> ExchangeStep:
        step = next_level(discretisation, P, rest=rest, cut=cut, parameters=parameters, **options)
        calls.append(Call(discretisation, P, rest, cut, parameters, step))
        return step

    with patch("time.perf_counter", time.process_time), patch("bonecam.levels.sequences.next_level", noted):
        made = morph(surface, stock, SCHEDULE)
    nets = [level.surface.control_points for level in made.levels if level.surface is not None]
    made_by = {
        k: call
        for k, net in enumerate(nets)
        for call in calls
        if np.array_equal(settled(call.P + call.step.moves), net)
    }
    return Case(surface.tmesh.size, made.levels[0].surface, stock, made, made_by)  # type: ignore[arg-type]


def level_seconds(case: Case) -> list[float]:
    """CPU seconds of each level's program, solved and projected, from our levels."""
    return [seconds(call.again)[0] for call in case.calls.values()]


def growth(found: list[Case]) -> None:
    """The table of times and its exponents."""
    print("   fit levels |  K K_min  used | solve s check s | a level s | cones s  hull s")
    rows = []
    for case in found:
        steps = level_seconds(case)
        size, made, cones = len(case.surface.control_points), case.made, [np.nan, np.nan]
        middle = min(len(SCHEDULE.first) + 1, len(case.nets) - 1)
        for place_, hull in enumerate((False, True)):
            if size <= LARGEST_CONES:
                program = PublishedProgram(case.surface, case.stock, "stock", hull=hull)
                start = case.nets[middle - 1]
                work = partial(next_moves, program, start, SCHEDULE.limit(middle), STIFFNESS)
                cones[place_] = seconds(work)[0]
        rows.append((case.fitted, made.solve_seconds, made.check_seconds, float(np.mean(steps)), *cones))
        one = rows[-1]
        print(
            f"{case.fitted:6d} {size:6d} | {made.cuts:2d} {made.lower_bound:5d} {made.depth_used:5.3f} | "
            f"{one[1]:7.2f} {one[2]:7.2f} | {one[3]:9.3f} | {one[4]:7.2f} {one[5]:7.2f}",
            flush=True,
        )
    exponents = [exponent(np.array(rows)[:, 0], np.array(rows)[:, k]) for k in range(1, 6)]
    print(
        "growth n^     |                 | {:7.2f} {:7.2f} | {:9.2f} | {:7.2f} {:7.2f}"
        "    (aim: solve at most n^1.7)\n".format(*exponents)
    )


def exponent(sizes: ndarray, times: ndarray) -> float:
    """The slope of log time over log size, least squares."""
    kept = np.isfinite(times)
    return float(np.polyfit(np.log(sizes[kept]), np.log(times[kept]), 1)[0]) if kept.sum() > 1 else np.nan


def optimum(call: Call, program: LevelProgram, start: ndarray, watched: bool) -> float:
    """Least energy of a level's program by Clarabel, the planes set up again RENEWALS times where its samples
    are.

    With `watched` the planes of all watched samples that `start` or the last answer brings within NEAR mm of
    them hold as well.
    """
    watch = call.discretisation.watched(call.P + call.discretisation.free @ start, call.P)
    R = sp.csr_array(watch.R @ call.discretisation.free)
    settings, D = clarabel.DefaultSettings(), start
    settings.verbose = False
    energy = sp.csc_matrix(sp.triu(sp.block_diag([program.matrix] * 3), format="csc"))
    x, planes = watch.R @ call.P, program.limits
    gap = -call.discretisation.stock.signed_distance(x)
    dense = limits_at(planes.before, planes.stock, call.cut, gap, x + R @ D, watch.s, watch.t, 3)
    for _ in range(RENEWALS):
        planes = program.at(D).limits
        rows = planes.rows(program.R, program.x)
        if watched:
            y = x + R @ D
            dense = dense.at(y, 3)
            near = np.flatnonzero(dense.broken(y) > -NEAR)
            more = dense.only(near).rows(sp.csr_array(R[near]), x[near])
            both = sp.csr_array(sp.vstack([rows.A, more.A]))
            rows = LinearLimits(both, np.r_[rows.low, more.low], np.r_[rows.high, more.high])
        b = np.concatenate([rows.high, -rows.low])
        kept = np.isfinite(b)
        A = sp.csc_matrix(sp.csr_array(sp.vstack([rows.A, -rows.A]))[kept])
        cones = [clarabel.NonnegativeConeT(int(kept.sum()))]
        answer = clarabel.DefaultSolver(energy, program.gradient.T.ravel(), A, b[kept], cones, settings).solve()
        if str(answer.status) != "Solved":
            raise RuntimeError(f"Clarabel ends as {answer.status}")
        D = np.array(answer.x).reshape(3, -1).T
    return program.energy(D)


def energies(case: Case) -> None:
    """Each level's energy beside the optimum of the same program."""
    print(
        f"Energy / Clarabel's optimum of the same program, {len(case.surface.control_points)} control "
        "points (aim: within 1 %)"
    )
    print(
        "level | ADMM, its      samples' planes  (broken by mm) | level, the watched samples' planes too "
        " (broken by mm)"
    )
    ratios, last = [], max(case.calls)
    for k in sorted({*range(1, last + 1, EVERY), last} & set(case.calls)):
        call, program = case.calls[k], case.calls[k].program
        moves = admm.solve(program)
        wide = program.at(moves).limits.broken(program.x + program.R @ moves).max()
        pairs = ((moves, False), (call.free_moves, True))
        ratios.append([(there := program.at(D)).energy(D) / optimum(call, there, D, watched) for D, watched in pairs])
        print(
            f"{k:5d} | {ratios[-1][0]:30.4f}  {wide:14.4f} | {ratios[-1][1]:36.4f}  {call.step.broken:14.4f}",
            flush=True,
        )
    worst = 100 * np.abs(np.array(ratios) - 1).max(0)
    print(f"farthest from 1: {worst[0]:.2f} % by ADMM, {worst[1]:.2f} % of the finished levels\n")


def paper(
    program: PublishedProgram, stock: Capsule, samples: sp.csr_array, P: ndarray, depth: float
) -> tuple[float, str]:
    """One level of the paper's formulation by CVXPY: CPU seconds with the problem's compilation, and its
    solver."""
    import cvxpy

    E, gradient = program.terms(P, STIFFNESS)
    x, tau = cvxpy.Variable(P.shape), cvxpy.Variable((samples.shape[0], 1))
    move = samples @ x
    energy = sum(cvxpy.quad_form(x[:, j], cvxpy.psd_wrap(sp.csc_matrix(E))) for j in range(3)) + 2 * cvxpy.sum(
        cvxpy.multiply(gradient, x)
    )
    from_axis = samples @ P - stock.start + move - tau @ (stock.end - stock.start)[None]
    limits = [cvxpy.norm(move, axis=1) <= depth, cvxpy.norm(from_axis, axis=1) <= stock.radius, tau >= 0, tau <= 1]
    problem = cvxpy.Problem(cvxpy.Minimize(energy), limits)
    spent, _ = seconds(problem.solve)
    if problem.status != "optimal":
        raise RuntimeError(f"CVXPY ends as {problem.status}")
    return spent, str(problem.solver_stats.solver_name)


def published(case: Case) -> None:
    """How many cuts the program takes as the paper prints it, by what attracts: the bounding sphere or the
    nearest stock point."""
    print(
        "Cuts of the program as printed (depth as displacement, at samples; no nesting; stiffness 1e-6 "
        "throughout), Clarabel"
    )
    first, targets = case.made.levels[0], case.stock.mesh(0.02).vertices
    grid = level_grid(case.surface, [first.surface.control_points], 0.02)  # type: ignore[union-attr]
    for attraction in ("sphere", "stock"):
        program, P, k = PublishedProgram(case.surface, case.stock, attraction, printed=True), case.nets[0], 1
        while MeshDistance(grid.mesh(P)).unsigned(targets).max() > SCHEDULE.limit(k) and k < MOST_CUTS:
            P, k = P + next_moves(program, P, SCHEDULE.limit(k), PRINTED_STIFFNESS), k + 1
        print(f"{attraction:>8s}: {k} cuts, fewest possible {case.made.lower_bound}", flush=True)
    print(f" default: {case.made.cuts} cuts\n")


def beside_cvxpy(case: Case) -> None:
    """Our sequence beside the paper's formulation level by level."""
    program = PublishedProgram(case.surface, case.stock, "stock")
    low, high = case.surface.domain[1]
    s, t = (
        v.ravel()
        for v in np.meshgrid(np.arange(ROW_POINTS) / ROW_POINTS, low + (high - low) * (np.arange(ROWS) + 0.5) / ROWS)
    )
    samples, times = case.surface.basis(s, t)[0], level_seconds(case)
    print(
        f"CVXPY, the paper's formulation, {len(case.surface.control_points)} control points, {len(s)} "
        "samples (aim: 20 x)"
    )
    print("level | ours s | CVXPY s | times")
    rows = []
    for k, P in enumerate(case.nets[:-1], start=1):
        ours = times[k - 1]
        spent, name = paper(program, case.stock, samples, P, SCHEDULE.limit(k))
        rows.append((ours, spent))
        print(f"{k:5d} | {ours:6.3f} | {spent:7.2f} | {spent / ours:5.0f}", flush=True)
    ours, spent = np.array(rows).sum(0)
    print(f"  all | {ours:6.3f} | {spent:7.2f} | {spent / ours:5.0f}  ({name})")
    whole = case.made.solve_seconds
    print(
        f"our whole sequence with all that is solved beside the levels: {whole:.2f} s: "
        f"{spent / whole:.0f} times as fast\n"
    )


def main() -> None:
    """Print the tables."""
    options = argparse.ArgumentParser()
    options.add_argument("mesh", nargs="?")
    options.add_argument("--quick", action="store_true")
    given = options.parse_args()
    mesh = given.mesh
    if mesh is None and not SHARED.exists():
        import bonecam_meshes

        mesh = f"{bonecam_meshes.path('phalanx')}:mm"
    with threadpool_limits(1):
        found = cases(mesh or f"{SHARED}:m:15:37", LARGEST_CONES if given.quick else FITS[-1][1])
        growth(found)
        base = min(found, key=lambda case: abs(case.fitted - BASE))
        energies(base)
        published(base)
        if not given.quick:
            beside_cvxpy(base)


if __name__ == "__main__":
    main()
