"""The ring round the post: the contacts whose ball comes as near to the post as it may.

Rings t = const end wherever the post begins, so that what they leave round it changes from level to level by up
to a side step. With this ring each level leaves the same fillet.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import dots, lengths, unit
from bonecam.planning.passes.patterns.sampling import ROUND, contact_frames
from bonecam.surface.tspline import TSpline
from bonecam.workholding.post import Post

STEP = 0.25
"""Contacts of the ring are about so far apart, mm."""
LEAST_COUNT = 48
"""Contacts of the ring at least."""
SEARCHED = 64
"""Places on each line t from the post's end on, between which the ring is bracketed."""
HALVINGS = 24
"""Halvings of the bracket: to 1e-9 of the domain."""
LONGEST = 1.0
"""Longer moves of the ball on the ring, mm, are halved, and then left out as jumps."""
REFINEMENTS = 4
"""So often: to a sixteenth."""
OUTSIDE = 1e-3
"""The ring keeps this much more than asked, mm, for the moves between its contacts."""


@dataclass(frozen=True, eq=False)
class LineContacts:
    """The contacts of one line that comes as near to an obstacle as a ball may, as those of `LineSamples`; a closed one
    has its first contact again at its end."""

    parameters: Float[ndarray, "n 2"]
    contacts: Float[ndarray, "n 3"]
    normals: Float[ndarray, "n 3"]
    feeds: Float[ndarray, "n 3"]


def post_rings(surface: TSpline, post: Post, radius: float, away: float) -> list[LineContacts]:
    """The ring on which the centre of a ball of `radius` is `away` (mm) from the post, as one closed line; or its parts
    between jumps, where lines s = const leave the post's edge for another one. Nothing where some line s = const never
    comes so near, or the lower pole is not under the post."""
    count = max(int(np.ceil(2 * np.pi * (post.radius + away) / STEP)), LEAST_COUNT)
    s = np.linspace(0.0, 1.0, count + 1)
    t = _edge(surface, post, s, radius, away)
    for k in range(REFINEMENTS + 1):
        if np.isnan(t).any():
            return []
        # Lengths of the ball's moves from place to place, mm
        points, normals, _ = contact_frames(surface, np.column_stack([s, t]), ROUND)
        jumps = np.flatnonzero(lengths(np.diff(points + radius * normals, axis=0)) > LONGEST)
        if not len(jumps) or k == REFINEMENTS:
            break
        middles = (s[jumps] + s[jumps + 1]) / 2
        t = np.insert(t, jumps + 1, _edge(surface, post, middles, radius, away))
        s = np.insert(s, jumps + 1, middles)
    if not len(jumps):
        return [_line(surface, s, t, closed=True)]
    behind = np.roll(np.arange(len(s) - 1), -jumps[0] - 1)
    parts = np.split(behind, jumps[1:] - jumps[0])
    return [_line(surface, s[part], t[part], closed=False) for part in parts if len(part) > 1]


def _edge(surface: TSpline, post: Post, s: Float[ndarray, " n"], radius: float, away: float) -> Float[ndarray, " n"]:
    """Where each line s = const comes off the post first, NaN where it begins off it or never does."""

    def spare(t: ndarray) -> Float[ndarray, " n"]:
        points, normals, _ = contact_frames(surface, np.column_stack([np.resize(s, len(t)), t]), ROUND)
        return post.distance(points + radius * normals) - away - OUTSIDE

    low, high = surface.domain[1]
    ends = [contact_frames(surface, np.array([[0.0, t]]), ROUND)[0][0, 2] for t in (low, high)]
    start, end = (low, high) if ends[0] < ends[1] else (high, low)
    t = np.linspace(start, end, SEARCHED)
    clearances = spare(np.repeat(t, len(s))).reshape(SEARCHED, len(s))
    first = np.argmax(clearances > 0, axis=0)
    near, far = t[first - 1], t[first]
    for _ in range(HALVINGS):
        middle = (near + far) / 2
        free = spare(middle) > 0
        near, far = np.where(free, near, middle), np.where(free, middle, far)
    return np.where(first > 0, far, np.nan)


def _line(surface: TSpline, s: Float[ndarray, " n"], t: Float[ndarray, " n"], *, closed: bool) -> LineContacts:
    """The contacts at these places."""
    parameters = np.column_stack([s, t])
    points, normals, _ = contact_frames(surface, parameters, ROUND)
    if closed:
        along = np.roll(points[:-1], -1, axis=0) - np.roll(points[:-1], 1, axis=0)
        along = np.vstack([along, along[:1]])
    else:
        along = np.gradient(points, axis=0)
    return LineContacts(parameters, points, normals, feeds_along(along, normals))


def feeds_along(ways: Float[ndarray, "n 3"], normals: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
    """Unit feed directions: what is across the normals of ways along a line."""
    return unit(ways - dots(ways, normals)[:, None] * normals)
