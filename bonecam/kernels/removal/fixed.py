"""How far the whole tool stays from what is never cut, compiled: the table's plane, and upright cylinders
that stand for chuck, table and what stands on it."""

import numpy as np
from numpy import ndarray

from bonecam.kernels import inner_njit, njit
from bonecam.kernels.removal.convex import column_distance
from bonecam.kernels.removal.flutes import piece_pose, travel_of
from bonecam.kernels.removal.sweep import TOOL_STEP, Pieces, ways_of


@inner_njit()
def _distance(foot: ndarray, axis: ndarray, section: ndarray, columns: ndarray, closed: bool, within: float) -> float:
    """The distance of one section from plane and cylinders, or `within`; below the plane it is negative."""
    near = within
    from_axis = foot.copy()
    if closed:
        drop = np.sqrt(max(1.0 - axis[2] * axis[2], 0.0))
        for side in range(2):
            near = min(near, foot[2] + section[side] * axis[2] - section[2 + side] * drop)
    for c in range(len(columns)):
        if near > 0.0:
            from_axis[0], from_axis[1] = foot[0] - columns[c, 3], foot[1] - columns[c, 4]
            near = min(near, column_distance(from_axis, axis, section, columns[c], near))
    return near


@inner_njit()
def _ball_distance(foot: ndarray, radius: float, columns: ndarray, closed: bool) -> float:
    near = foot[2] if closed else np.inf
    for c in range(len(columns)):
        out = np.hypot(foot[0] - columns[c, 3], foot[1] - columns[c, 4]) - columns[c, 0]
        up = max(foot[2] - columns[c, 1], columns[c, 2] - foot[2])
        near = min(near, min(max(out, up), 0.0) + np.hypot(max(out, 0.0), max(up, 0.0)))
    return near - radius


@njit(cache=True, nogil=True)
def fixed_clearance(
    pieces: Pieces, sections: ndarray, radius: float, columns: ndarray, closed: bool, within: float
) -> tuple[float, int, int, int]:
    """The least distance (mm) of the tool from the fixed bodies over all pieces, the piece and the section where it
    is (-1: more than `within`), and the first piece in which they meet (-1: none does).

    `sections` (s, 4): from, to, radius at either, told from the ball's centre; number s is the ball of `radius`.
    `columns` (c, 5): radius, z of top and bottom, x and y; `closed`: nothing may be below z = 0. Told is the distance
    at poses a TOOL_STEP or an eighth of it apart, where half of the way from one to the next may bring it below the
    least.
    """
    foot, axis = np.empty(3), np.empty(3)
    ways = ways_of(pieces)
    least = within
    where = -1
    what = -1
    touched = -1
    for i in range(len(pieces.starts)):
        for s in range(len(sections) + 1):
            ball = s == len(sections)
            reach = 0.0
            if not ball:
                reach = np.hypot(sections[s, 1], max(sections[s, 2], sections[s, 3]))
            travel = travel_of(ways, i, reach)
            step = max(travel, TOOL_STEP)
            while True:
                steps = max(int(np.ceil(travel / step)), 1)
                slack = travel / steps / 2
                near = least
                bare = np.inf
                for k in range(steps):
                    piece_pose(ways, i, (k + 0.5) / steps, foot, axis)
                    if ball:
                        distance = _ball_distance(foot, radius, columns, closed)
                    else:
                        distance = _distance(foot, axis, sections[s], columns, closed, max(near, 0.0) + slack)
                    bare = min(bare, distance)
                    near = min(near, distance - slack)
                if bare <= 0.0 or near >= least or step <= max(TOOL_STEP, near / 8):
                    break
                step = max(TOOL_STEP, step / 4)
            if bare < least:
                least, where, what = bare, i, s
            if bare <= 0.0 and touched < 0:
                touched = i
    return least, where, what, touched
