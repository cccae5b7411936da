"""Forward and inverse kinematics of any chain of one or two rotary axes and X, Y, Z: composed, no formula per
machine. A chain of one rotary axis has a second one that is locked at zero.

With turns T (x -> pivot + Rot(direction, angle) (x - pivot)) of the axes that carry the part, from the part
outward, and turns H of those that carry the tool, a part point p and the tool tip meet in the machine's frame
where

    T_2(T_1(F p + part_zero)) = j + H_1(H_2(-L z)) + L z,        R_T2 R_T1 F a = R_H1 R_H2 z.

F turns the part's frame into the machine's, all rotary axes at zero.
j = (X, Y, Z) is where the tip stands while the head axes are at zero (tool length compensation on); j + L z
is the spindle nose. The second equation always has the form Rot(d1, q1) Rot(d2, q2) v = w, the second
Paden-Kahan subproblem (Murray, Li and Sastry 1994, section 3.3): with c = Rot(d2, q2) v, its parts along d1
and d2 are known, and |c| = |v| leaves two solutions. Where an axis is locked, the other one comes as near as it can.
"""

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.arrays import dots, lengths
from bonecam.machine.bodies import BED
from bonecam.machine.machine import Machine
from bonecam.machine.machine_file import RotaryAxis

UP = np.array([0.0, 0.0, 1.0])
LIMIT_GUARD = 1e-8
"""A solution beyond a limit by less than this (rad) is at the limit: far below the last decimal of any
word."""
LOCK_GUARD = np.radians(1.5)
"""A machine with a locked axis is asked for tool axes no farther (rad) from those that it has: between two of these,
30 degrees apart, the great circle leaves its small circle by 1 degree."""


def rotate(
    vectors: Float[ndarray, "n 3"], direction: Float[ndarray, "3"], angles: Float[ndarray, "n"]
) -> Float[ndarray, "n 3"]:
    """Rotate each vector by its angle (rad), right-handed about the unit direction (Rodrigues' formula)."""
    # a coordinate a row: numpy's loops are short otherwise
    columns = np.ascontiguousarray(vectors.T)
    along = direction[:, None] * (direction @ columns)
    across = _cross_matrix(direction) @ columns
    return np.ascontiguousarray((along + (columns - along) * np.cos(angles) + across * np.sin(angles)).T)


def _cross_matrix(d: Float[ndarray, "3"]) -> Float[ndarray, "3 3"]:
    """The matrix M with M v = d x v, so that rows V become V x d by V M."""
    x, y, z = d
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def _rotate_about(points: ndarray, axis: RotaryAxis, angles: ndarray) -> ndarray:
    """The points (n, 3) rotated about a rotary axis through its pivot, each by its angle (rad)."""
    pivot = np.array(axis.pivot)
    return pivot + rotate(points - pivot, np.array(axis.direction), angles)


def tool_axes(machine: Machine, rotary: Float[ndarray, "n 2"]) -> Float[ndarray, "n 3"]:
    """Unit tool axes in the part's frame, tip to spindle, from the rotary joints (rad)."""
    axes = np.tile(UP, (len(rotary), 1))
    for axis in reversed(machine.tool_axes):
        axes = rotate(axes, np.array(axis.direction), rotary[:, machine.column(axis) - 3])
    for axis in reversed(machine.part_axes):
        axes = rotate(axes, np.array(axis.direction), -rotary[:, machine.column(axis) - 3])
    return machine.in_part(axes)


def _head_offset(machine: Machine, rotary: ndarray, tool_length: float) -> ndarray:
    """The vector from j to the tip, mm; zero while the head axes are at zero.

    Pivots of head axes are measured from the spindle nose.
    """
    tip = np.tile(-tool_length * UP, (len(rotary), 1))
    for axis in reversed(machine.tool_axes):
        tip = _rotate_about(tip, axis, rotary[:, machine.column(axis) - 3])
    return tip + tool_length * UP


def forward(
    machine: Machine, joints: Float[ndarray, "n 5"], tool_length: float = 0.0
) -> tuple[Float[ndarray, "n 3"], Float[ndarray, "n 3"]]:
    """Tips (mm) and unit tool axes in the part's frame from the joints (mm, rad)."""
    rotary = joints[:, 3:]
    points = joints[:, :3] + _head_offset(machine, rotary, tool_length)
    for axis in reversed(machine.part_axes):
        points = _rotate_about(points, axis, -rotary[:, machine.column(axis) - 3])
    return machine.in_part(points - np.array(machine.part_zero)), tool_axes(machine, rotary)


def link_poses(
    machine: Machine, link: str, joints: Float[ndarray, "n 5"], tool_length: float = 0.0
) -> tuple[Float[ndarray, "n 3 3"], Float[ndarray, "n 3"]]:
    """Rotations, and places (mm) of its origin, of what a link carries (`machine.bodies.LinkBody`), in the part's frame
    at the joints (mm, rad)."""
    part_side = [axis.letter for axis in machine.part_axes] + [BED]
    heads = [axis.letter for axis in machine.tool_axes]
    carrying = machine.part_axes[: part_side.index(link)] if link in part_side else machine.part_axes
    turned_by = machine.tool_axes[: heads.index(link) + 1] if link in heads else ()

    def placed(point: ndarray) -> ndarray:
        points = np.tile(point, (len(joints), 1))
        for axis in reversed(turned_by):
            points = _rotate_about(points, axis, joints[:, machine.column(axis)])
        if link not in part_side:
            points = points + joints[:, :3] + tool_length * UP
        for axis in reversed(carrying):
            points = _rotate_about(points, axis, -joints[:, machine.column(axis)])
        return machine.in_part(points - np.array(machine.part_zero))

    origins = placed(np.zeros(3))
    return np.stack([placed(unit) - origins for unit in np.eye(3)], axis=2), origins


def inverse_linear(
    machine: Machine, tips: Float[ndarray, "n 3"], rotary: Float[ndarray, "n 2"], tool_length: float = 0.0
) -> Float[ndarray, "n 5"]:
    """The joints that bring the tip to `tips` (part frame, mm) at the given rotary angles (rad)."""
    points = machine.in_machine(tips) + np.array(machine.part_zero)
    for axis in machine.part_axes:
        points = _rotate_about(points, axis, rotary[:, machine.column(axis) - 3])
    return np.column_stack([points - _head_offset(machine, rotary, tool_length), rotary])


def _subproblem(machine: Machine, axes: ndarray) -> tuple[RotaryAxis, RotaryAxis, float, ndarray, ndarray]:
    """The axes 1 and 2, the sign of angle 1, v and w of Rot(d1, sign q1) Rot(d2, q2) v = w."""
    axes = machine.in_machine(axes)
    up = np.broadcast_to(UP, axes.shape)
    if len(machine.part_axes) == 2:
        return machine.part_axes[1], machine.part_axes[0], 1.0, axes, up
    if len(machine.part_axes) == 1:
        return machine.part_axes[0], machine.tool_axes[0], -1.0, up, axes
    return machine.tool_axes[0], machine.tool_axes[1], 1.0, up, axes


def _angle_about(direction: ndarray, start: ndarray, end: ndarray) -> ndarray:
    """The angle (rad) about a unit direction that leads the part of `start` across it to that of `end`."""
    sine = dots(start, end @ _cross_matrix(direction))
    cosine = dots(start, end) - (start @ direction) * (end @ direction)
    return np.arctan2(sine, cosine)


def inverse_rotary(
    machine: Machine, axes: Float[ndarray, "n 3"], hold_cone: float = 0.0, lock_guard: float = LOCK_GUARD
) -> tuple[Float[ndarray, "n 2 2"], Bool[ndarray, "n 2"]]:
    """The two solutions of each tool axis, (row, solution, rotary joint), and which joints are free, (row,
    joint).

    Angles are radians within [-pi, pi], NaN where the axis cannot be reached. A joint is free, and its angle
    0, where the tool axis is within `hold_cone` (rad) of the joint's direction: every angle gives this tool
    axis. Where an axis is locked there is one solution, that of the nearest tool axis, none beyond `lock_guard` (rad).
    """
    one, two, sign, v, w = _subproblem(machine, axes)
    d1 = np.array(one.direction)
    d2 = np.array(two.direction)
    # within rounding of the singular direction the angle is noise: the joint is free there
    cone = max(np.sin(hold_cone), 4 * np.sqrt(np.finfo(float).eps))
    free1 = lengths(w @ _cross_matrix(d1)) <= cone
    free2 = lengths(v @ _cross_matrix(d2)) <= cone
    column1 = machine.column(one) - 3
    column2 = machine.column(two) - 3
    if one.locked or two.locked:
        free = np.zeros((len(axes), 2), dtype=bool)
        solutions = np.full((len(axes), 2, 2), np.nan)
        q1, q2 = (np.full(len(w), axis.limits[0]) for axis in (one, two))
        if not one.locked:
            q1 = sign * _angle_about(d1, rotate(v, d2, q2), w)
            free[:, column1] = free1
        elif not two.locked:
            q2 = _angle_about(d2, v, rotate(w, d1, -sign * q1))
            free[:, column2] = free2
        solutions[:, 0, column1] = np.where(free[:, column1], 0.0, q1)
        solutions[:, 0, column2] = np.where(free[:, column2], 0.0, q2)
        off = np.linalg.norm(tool_axes(machine, solutions[:, 0]) - axes, axis=1)
        solutions[off > 2 * np.sin(min(lock_guard, np.pi) / 2)] = np.nan
        return solutions, free
    dot = float(d1 @ d2)
    along1 = w @ d1
    along2 = v @ d2
    a = (along1 - dot * along2) / (1 - dot**2)
    b = (along2 - dot * along1) / (1 - dot**2)
    rest = (1 - (a**2 + b**2 + 2 * a * b * dot)) / (1 - dot**2)
    rest = np.where(rest > -64 * np.finfo(float).eps, np.maximum(rest, 0), np.nan)
    solutions = np.empty((len(axes), 2, 2))
    for solution, side in enumerate((1.0, -1.0)):
        c = a[:, None] * d1 + b[:, None] * d2 + (side * np.sqrt(rest))[:, None] * np.cross(d1, d2)
        solutions[:, solution, column1] = np.where(free1, 0.0, sign * _angle_about(d1, c, w))
        solutions[:, solution, column2] = np.where(free2, 0.0, _angle_about(d2, v, c))
    free = np.empty((len(axes), 2), dtype=bool)
    free[:, column1] = free1
    free[:, column2] = free2
    unreached = np.isnan(rest)
    solutions[unreached] = np.nan
    free[unreached] = False
    return solutions, free


def within_limits(machine: Machine, found: Float[ndarray, "n 2 2"]) -> Bool[ndarray, "n 2"]:
    """Which solutions of `inverse_rotary` lie within the rotary limits, whole turns allowed."""
    inside = np.isfinite(found[:, :, 0] + found[:, :, 1])
    guard = LIMIT_GUARD
    for column, axis in enumerate(machine.rotary):
        low, high = axis.limits
        if np.isfinite(low):
            first = found[:, :, column] + 2 * np.pi * np.ceil((low - guard - found[:, :, column]) / (2 * np.pi))
            inside &= first <= high + guard
    return inside
