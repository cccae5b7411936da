"""Forward and inverse kinematics of any chain of two rotary axes and X, Y, Z: composed, no formula per
machine.

With turns T (x -> pivot + Rot(direction, angle) (x - pivot)) of the axes that carry the part, from the part
outward, and turns H of those that carry the tool, a part point p and the tool tip meet in the machine's frame
where

    T_2(T_1(p + part_zero)) = j + H_1(H_2(-L z)) + L z,        R_T2 R_T1 a = R_H1 R_H2 z.

j = (X, Y, Z) is where the tip stands while the head axes are at zero (tool length compensation on); j + L z
is the spindle nose. The second equation always has the form Rot(d1, q1) Rot(d2, q2) v = w, the second
Paden-Kahan subproblem (Murray, Li and Sastry 1994, section 3.3): with c = Rot(d2, q2) v, its parts along d1
and d2 are known, and |c| = |v| leaves two solutions.
"""

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.arrays import dots
from bonecam.machine.machine import Machine, RotaryAxis

UP = np.array([0.0, 0.0, 1.0])
LIMIT_GUARD = 1e-8
"""A solution beyond a limit by less than this (rad) is at the limit: far below the last decimal of any
word."""


def rotate(
    vectors: Float[ndarray, "n 3"], direction: Float[ndarray, "3"], angles: Float[ndarray, "n"]
) -> Float[ndarray, "n 3"]:
    """Rotate each vector by its angle (rad), right-handed about the unit direction (Rodrigues' formula)."""
    cosine = np.cos(angles)[:, None]
    sine = np.sin(angles)[:, None]
    x, y, z = direction
    along = (vectors @ direction)[:, None] * direction
    return (
        along + (vectors - along) * cosine + (vectors @ np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]])) * sine
    )


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
    return axes


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
    return points - np.array(machine.part_zero), tool_axes(machine, rotary)


def inverse_linear(
    machine: Machine, tips: Float[ndarray, "n 3"], rotary: Float[ndarray, "n 2"], tool_length: float = 0.0
) -> Float[ndarray, "n 5"]:
    """The joints that bring the tip to `tips` (part frame, mm) at the given rotary angles (rad)."""
    points = tips + np.array(machine.part_zero)
    for axis in machine.part_axes:
        points = _rotate_about(points, axis, rotary[:, machine.column(axis) - 3])
    return np.column_stack([points - _head_offset(machine, rotary, tool_length), rotary])


def _subproblem(machine: Machine, axes: ndarray) -> tuple[RotaryAxis, RotaryAxis, float, ndarray, ndarray]:
    """The axes 1 and 2, the sign of angle 1, v and w of Rot(d1, sign q1) Rot(d2, q2) v = w."""
    up = np.broadcast_to(UP, axes.shape)
    if len(machine.part_axes) == 2:
        return machine.part_axes[1], machine.part_axes[0], 1.0, axes, up
    if len(machine.part_axes) == 1:
        return machine.part_axes[0], machine.tool_axes[0], -1.0, up, axes
    return machine.tool_axes[0], machine.tool_axes[1], 1.0, up, axes


def _angle_about(direction: ndarray, start: ndarray, end: ndarray) -> ndarray:
    """The angle (rad) about a unit direction that leads the part of `start` across it to that of `end`."""
    sine = np.cross(start, end) @ direction
    cosine = dots(start, end) - (start @ direction) * (end @ direction)
    return np.arctan2(sine, cosine)


def inverse_rotary(
    machine: Machine, axes: Float[ndarray, "n 3"], hold_cone: float = 0.0
) -> tuple[Float[ndarray, "n 2 2"], Bool[ndarray, "n 2"]]:
    """The two solutions of each tool axis, (row, solution, rotary joint), and which joints are free, (row,
    joint).

    Angles are radians within [-pi, pi], NaN where the axis cannot be reached. A joint is free, and its angle
    0, where the tool axis is within `hold_cone` (rad) of the joint's direction: every angle gives this tool
    axis.
    """
    one, two, sign, v, w = _subproblem(machine, axes)
    d1 = np.array(one.direction)
    d2 = np.array(two.direction)
    dot = float(d1 @ d2)
    along1 = w @ d1
    along2 = v @ d2
    a = (along1 - dot * along2) / (1 - dot**2)
    b = (along2 - dot * along1) / (1 - dot**2)
    rest = (1 - (a**2 + b**2 + 2 * a * b * dot)) / (1 - dot**2)
    rest = np.where(rest > -64 * np.finfo(float).eps, np.maximum(rest, 0), np.nan)
    # within rounding of the singular direction the angle is noise: the joint is free there
    cone = max(np.sin(hold_cone), 4 * np.sqrt(np.finfo(float).eps))
    free1 = np.linalg.norm(np.cross(w, d1), axis=1) <= cone
    free2 = np.linalg.norm(np.cross(v, d2), axis=1) <= cone
    found = np.empty((len(axes), 2, 2))
    column1 = machine.column(one) - 3
    column2 = machine.column(two) - 3
    for solution, side in enumerate((1.0, -1.0)):
        c = a[:, None] * d1 + b[:, None] * d2 + (side * np.sqrt(rest))[:, None] * np.cross(d1, d2)
        found[:, solution, column1] = np.where(free1, 0.0, sign * _angle_about(d1, c, w))
        found[:, solution, column2] = np.where(free2, 0.0, _angle_about(d2, v, c))
    free = np.empty((len(axes), 2), dtype=bool)
    free[:, column1] = free1
    free[:, column2] = free2
    unreached = np.isnan(rest)
    found[unreached] = np.nan
    free[unreached] = False
    return found, free


def within_limits(machine: Machine, found: Float[ndarray, "n 2 2"]) -> Bool[ndarray, "n 2"]:
    """Which solutions of `inverse_rotary` lie within the rotary limits, whole turns allowed."""
    inside = np.isfinite(found).all(2)
    guard = LIMIT_GUARD
    for column, axis in enumerate(machine.rotary):
        low, high = axis.limits
        if np.isfinite(low):
            first = found[:, :, column] + 2 * np.pi * np.ceil(
                (low - guard - found[:, :, column]) / (2 * np.pi)
            )
            inside &= first <= high + guard
    return inside
