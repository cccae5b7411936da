"""Gouge avoidance for a ball: its centre is lifted along the contact normal until the ball stays out of what
must remain.

A ball of radius R gouges where the distance of its centre to the obstacle is below R. The true contact cannot
be reached where the ball does not fit (a groove sharper than the ball, a neighbouring condyle): there the
centre is lifted, and the lift is part of the answer. Distances are 1-Lipschitz, so a centre that lacks d mm
is free after a lift of d mm at the earliest, and places between two known distances are bounded
(`mesh/distance.lowest_between`).
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.mesh.distance import MeshDistance, lowest_between

MAX_ROUNDS = 40
"""Rounds of lifting, or of halving moves, after which what is still undecided counts as gouging."""
CONTACT_SHARE = 0.2
"""Part of the gouge tolerance that a ball at rest on a contact may use up."""
MOVE_SHARE = 0.5
"""Part of the gouge tolerance that a ball may use up on a move between two contacts."""
BETWEEN_SHARE = 0.6
"""Part of the gouge tolerance that it may use up between the places where the move is measured: with the mesh and the
control's way no more than all of it."""
FLUTE_SHARE = 0.6
"""Part of the gouge tolerance that the flutes above a ball may use up: more than the ball beside them on a move, and
with the mesh and the control's way no more than all of it."""
MESH_SHARE = 0.2
"""Part of the gouge tolerance that the mesh of the part may take, which balls are kept out of."""
POSTING_SHARE = 0.2
"""Part of the gouge tolerance by which the control may leave the path."""
WORD_ROUNDING = 0.001
"""Words with three decimals put the ball no further off than this, mm."""
INNER_FRACTIONS = (0.25, 0.75)
"""Fractions of a move at which it is measured besides its ends and its middle."""
OVERLIFT = 1.2
"""A lift is the distance lacking times this: where the normal leans to the obstacle, the distance grows by
less than the lift."""


def planned_tolerance(allowed: float) -> float:
    """The gouge tolerance (mm) that paths are planned with where `allowed` mm are.

    Where balls are measured the shares leave a tenth for the rounding of words, which is enough from ten times that on;
    between these places and for flutes they leave nothing, so that a smaller tolerance is planned without the rounding.
    """
    if allowed >= 10 * WORD_ROUNDING:
        return allowed
    return (allowed - WORD_ROUNDING) / (max(BETWEEN_SHARE, FLUTE_SHARE) + MESH_SHARE + POSTING_SHARE)


def flute_slack(allowed: float) -> float:
    """How deep (mm) the flutes of a cutter may be planned into the mesh of the part where a gouge of `allowed` mm is
    tolerated: the cutter is thinner by that when it is held against the part."""
    return FLUTE_SHARE * planned_tolerance(allowed)


def gouge_free_lifts(
    contacts: Float[ndarray, "n 3"],
    normals: Float[ndarray, "n 3"],
    radius: float,
    tolerance: float,
    obstacles: Sequence[MeshDistance],
    joined: Bool[ndarray, " n"],
    max_lift: float,
) -> Float[ndarray, " n"]:
    """How far each ball centre (contact + (radius + lift) * normal) has to be lifted, mm; 0 where the ball
    fits.

    `joined[i]` says that the tool moves straight from contact i to contact i + 1 (the last entry is False):
    the moves are kept free too, all along. NaN where more than `max_lift` mm would be needed.
    """
    at_contact = radius - CONTACT_SHARE * tolerance
    lifts = np.zeros(len(contacts))
    changed = np.arange(len(contacts))
    moves = np.flatnonzero(joined)

    for _ in range(MAX_ROUNDS):
        lifts[changed] = _lift_contacts(
            contacts[changed],
            normals[changed],
            lifts=lifts[changed],
            radius=radius,
            wanted=at_contact,
            obstacles=obstacles,
            max_lift=max_lift,
        )
        centres = contacts + (radius + lifts)[:, None] * normals
        moves = moves[np.isfinite(lifts[moves]) & np.isfinite(lifts[moves + 1])]
        lacking = _most_lacking(centres, moves, radius, tolerance, obstacles)
        gouging = lacking > 0
        if not gouging.any():
            return lifts

        moves = moves[gouging]
        more = lacking[gouging] + CONTACT_SHARE * tolerance
        raised = np.zeros(len(lifts))
        np.maximum.at(raised, moves, more)
        np.maximum.at(raised, moves + 1, more)
        lifts = lifts + raised
        lifts[lifts > max_lift] = np.nan
        changed = np.flatnonzero((raised > 0) & np.isfinite(lifts))
        moves = np.flatnonzero(joined & ((raised > 0) | np.r_[raised[1:] > 0, False]))

    lifts[moves] = lifts[moves + 1] = np.nan
    return lifts


def moves_gouge_free(
    starts: Float[ndarray, "m 3"], ends: Float[ndarray, "m 3"], radius: float, tolerance: float, obstacle: MeshDistance
) -> Bool[ndarray, " m"]:
    """Whether the ball, its centre moved straight from start to end, stays within `tolerance` (mm) of free.

    Proven everywhere on the move, by halving it until its parts are bounded by the distances at their ends. A
    depth of MOVE_SHARE of the tolerance is let through, one of BETWEEN_SHARE never.
    """
    measured = radius - MOVE_SHARE * tolerance
    bounded = radius - BETWEEN_SHARE * tolerance
    free = np.ones(len(starts), dtype=bool)
    move = np.arange(len(starts))
    lengths = np.linalg.norm(ends - starts, axis=1)
    near = obstacle.signed(starts, radius + lengths)
    far = obstacle.signed(ends, radius + lengths)

    for _ in range(MAX_ROUNDS):
        free[move[np.minimum(near, far) < measured]] = False
        lengths = np.linalg.norm(ends - starts, axis=1)
        lowest = lowest_between(np.maximum(near, 0.0), np.maximum(far, 0.0), lengths)
        undecided = free[move] & (lowest < bounded)
        if not undecided.any():
            return free

        move, near, far = move[undecided], near[undecided], far[undecided]
        starts, ends = starts[undecided], ends[undecided]
        middles = (starts + ends) / 2
        halfway = obstacle.signed(middles, radius + lengths[undecided])
        starts, ends = np.vstack([starts, middles]), np.vstack([middles, ends])
        near, far = np.r_[near, halfway], np.r_[halfway, far]
        move = np.r_[move, move]

    free[move] = False
    return free


def _most_lacking(
    centres: Float[ndarray, "n 3"],
    moves: Int[ndarray, " m"],
    radius: float,
    tolerance: float,
    obstacles: Sequence[MeshDistance],
) -> Float[ndarray, " m"]:
    """How far (mm) the worst place of each move from centre i to i + 1 has to rise; 0 where the move is
    free."""
    at_contact = radius - CONTACT_SHARE * tolerance
    on_move = radius - MOVE_SHARE * tolerance
    lacking = np.max([_lacking(o, centres, moves, at_contact, on_move) for o in obstacles], axis=0)

    # Which of the moves that lack nothing where `_lacking` measures them enter an obstacle in between: only long ones
    # can, the others are proven by the distances there
    measured = radius - MOVE_SHARE * tolerance
    bounded = radius - BETWEEN_SHARE * tolerance
    quarters = np.linalg.norm(centres[moves + 1] - centres[moves], axis=1) / 4
    long = (quarters / 2) ** 2 > measured**2 - bounded**2
    doubtful = np.flatnonzero((lacking <= 0) & long)
    starts, ends = centres[moves[doubtful]], centres[moves[doubtful] + 1]
    free = [moves_gouge_free(starts, ends, radius, tolerance, obstacle) for obstacle in obstacles]
    unproven = doubtful[~np.all(free, axis=0)]

    lacking[unproven] = CONTACT_SHARE * tolerance
    return np.asarray(lacking)


def _lacking(
    obstacle: MeshDistance, centres: Float[ndarray, "n 3"], moves: Int[ndarray, " m"], at_contact: float, on_move: float
) -> Float[ndarray, " m"]:
    """By how much the distance falls below `on_move` (mm) along the move from centre i to centre i + 1.

    Measured in the middle of the move; where the bound between the middle and the ends (which are at least
    `at_contact` away) does not rule a lack out, at INNER_FRACTIONS too.
    """
    starts = centres[moves]
    ends = centres[moves + 1]
    half = np.linalg.norm(ends - starts, axis=1) / 2
    # a move that is shorter than the distance of its end from the surface cannot cross the surface
    distance = obstacle.unsigned if (half < at_contact).all() else obstacle.signed
    middle = distance((starts + ends) / 2, at_contact)
    lacking = np.maximum(on_move - middle, 0.0)

    ends_away = np.full(len(moves), at_contact)
    lowest = lowest_between(ends_away, np.clip(middle, 0.0, at_contact), half)
    unsure = np.flatnonzero(lowest < on_move)
    for fraction in INNER_FRACTIONS:
        points = (1 - fraction) * starts[unsure] + fraction * ends[unsure]
        lacking[unsure] = np.maximum(lacking[unsure], on_move - distance(points, on_move))
    return lacking


def _lift_contacts(
    contacts: Float[ndarray, "n 3"],
    normals: Float[ndarray, "n 3"],
    lifts: Float[ndarray, " n"],
    radius: float,
    wanted: float,
    obstacles: Sequence[MeshDistance],
    max_lift: float,
) -> Float[ndarray, " n"]:
    """The lifts (mm) at which each ball centre is `wanted` away from all obstacles; NaN above `max_lift`."""
    lifts = lifts.copy()
    gouging = np.arange(len(contacts))
    for _ in range(MAX_ROUNDS):
        centres = contacts[gouging] + (radius + lifts[gouging])[:, None] * normals[gouging]
        lacking = wanted - np.min([obstacle.signed(centres, wanted) for obstacle in obstacles], axis=0)
        gouging, lacking = gouging[lacking > 0], lacking[lacking > 0]
        if not len(gouging):
            return lifts

        lifts[gouging] += OVERLIFT * lacking + 0.1 * (radius - wanted)
        lifts[gouging[lifts[gouging] > max_lift]] = np.nan
        gouging = gouging[np.isfinite(lifts[gouging])]

    lifts[gouging] = np.nan
    return lifts
