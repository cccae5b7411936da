"""Lead arcs: the ball comes onto its first contact, and leaves the last one, on an arc tangential to the cut.

The arc lies in the plane of the cut and of the contact's normal, or else of the tool axis; the axis stands still on it.
It removes nothing but what the cut behind it has removed, and is proven as links are. Onto a cut that begins in
material the first move of the cut is a chord of the arc. A smaller one is tried where a large one does not fit; where
none does, the way is straight.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import angles_between, dots, lengths, unit
from bonecam.planning.links.direct import Contacts, contacts_of
from bonecam.planning.links.link_space import LinkSpace, Polyline

SWEEP = np.radians(80.0)
"""Angle of an arc, radians: at its far end the tool comes and goes nearly along the normal."""
STEPS = 5
"""Straight moves of an arc."""
SHARES = (1.0, 0.5, 0.25)
"""Radii of the arcs that are tried, as shares of the lead radius."""
TANGENT = np.radians(20.0)
"""A cut whose first move turns off by less from the move that leads to it (radians) begins tangentially."""
CHORDS = (1, 2)
"""Straight moves of an arc whose chord is the first move of the cut: the longer one turns off by 16 degrees."""
LEAST_SIDE = 0.5
"""A unit vector bends an arc to its side if as much of it stands across the cut."""
NEAR = 3.0
"""A cut has removed what lies round its end within so many radii of the ball."""


OfLevel = tuple[Float[ndarray, "n 3"], Float[ndarray, "n 3"], Float[ndarray, "n 3"]]
"""Ball centres, normals and axes of all contacts of a level, which runs index."""


@dataclass(frozen=True, eq=False)
class _Ends:
    """Ends of cuts: `contacts`, the unit directions `away` from the cut along its tangent, and the poses of the cut
    near each end that have removed material when the tool is there: none where it begins."""

    contacts: Contacts
    away: Float[ndarray, "k 3"]
    removed: Sequence[Polyline]

    def take(self, which: Int[ndarray, " m"]) -> "_Ends":
        """Some of the ends."""
        removed = [self.removed[k] for k in which]
        return _Ends(contacts_of(self.contacts, which), self.away[which], removed)


def arcs_to(space: LinkSpace, contacts: OfLevel, runs: Sequence[Int[ndarray, " _"]]) -> list[Polyline | None]:
    """The largest arc of at most the lead radius of `space` that leads to the begin of each run, from the end of the
    first move of the cut back to its far end, all in air; None where there is room for none."""
    centres, _, axes = contacts
    first, then = (np.array([run[k] for run in _long(runs)], dtype=np.int64) for k in (0, 1))
    removed = [(centres[:0], axes[:0])] * len(first)
    ends = _Ends(contacts_of(contacts, first), unit(centres[first] - centres[then]), removed)
    return _of_all(runs, _lead_arcs(space, ends))


def arcs_from(space: LinkSpace, contacts: OfLevel, runs: Sequence[Int[ndarray, " _"]]) -> list[Polyline | None]:
    """As `arcs_to`, the arcs that lead from the ends of the runs, behind what each has removed."""
    centres, _, axes = contacts
    last, before = (np.array([run[-k] for run in _long(runs)], dtype=np.int64) for k in (1, 2))
    around = NEAR * space.ball_radius
    near = [run[lengths(centres[run] - centres[run[-1]]) <= around] for run in _long(runs)]
    removed = [(centres[k], axes[k]) for k in near]
    ends = _Ends(contacts_of(contacts, last), unit(centres[last] - centres[before]), removed)
    return _of_all(runs, _lead_arcs(space, ends))


def _long(runs: Sequence[Int[ndarray, " _"]]) -> list[Int[ndarray, " _"]]:
    """The runs of more than one contact: others have no direction."""
    return [run for run in runs if len(run) > 1]


def _of_all(runs: Sequence[Int[ndarray, " _"]], arcs: Sequence[Polyline | None]) -> list[Polyline | None]:
    """The arcs of the long runs, and None for the others."""
    arcs_left = iter(arcs)
    return [next(arcs_left) if len(run) > 1 else None for run in runs]


def _lead_arcs(space: LinkSpace, ends: _Ends) -> list[Polyline | None]:
    """The largest arc that leads away from each end; None where there is room for none."""
    arcs: list[Polyline | None] = [None] * len(ends.away)
    for share, along, chord in product(SHARES, (1, 2), CHORDS):
        left = np.array([k for k, arc in enumerate(arcs) if arc is None], dtype=np.int64)
        if not len(left):
            break
        asked = ends.take(left)
        centres = _arcs(asked, asked.contacts[along], share * space.lead_radius)
        lines = [
            (np.vstack([centre, arc[chord - 1 :]]), np.repeat(axis[None], STEPS + 2 - chord, axis=0))
            for centre, arc, axis in zip(asked.contacts[0], centres, asked.contacts[2], strict=True)
        ]
        for k in np.flatnonzero(_free(space, asked, lines)).tolist():
            arcs[left[k]] = lines[k][0][1:], lines[k][1][1:]
    return arcs


def begins_tangentially(before: Float[ndarray, "3"], cut: Float[ndarray, "n 3"]) -> bool:
    """Whether a cut through these ball centres begins in the direction in which the ball comes from `before`."""
    if len(cut) < 2:
        return False
    came = unit((cut[0] - before)[None])
    goes = unit((cut[1] - cut[0])[None])
    return bool(angles_between(came, goes)[0] <= TANGENT)


def _arcs(ends: _Ends, up: Float[ndarray, "m 3"], radius: float) -> Float[ndarray, "m p 3"]:
    """Ball centres on arcs that leave the contacts along `away` and bend to the side of `up`."""
    up = up - dots(up, ends.away)[:, None] * ends.away
    # a direction nearly along the cut bends to no side
    up = unit(np.where(lengths(up)[:, None] > LEAST_SIDE, up, np.nan))
    angle = SWEEP * np.arange(1, STEPS + 1) / STEPS
    along, rise = (radius * f[:, None] for f in (np.sin(angle), 1 - np.cos(angle)))
    return ends.contacts[0][:, None] + along * ends.away[:, None] + rise * up[:, None]


def _free(space: LinkSpace, ends: _Ends, lines: Sequence[Polyline]) -> Bool[ndarray, " m"]:
    """Whether each arc, its contact first, removes nothing anew, and is proven free of collision and gouge."""
    free = np.array([np.isfinite(centres).all() for centres, _ in lines], dtype=bool)
    # the first move of a cut cuts
    links = [line if len(cut[0]) else (line[0][1:], line[1][1:]) for line, cut in zip(lines, ends.removed)]
    for k in np.flatnonzero(free).tolist():
        centres = links[k][0]
        cut = ends.removed[k][0]
        samples = np.vstack([centres[1:], (centres[1:] + centres[:-1]) / 2])
        if len(cut):
            nearest = cut[np.argmin(np.linalg.norm(samples[:, None] - cut[None], axis=2), axis=1)]
            free[k] = space.left_in_air(nearest, samples[:, None]).all()
        else:
            free[k] = space.in_air(np.vstack([centres[:1], samples])[None])[0]
    asked = np.flatnonzero(free).tolist()
    free[asked] = space.arcs_cut_little([links[k] for k in asked], [ends.removed[k] for k in asked])
    asked = np.flatnonzero(free).tolist()
    free[asked] = space.polylines_free([lines[k] for k in asked], cutting=True)
    return free
