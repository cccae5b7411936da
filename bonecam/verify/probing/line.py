"""The line of the part that is probed: places evenly spaced by length on a line s = const of its surface.

The back of a bone is its least hollow side: of LINES lines the one that lies nearest to its own convex hull, seen as
distance from the Z axis over z.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial import ConvexHull

from bonecam.arrays import lengths
from bonecam.errors import JobError
from bonecam.planning.passes.contacts import at_post
from bonecam.surface.tspline import TSpline
from bonecam.workholding.post import Post

LINES = 72
"""Lines among which the back is looked for: every 5 degrees."""
DENSE = 1000
"""Points by which lines are measured."""
POLE_MARGIN = 0.02
"""Share of the t-range at each pole where no line is judged: all of them meet there."""


@dataclass(frozen=True, eq=False)
class ProbeLine:
    """Places (n, 3) on the line `s` with outward unit `normals`, and how far along the line each lies, mm."""

    s: float
    places: Float[ndarray, "n 3"]
    normals: Float[ndarray, "n 3"]
    along: Float[ndarray, " n"]


def probe_line(part: TSpline, post: Post, radius: float, count: int = 100, s: float | None = None) -> ProbeLine:
    """So many places of the line `s` (None: the back) where a ball of this `radius` (mm) is clear of the post.

    JobError where the line is not on the part, or all of it is at the post, and for fewer than two places.
    """
    first, last = part.domain[0].tolist()
    check_line(count, s, first, last)
    line = back_of(part) if s is None else s
    low, high = part.domain[1].tolist()
    t = np.linspace(low, high, DENSE)
    across = np.full(DENSE, line)
    points, normals = part.positions(across, t), part.normals(across, t)
    along = np.r_[0.0, lengths(np.diff(points, axis=0)).cumsum()]
    free = along[~at_post(points, normals, post, radius)]
    if not len(free):
        raise JobError(f"line {line:g} lies at the post, where no ball goes: give another line")
    wanted = np.linspace(free[0], free[-1], 2 * count + 1)[1::2]
    t = np.interp(wanted, along, t)
    across = np.full(count, line)
    return ProbeLine(line, part.positions(across, t), part.normals(across, t), wanted)


def check_line(count: int, s: float | None, first: float = 0.0, last: float = 1.0) -> None:
    """JobError for fewer than two places, or a line that is not on a part whose parameter s goes from `first` to
    `last`, by default those of a fitted surface."""
    if count < 2:
        raise JobError(f"{count} points make no line: give 2 or more")
    if s is not None and not first <= s <= last:
        raise JobError(f"line {s:g} is off the part: give a parameter s from {first:g} to {last:g}")


def back_of(part: TSpline) -> float:
    """The line s of the part's least hollow side."""
    first, last = part.domain[0].tolist()
    s = first + (last - first) * np.arange(LINES) / LINES
    low, high = part.domain[1].tolist()
    margin = POLE_MARGIN * (high - low)
    t = np.linspace(low + margin, high - margin, DENSE)
    return float(min(s, key=lambda one: _hollow(part.positions(np.full(DENSE, one), t))))


def _hollow(points: Float[ndarray, "n 3"]) -> float:
    """How far a line lies below its convex hull at most, seen as distance from the Z axis over z, mm."""
    out = points[:, :2].mean(axis=0)
    out /= max(float(np.linalg.norm(out)), np.finfo(float).tiny)
    seen = np.column_stack([points[:, 2], points[:, :2] @ out])
    facets = ConvexHull(seen).equations
    above = facets[facets[:, 1] > 0]
    return float((-(seen @ above[:, :2].T + above[:, 2]).max(axis=1)).max())
