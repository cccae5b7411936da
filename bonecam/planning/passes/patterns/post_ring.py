"""The ring round the post: the contacts whose ball comes as near to the post as it may.

Rings t = const end wherever the post begins, so that what they leave round it changes from level to level by up
to a side step. With this ring each level leaves the same fillet.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import dots, unit
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


def post_ring(surface: TSpline, post: Post, radius: float, away: float) -> LineContacts | None:
    """The ring on which the centre of a ball of `radius` is `away` (mm) from the post; None where some line
    s = const never comes so near, or the lower pole is not under the post."""
    count = max(int(np.ceil(2 * np.pi * (post.radius + away) / STEP)), LEAST_COUNT)
    s = np.linspace(0.0, 1.0, count + 1)

    def spare(t: ndarray) -> Float[ndarray, " n"]:
        points, normals, _ = contact_frames(surface, np.column_stack([np.resize(s, len(t)), t]), ROUND)
        return post.distance(points + radius * normals) - away - OUTSIDE

    low, high = surface.domain[1]
    ends = [contact_frames(surface, np.array([[0.0, t]]), ROUND)[0][0, 2] for t in (low, high)]
    start, end = (low, high) if ends[0] < ends[1] else (high, low)
    t = np.linspace(start, end, SEARCHED)
    found = spare(np.repeat(t, count + 1)).reshape(SEARCHED, count + 1)
    first = np.argmax(found > 0, axis=0)
    if not (first > 0).all():
        return None

    near, far = t[first - 1], t[first]
    for _ in range(HALVINGS):
        middle = (near + far) / 2
        free = spare(middle) > 0
        near, far = np.where(free, near, middle), np.where(free, middle, far)
    parameters = np.column_stack([s, far])
    points, normals, _ = contact_frames(surface, parameters, ROUND)
    along = np.roll(points[:-1], -1, axis=0) - np.roll(points[:-1], 1, axis=0)
    feeds = feeds_along(np.vstack([along, along[:1]]), normals)
    return LineContacts(parameters, points, normals, feeds)


def feeds_along(ways: Float[ndarray, "n 3"], normals: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
    """Unit feed directions: what is across the normals of ways along a line."""
    return unit(ways - dots(ways, normals)[:, None] * normals)
