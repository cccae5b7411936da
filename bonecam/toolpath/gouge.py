"""The ball must not enter what is to stay: centres are lifted along the contact normal until it is free.

Where the ball does not fit (a groove sharper than the ball, a neighbouring condyle) the true contact cannot
be reached: `distance(centre, mesh) >= R - tolerance` is bought with a lift, and the lift is told.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.mesh.distance import MeshDistance, lowest_between

ROUNDS = 40
QUARTERS = (0.25, 0.75)
CONTACT_SHARE, MOVE_SHARE = 0.2, 0.5
"""Parts of the tolerance a contact, and a place between two contacts, may use up."""


def lift_free(
    contacts: Float[ndarray, "n 3"],
    normals: Float[ndarray, "n 3"],
    radius: float,
    tolerance: float,
    obstacles: Sequence[MeshDistance],
    joined: Bool[ndarray, " n"],
    limit: float,
) -> Float[ndarray, " n"]:
    """Lift of every centre (mm, 0 where the ball fits) that frees it and the moves between; NaN where `limit`
    does not suffice.

    `joined[i]` says that the tool moves straight from contact i to contact i + 1 (the last entry is False).
    """
    clear, wanted = radius - CONTACT_SHARE * tolerance, radius - MOVE_SHARE * tolerance
    lifts = np.zeros(len(contacts))
    moved, moves = np.arange(len(contacts)), np.flatnonzero(joined)
    for _ in range(ROUNDS):
        lifts[moved] = _lifted(contacts[moved], normals[moved], lifts[moved], radius, clear, obstacles, limit)
        centres = contacts + (radius + lifts)[:, None] * normals
        moves = moves[np.isfinite(lifts[moves]) & np.isfinite(lifts[moves + 1])]
        need = np.max([_lacking(obstacle, centres, moves, clear, wanted) for obstacle in obstacles], axis=0)
        bad = need > 0
        if not bad.any():
            return lifts
        moves, need = moves[bad], need[bad] + CONTACT_SHARE * tolerance
        raised = np.zeros(len(lifts))
        np.maximum.at(raised, moves, need)
        np.maximum.at(raised, moves + 1, need)
        lifts = lifts + raised
        lifts[lifts > limit] = np.nan
        moved = np.flatnonzero((raised > 0) & np.isfinite(lifts))
        moves = np.flatnonzero(joined & ((raised > 0) | np.r_[raised[1:] > 0, False]))
    lifts[moves] = lifts[moves + 1] = np.nan
    return lifts


def stays_out(
    starts: Float[ndarray, "m 3"],
    ends: Float[ndarray, "m 3"],
    radius: float,
    tolerance: float,
    obstacle: MeshDistance,
) -> Bool[ndarray, " m"]:
    """Whether the ball, moved straight from start to end, enters the obstacle by no more than tolerance
    allows a move, anywhere."""
    wanted, between = radius - MOVE_SHARE * tolerance, radius - (MOVE_SHARE + CONTACT_SHARE) * tolerance
    answer, owner = np.ones(len(starts), dtype=bool), np.arange(len(starts))
    near, far = (
        obstacle.signed(places, radius + np.linalg.norm(ends - starts, axis=1)) for places in (starts, ends)
    )
    for _ in range(ROUNDS):
        answer[owner[np.minimum(near, far) < wanted]] = False
        lengths = np.linalg.norm(ends - starts, axis=1)
        open_ = answer[owner] & (
            lowest_between(np.maximum(near, 0.0), np.maximum(far, 0.0), lengths) < between
        )
        if not open_.any():
            return answer
        owner, starts, ends, near, far = owner[open_], starts[open_], ends[open_], near[open_], far[open_]
        middle = (starts + ends) / 2
        halfway = obstacle.signed(middle, radius + lengths[open_])
        starts, ends = np.vstack([starts, middle]), np.vstack([middle, ends])
        owner, near, far = np.r_[owner, owner], np.r_[near, halfway], np.r_[halfway, far]
    answer[owner] = False
    return answer


def _lacking(
    obstacle: MeshDistance, centres: ndarray, moves: Int[ndarray, " m"], clear: float, wanted: float
) -> Float[ndarray, " m"]:
    """What the distance lacks at most along each move from centre i to i + 1: at its middle, and where that
    does not rule a lack out between it and the ends, at least `clear`, at the quarters too.
    """
    starts, ends = centres[moves], centres[moves + 1]
    half = np.linalg.norm(ends - starts, axis=1) / 2
    # no way shorter than its end's distance from the surface leads through it
    distance = obstacle.unsigned if (half < clear).all() else obstacle.signed
    middle = distance((starts + ends) / 2, clear)
    need = np.maximum(wanted - middle, 0.0)
    ask = np.flatnonzero(
        lowest_between(np.full(len(moves), clear), np.clip(middle, 0.0, clear), half) < wanted
    )
    for fraction in QUARTERS:
        places = (1 - fraction) * starts[ask] + fraction * ends[ask]
        need[ask] = np.maximum(need[ask], wanted - distance(places, wanted))
    return need


def _lifted(
    contacts: ndarray,
    normals: ndarray,
    lifts: ndarray,
    radius: float,
    wanted: float,
    obstacles: Sequence[MeshDistance],
    limit: float,
) -> Float[ndarray, " n"]:
    """Raise each ball by what it lacks, again and again: the distance never grows faster than the lift."""
    lifts = lifts.copy()
    active = np.arange(len(contacts))
    for _ in range(ROUNDS):
        centres = contacts[active] + (radius + lifts[active])[:, None] * normals[active]
        lack = wanted - np.min([obstacle.signed(centres, wanted) for obstacle in obstacles], axis=0)
        active, lack = active[lack > 0], lack[lack > 0]
        if not len(active):
            return lifts
        lifts[active] += 1.2 * lack + 0.1 * (radius - wanted)
        lifts[active[lifts[active] > limit]] = np.nan
        active = active[np.isfinite(lifts[active])]
    lifts[active] = np.nan
    return lifts
