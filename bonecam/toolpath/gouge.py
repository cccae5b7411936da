"""The ball must not enter what is to stay: centres are lifted along the contact normal until it is free.

Where the ball does not fit (a groove sharper than the ball, a neighbouring condyle) the true contact cannot be reached:
`distance(centre, mesh) >= R - tolerance` is bought with a lift, and the lift is told.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.mesh.distance import LayeredDistance

ROUNDS = 40
FRACTIONS = (0.25, 0.5, 0.75)
CONTACT_SHARE, MOVE_SHARE = 0.2, 0.5
"""Parts of the tolerance a contact, and a place between two contacts, may use up."""


def lift_free(
    contacts: Float[ndarray, "n 3"],
    normals: Float[ndarray, "n 3"],
    radius: float,
    tolerance: float,
    obstacles: Sequence[LayeredDistance],
    joined: Bool[ndarray, " n"],
    limit: float,
) -> Float[ndarray, " n"]:
    """Lift of every centre (mm, 0 where the ball fits) that frees it and the moves between; NaN where `limit` does not suffice.

    `joined[i]` says that the tool moves straight from contact i to contact i + 1 (the last entry is False).
    """
    lifts = _lift_contacts(contacts, normals, radius, radius - CONTACT_SHARE * tolerance, obstacles, limit)
    moves = np.flatnonzero(joined)
    for _ in range(ROUNDS):
        centres = contacts + (radius + lifts)[:, None] * normals
        moves = moves[np.isfinite(lifts[moves]) & np.isfinite(lifts[moves + 1])]
        wanted = radius - MOVE_SHARE * tolerance
        need = np.max([_lacking(obstacle, centres, moves, wanted) for obstacle in obstacles], axis=0)
        bad = need > 0
        if not bad.any():
            return lifts
        moves, need = moves[bad], need[bad] + CONTACT_SHARE * tolerance
        raised = np.zeros(len(lifts))
        np.maximum.at(raised, moves, need)
        np.maximum.at(raised, moves + 1, need)
        lifts = lifts + raised
        lifts[lifts > limit] = np.nan
        moves = np.flatnonzero(joined & ((raised > 0) | np.r_[raised[1:] > 0, False]))
    lifts[moves] = lifts[moves + 1] = np.nan
    return lifts


def _lacking(obstacle: LayeredDistance, centres: ndarray, moves: Int[ndarray, " m"], wanted: float) -> Float[ndarray, " m"]:
    """What the distance lacks at most along each move from centre i to i + 1, at FRACTIONS of it.

    Distance changes no faster than the place: where that rules a lack out by the distances at the ends, nothing is asked.
    """
    need = np.zeros(len(moves))
    length = np.linalg.norm(centres[moves + 1] - centres[moves], axis=1)
    known = np.full(len(centres), -np.inf)
    if obstacle.layered:
        ends = np.union1d(moves, moves + 1)
        known[ends] = obstacle.signed(centres[ends], wanted)
    for fraction in FRACTIONS:
        bound = np.maximum(known[moves] - fraction * length, known[moves + 1] - (1 - fraction) * length)
        ask = np.flatnonzero(bound < wanted)
        places = (1 - fraction) * centres[moves[ask]] + fraction * centres[moves[ask] + 1]
        need[ask] = np.maximum(need[ask], wanted - obstacle.signed(places, wanted))
    return need


def _lift_contacts(
    contacts: ndarray, normals: ndarray, radius: float, wanted: float, obstacles: Sequence[LayeredDistance], limit: float
) -> ndarray:
    """Raise each ball by what it lacks, again and again: the distance never grows faster than the lift."""
    lifts = np.zeros(len(contacts))
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
