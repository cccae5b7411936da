"""The field of tool axes of least elastic energy over one level.

Samples are contacts about SPACING apart. Levenberg's and Marquardt's method minimises the energy; then the axes at
the samples are tested for collision, and where one collides the nearest free direction becomes its target, so
that the field gives way there as a whole. What collides still is for `tool_axes.py` to replace.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.linalg import solve

from bonecam.job import PathJob
from bonecam.orientation.axes.admissible import nearest_free_axes
from bonecam.orientation.axes.lead import table_limits
from bonecam.orientation.collision.checker import CollisionChecker
from bonecam.orientation.field.axis_field import AxisField
from bonecam.orientation.field.energy import AxisBounds, AxisEnergy, second_differences
from bonecam.orientation.limits import AxisLimits, polar_angles
from bonecam.runtime.threads import on_one_blas_thread
from bonecam.toolpath.path import ContactPath

SPACING = 0.6
"""Distance of the samples along the passes, mm."""
MAX_STEPS = 40
"""Steps of the minimisation at most; it needs 10 to 30 from the normals, 3 to 10 from another level's field."""
LEAST_DROP = 5e-3
"""A step that lowers the energy by a smaller share is the last one."""
FIRST_DAMPING, LARGEST_DAMPING = 1e-3, 1e6
"""Of the steps, in diagonal entries of the normal equations."""
COLLISION_ROUNDS = 3
"""Times that colliding samples are given targets."""
TILT_SHARE = 0.87
"""Part of the largest tilt that the field uses: contacts between the samples need the rest."""
REACH = np.radians(5.0)
"""Where a normal points beyond the polar limits, the tilt may exceed the least possible one by this, radians."""
MARGIN = np.radians(2.0)
"""The field keeps this far from the polar limits, radians."""
LEAST_POLAR = np.radians(10.0)
"""And this far from the pole of the rotary axes, radians."""
FIRST_LEAN, FIRST_LOWEST, FIRST_HIGHEST = np.radians([20.0, 35.0, 90.0])
"""The first axes lean up from the normal by this, within these polar angles, radians."""
FIT_ROUGHNESS = 0.02
"""Weight of second differences in the first fit."""


@on_one_blas_thread
def fit_axis_field(
    path: ContactPath,
    domain: Float[ndarray, "2"],
    checker: CollisionChecker,
    limits: AxisLimits,
    job: PathJob,
    start: AxisField | None = None,
) -> AxisField:
    """The smooth field of axes for the contacts of a level whose t runs over `domain`.

    It keeps `job.max_tilt_deg` and, where nothing else is against it, `job.least_lead_deg` from the normals, and
    the polar limits. `start` is the field of a neighbouring level.
    """
    rows = _samples(path)
    normals, centres = path.normals[rows], path.centres[rows]
    energy = _energy(path, rows, domain, checker, limits, job)
    values = _first(energy) if start is None else np.array([start.azimuth, start.polar])
    if start is not None:
        energy = replace(energy, winding=start.winding)
    values = _minimise(energy, values)
    for _ in range(COLLISION_ROUNDS):
        field = AxisField(energy.domain, energy.winding, *values)
        axes = field.axes(path.parameters[rows])
        hit = np.flatnonzero(~checker.free_by_distance(centres, axes))
        targets, reasons = nearest_free_axes(
            hit,
            axes[hit],
            normals[hit],
            limits,
            np.radians(job.max_tilt_deg),
            lambda i, tried: checker.free_by_distance(centres[i], tried),
        )
        found = np.array([not reason for reason in reasons], dtype=bool)
        if not found.any():
            break
        energy = _with_targets(energy, hit[found], targets[found])
        values = _minimise(energy, values)
    return AxisField(energy.domain, energy.winding, *values)


def _samples(path: ContactPath) -> Int[ndarray, " k"]:
    """Contacts about SPACING apart along each pass, its ends included."""
    passes = path.pass_index
    begins = np.r_[True, passes[1:] != passes[:-1]]
    moved = np.r_[0.0, np.linalg.norm(np.diff(path.centres, axis=0), axis=1)]
    way = np.cumsum(np.where(begins, 0.0, moved))
    along = way - way[begins][np.cumsum(begins) - 1]
    cell = np.floor(along / SPACING)
    return np.flatnonzero(begins | np.r_[begins[1:], True] | np.r_[True, cell[1:] != cell[:-1]])


def _energy(
    path: ContactPath,
    rows: Int[ndarray, " k"],
    domain: Float[ndarray, "2"],
    checker: CollisionChecker,
    limits: AxisLimits,
    job: PathJob,
) -> AxisEnergy:
    """The energy at these contacts, without targets."""
    centres, normals, passes = path.centres[rows], path.normals[rows], path.pass_index[rows]
    moves = np.flatnonzero(passes[1:] == passes[:-1])
    lengths = np.linalg.norm(centres[moves + 1] - centres[moves], axis=1)
    low, high = (float(t) for t in domain)
    return AxisEnergy(
        path.parameters[rows],
        normals,
        (low, high),
        _winding(path.parameters[rows], normals),
        moves,
        np.maximum(lengths, SPACING / 100) / path.cutter.feed,
        (limits.turn_speed, limits.tilt_speed),
        _bounds(
            normals,
            np.minimum(limits.largest, table_limits(centres, path.cutter, checker.scene.clamping.clearance)),
            limits,
            job,
        ),
        np.zeros(0, dtype=np.int64),
        np.zeros((0, 3)),
    )


def _bounds(
    normals: Float[ndarray, "n 3"], largest: Float[ndarray, " n"], limits: AxisLimits, job: PathJob
) -> AxisBounds:
    """The bounds of the job and the machine; where a normal points beyond the polar limits the tilt is allowed what
    the axis needs."""
    least = max(limits.smallest + MARGIN, LEAST_POLAR)
    largest = np.maximum(largest - MARGIN, least)
    angle = polar_angles(normals)
    needed = np.maximum(angle - largest, least - angle)
    tilt = np.maximum(TILT_SHARE * np.radians(job.max_tilt_deg), needed + REACH)
    lead = min(np.radians(job.least_lead_deg), float(tilt.min()) / 2)
    return AxisBounds(least, largest, lead, tilt)


def _winding(parameters: Float[ndarray, "n 2"], normals: Float[ndarray, "n 3"]) -> int:
    """Whether the azimuth of the normals grows (1) or falls (-1) with s."""
    horizontal = normals[:, 0] + 1j * normals[:, 1]
    turned = np.exp(2j * np.pi * parameters[:, 0])
    return 1 if abs((horizontal * turned.conj()).sum()) >= abs((horizontal * turned).sum()) else -1


def _first(energy: AxisEnergy) -> Float[ndarray, "2 c"]:
    """Control values fitted to axes that lean up from the normals."""
    normals = energy.normals
    horizontal = normals[:, 0] + 1j * normals[:, 1]
    relative = horizontal * np.exp(-2j * np.pi * energy.winding * energy.parameters[:, 0])
    middle = relative.sum()
    azimuth = np.angle(middle) + np.angle(relative * np.conj(middle))
    polar = np.clip(polar_angles(normals) - FIRST_LEAN, FIRST_LOWEST, FIRST_HIGHEST)
    differences = second_differences()
    rough = FIT_ROUGHNESS * len(normals) / differences.shape[0] * (differences.T @ differences)
    weighted = energy.values_at.T * np.abs(horizontal)
    return np.array(
        [
            _solve(weighted @ energy.values_at + rough, weighted @ azimuth),
            _solve(energy.values_at.T @ energy.values_at + rough, energy.values_at.T @ polar),
        ]
    )


def _solve(matrix: Any, right: Float[ndarray, " c"]) -> Float[ndarray, " c"]:
    dense = matrix.toarray()
    return np.asarray(solve(dense + 1e-9 * np.trace(dense) * np.eye(len(dense)), right, assume_a="pos"))


def _with_targets(energy: AxisEnergy, hit: Int[ndarray, " k"], targets: Float[ndarray, "k 3"]) -> AxisEnergy:
    """The energy with targets for the samples `hit` too; a new target replaces an old one."""
    kept = ~np.isin(energy.targeted, hit)
    return replace(
        energy,
        targeted=np.concatenate([energy.targeted[kept], hit]),
        targets=np.vstack([energy.targets[kept], targets]),
    )


def _minimise(energy: AxisEnergy, values: Float[ndarray, "2 c"]) -> Float[ndarray, "2 c"]:
    """Control values of least energy near `values`, by Levenberg's and Marquardt's method."""
    damping = FIRST_DAMPING
    residual, J = energy.terms(values)
    least = residual @ residual
    for _ in range(MAX_STEPS):
        normal = (J.T @ J).toarray()
        gradient = J.T @ residual
        diagonal = normal.diagonal() + 1e-3 * normal.diagonal().mean()
        while damping < LARGEST_DAMPING:
            step = solve(normal + np.diag(damping * diagonal), gradient, assume_a="pos")
            tried = values - step.reshape(values.shape)
            residual, new_J = energy.terms(tried)
            if residual @ residual < least:
                break
            damping *= 5
        else:
            break
        dropped = least - residual @ residual
        values, J, least = tried, new_J, least - dropped
        damping /= 3
        if dropped < LEAST_DROP * least:
            break
    return values
