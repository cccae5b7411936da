"""The only door to Clarabel, an interior-point solver: the exact reference of the others.

It solves the default program of a level (`solve`), and the published one with its second-order cones
(`solve_cones`). Needs the extra `reference`.
"""

from types import ModuleType

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import LevelError
from bonecam.job import field_error
from bonecam.levels.problem import Cones, Planes
from bonecam.levels.program import LevelProgram, LinearLimits
from bonecam.levels.solvers.linearised import solve_linearised

ACCURACY = 1e-6
"""Clarabel's tolerance of residuals and of the duality gap, relative and in mm."""
GAP = 1e-4
"""The largest duality gap of an answer that is accepted, as a share of its value."""


def require_clarabel(field: str, value: str, instead: str) -> ModuleType:
    """The module; JobError that names the field of `levels` where the extra that brings it is not installed."""
    try:
        import clarabel
    except ImportError as error:
        remedy = f"needs Clarabel: pip install 'bonecam[reference]', or take {field} {instead!r}"
        raise field_error("levels", field, value, remedy) from error
    return clarabel  # type: ignore[no-any-return]


def solve(program: LevelProgram) -> Float[ndarray, "m 3"]:
    """The free moves of a level's program by Clarabel, every limit a row: exact, and many times slower than
    `admm`."""
    import clarabel

    energy = sp.block_diag([program.matrix] * 3)

    def minimum(limits: LinearLimits, start: Float[ndarray, " v"]) -> Float[ndarray, " v"]:
        high = np.concatenate([limits.high, -limits.low])
        finite = np.isfinite(high)
        A = sp.csr_array(sp.vstack([limits.A, -limits.A]))[finite]
        kinds = [clarabel.NonnegativeConeT(int(finite.sum()))]
        return _minimum(energy, program.gradient.T.ravel(), A, high[finite], kinds)

    return solve_linearised(program, minimum)


def solve_cones(
    energy: sp.csc_array, gradient: Float[ndarray, "c 3"], cones: tuple[Cones, ...], planes: Planes
) -> Float[ndarray, "c 3"]:
    """The moves x (c, 3) that minimise x'Ex / 2 + gradient . x within all cones and planes.

    `energy` E (c, c) is the same for the three coordinates. LevelError where the duality gap is more than GAP.
    """
    import clarabel

    count = energy.shape[0]
    below_planes = sp.hstack([sp.diags_array(planes.normals[:, j]) @ planes.R for j in range(3)])
    blocks = [(sp.csr_array(below_planes), planes.high)]
    blocks += [_cone_rows(one) for one in cones]
    for one in cones:
        # 0 <= tau <= 1
        tau = sp.eye_array(one.slides, format="csr")
        before = sp.csr_array((one.slides, 3 * count))
        rows = sp.csr_array(sp.vstack([sp.hstack([before, tau]), sp.hstack([before, -tau])]))
        blocks.append((rows, np.concatenate([np.ones(one.slides), np.zeros(one.slides)])))
    width = max(rows.shape[1] for rows, _ in blocks)
    A = sp.vstack(
        [sp.csr_array((rows.data, rows.indices, rows.indptr), shape=(rows.shape[0], width)) for rows, _ in blocks]
    )
    b = np.concatenate([high for _, high in blocks])

    balls = sum(len(one.radii) for one in cones)
    slides = sum(one.slides for one in cones)
    below, cone = clarabel.NonnegativeConeT, clarabel.SecondOrderConeT
    kinds = [below(len(planes.high)), *[cone(4)] * balls, *[below(2 * slides)] * bool(slides)]

    P = sp.block_diag([energy] * 3 + [sp.csc_array((width - 3 * count,) * 2)] * (width > 3 * count))
    q = np.concatenate([gradient.T.ravel(), np.zeros(width - 3 * count)])
    return _minimum(P, q, A, b, kinds)[: 3 * count].reshape(3, count).T


def _minimum(P: sp.sparray, q: ndarray, A: sp.sparray, b: ndarray, kinds: list[object]) -> Float[ndarray, " v"]:
    """x of least x'Px / 2 + q.x with b - A x in the cones `kinds`; LevelError where there is none."""
    import clarabel

    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.direct_solve_method = "qdldl"
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = ACCURACY
    upper = sp.csc_matrix(sp.triu(P, format="csc"))
    answer = clarabel.DefaultSolver(upper, q, sp.csc_matrix(A), b, kinds, settings).solve()
    gap = abs(answer.obj_val - answer.obj_val_dual) / max(1.0, abs(answer.obj_val))
    if str(answer.status) not in ("Solved", "AlmostSolved") or not gap <= GAP:
        raise LevelError(
            f"this level's program ends as {answer.status}: raise levels.stiffness or surface.max_control_points"
        )
    return np.array(answer.x)


def _cone_rows(cones: Cones) -> tuple[sp.csr_array, ndarray]:
    """Rows [radius, R_l x - centre - tau axis] of each cone in turn, as b - A z, z = (x, tau)."""
    k, c = cones.R.shape
    R = sp.coo_array(cones.R)
    rows: list[ndarray] = [4 * R.row + 1 + j for j in range(3)]
    columns: list[ndarray] = [R.col + j * c for j in range(3)]
    values: list[ndarray] = [-R.data] * 3
    if cones.axis is not None:
        rows += [4 * np.arange(k) + 1 + j for j in range(3)]
        columns += [3 * c + np.arange(k)] * 3
        values += [np.full(k, cones.axis[j]) for j in range(3)]
    entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
    A = sp.csr_array(entries, shape=(4 * k, 3 * c + cones.slides))
    return A, np.column_stack([cones.radii, -cones.centres]).ravel()
