"""Where a path must be lifted so that the rotary axes of a machine can be rewound.

Between two cuts the axes must stand within their limits both before and after the rewind, as the tool leaves and comes
back to one place. That is a row of the path, or a place on the way between two rows where an axis is at its limit: with
limits just a turn apart there is no other.
"""

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import lengths
from bonecam.errors import MachineError
from bonecam.machine.kinematics import inverse_rotary
from bonecam.machine.machine import Machine
from bonecam.nc.posting.rotary.choice import choose_angles, clear_rapids
from bonecam.nc.posting.rotary.steps import FULL_TURN
from bonecam.nc.posting.rows.split import POLE_PASS, between
from bonecam.tool.path import MoveKind

FINE = np.radians(10.0)
"""A joint turns by no more between the places at which limits are asked, rad: as in the feed moves of a program."""
FINEST = 12
"""Times that moves are halved for it."""
HALVINGS = 50
"""Times that a move is halved to find where an axis is at its limit."""


def lift_places(
    machine: Machine, axes: Float[ndarray, "n 3"], kinds: Int[ndarray, "n"], blocked: Float[ndarray, " b"]
) -> tuple[Float[ndarray, " k"], Float[ndarray, "k 3"]]:
    """The places of a path from which it is lifted, as few as can be and none of those `blocked`, and the tool axes
    there: row i + f is f on the way from row i to the next. MachineError where the axes come to their limits and no
    lift helps."""
    is_cut = (kinds[:-1] == MoveKind.CUT) & (kinds[1:] == MoveKind.CUT)
    fine = _fine_places(machine, axes, kinds)
    at_limits = _at_limits(machine, axes, fine, is_cut)
    # where the tool comes back to the place that it leaves, the place follows itself
    twice = np.r_[np.flatnonzero(is_cut), at_limits]
    places = np.r_[fine, at_limits, twice]
    again = np.arange(len(places)) >= len(places) - len(twice)
    order = np.lexsort((again, places))
    places, again = places[order], again[order]
    turned = _axes_at(axes, places)

    row = np.ceil(places).astype(np.int64)
    left = np.where(again, places, row - 1.0)
    liftable = (again | ~is_cut[row - 1]) & (row > 0) & ~np.isin(left, blocked)
    try:
        choice = choose_angles(machine, turned, kinds[row], 0.0, liftable=liftable)
    except MachineError as error:
        at = int(row[error.evidence["row"]])
        what = str(error).partition(": ")[2]
        raise MachineError(f"point {at}: {what}", **{**error.evidence, "row": at}) from error
    lifts = choice.rewinds & ~clear_rapids(kinds[row], turned)
    back = np.where(again, places, row)[lifts]
    return left[lifts], _axes_at(axes, back)


def _axes_at(axes: Float[ndarray, "n 3"], places: Float[ndarray, " k"]) -> Float[ndarray, "k 3"]:
    """The unit axes at places of a path."""
    row = np.minimum(np.floor(places), len(axes) - 2).astype(np.int64)
    return between(axes, axes, 0.0, row, places - row)[1]


def _fine_places(machine: Machine, axes: Float[ndarray, "n 3"], kinds: Int[ndarray, "n"]) -> Float[ndarray, " k"]:
    """The rows of a path and, on the moves but rapids of a machine with limits on turns, so many places between them
    that no joint turns by more than FINE: beside the pole the axes turn round between two rows."""
    places = np.arange(len(axes), dtype=np.float64)
    bounded = np.array([axis.bounded for axis in machine.rotary])
    for _ in range(FINEST if any(axis.has_choice for axis in machine.rotary) else 0):
        turned = _axes_at(axes, places)
        change = np.diff(inverse_rotary(machine, turned)[0][:, :, bounded], axis=0)
        wide = np.abs(_wrapped(change)).max(axis=(1, 2)) > FINE
        wide &= lengths(np.diff(turned, axis=0)) > POLE_PASS
        wide &= kinds[np.floor(places[:-1]).astype(np.int64) + 1] != MoveKind.RAPID
        if not wide.any():
            break
        places = np.sort(np.r_[places, (places[:-1] + places[1:])[wide] / 2])
    return places


def _at_limits(
    machine: Machine, axes: Float[ndarray, "n 3"], fine: Float[ndarray, " m"], is_cut: Bool[ndarray, "n-1"]
) -> Float[ndarray, " k"]:
    """The places within cuts where a solution has an axis at a limit, in any turn, between two of `fine` ones."""
    cut = np.flatnonzero(is_cut[np.floor(fine[:-1]).astype(np.int64)])
    solutions, _ = inverse_rotary(machine, _axes_at(axes, fine))
    places = [np.zeros(0)]
    for column, axis in enumerate(machine.rotary):
        for limit in {round(limit % FULL_TURN, 12) for limit in axis.limits if axis.has_choice}:
            for solution in range(2):
                off = solutions[:, solution, column] - limit
                start = _wrapped(off[cut])
                end = start + _wrapped(off[cut + 1] - off[cut])
                crossing = cut[(start * end < 0) & (np.abs(start) + np.abs(end) < np.pi)]
                ends = fine[crossing], fine[crossing + 1]
                places.append(_halved(machine, axes, ends=ends, solution=solution, column=column, limit=limit))
    return np.unique(np.concatenate(places))


def _halved(
    machine: Machine,
    axes: Float[ndarray, "n 3"],
    ends: tuple[Float[ndarray, " k"], Float[ndarray, " k"]],
    solution: int,
    column: int,
    limit: float,
) -> Float[ndarray, " k"]:
    """The places between pairs of places at which a joint passes a limit (rad)."""

    def side(places: Float[ndarray, " k"]) -> Float[ndarray, " k"]:
        solutions, _ = inverse_rotary(machine, _axes_at(axes, places))
        return np.sign(_wrapped(solutions[:, solution, column] - limit))

    low, high = ends
    first = side(low)
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        same = side(middle) == first
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return high


def _wrapped(angles: ndarray) -> ndarray:
    """Angles (rad) within half a turn of zero."""
    return angles - FULL_TURN * np.round(angles / FULL_TURN)
