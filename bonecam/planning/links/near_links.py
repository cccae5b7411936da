"""Links near the level from the end of each run to the begin of the next: a step over on the surface, or a direct link,
by way of lead arcs where there is room for them.

Steps over on the surface: from the end of one pass the tool cuts straight on to the near start of the next.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.arrays import angles_between
from bonecam.planning.axes.singularity import SINGULAR_ANGLE, least_polar_angles
from bonecam.planning.links.direct import MAX_TURN, Contacts, contacts_of, direct_links
from bonecam.planning.links.leads import Run, led_links
from bonecam.planning.links.link_space import LinkSpace
from bonecam.planning.links.moves import NO_MOVES, LinkMoves
from bonecam.tool.path import ContactPath


def steps_over(space: LinkSpace, ends: Contacts, starts: Contacts, longest: float) -> Bool[ndarray, " k"]:
    """Whether the tool may cut straight from each end to its start: no farther than `longest` (mm), by a small turn off
    the singularity, no deeper than at the deepest of them all, proven free of collision and gouge."""
    may = np.linalg.norm(starts[0] - ends[0], axis=1) <= longest
    may &= angles_between(ends[2], starts[2]) <= MAX_TURN
    axes = np.stack([ends[2], starts[2]], axis=1)
    may &= np.array([least_polar_angles(pair).min() > SINGULAR_ANGLE for pair in axes], dtype=bool)
    may[may] = space.no_deeper_between(ends[0][may], starts[0][may])
    may[may] = space.ball_free(ends[0][may], starts[0][may])
    if not may.any():
        return may
    centres = np.stack([ends[0], starts[0]], axis=1)[may].reshape(-1, 3)
    turned = axes[may].reshape(-1, 3)
    joined = np.tile([True, False], int(may.sum()))
    free = space.checker.moves_free(space.checker.cutter.tips_of(centres, turned), turned, joined)
    may[may] = free[::2]
    return may


DIRECT_RADII = 2.5
"""A direct link is no longer than this many radii of the ball."""


def near_links(
    space: LinkSpace, path: ContactPath, axes: Float[ndarray, "n 3"], runs: Sequence[Run]
) -> tuple[list[Run], list[LinkMoves | None]]:
    """The runs, and the link near the level from each but the last to the next: no moves where the tool steps over on
    the surface, if it can to behind the ramp, which is then left out; else the direct link, or None."""
    longest = DIRECT_RADII * path.cutter.radius
    level = [run[np.argmin(path.ramp[run]) :] for run in runs]
    over = steps_over(space, *_between(path, axes, level), longest)
    runs = [flat if stepped else run for run, flat, stepped in zip(runs, level, np.r_[False, over])]

    links: list[LinkMoves | None] = [NO_MOVES] * len(over)
    apart = np.flatnonzero(~over)
    ends, starts = (contacts_of(contacts, apart) for contacts in _between(path, axes, runs))
    left = np.flatnonzero(~steps_over(space, ends, starts, longest))
    if space.lead_radius:
        ended, begun = ([runs[k + step] for k in apart[left]] for step in (0, 1))
        led = led_links(space, (path.centres, path.normals, axes), ended, begun, longest)
        for k, link in zip(apart[left], led, strict=True):
            links[k] = link
        left = left[[link is None for link in led]]
    direct = direct_links(space, contacts_of(ends, left), contacts_of(starts, left), longest)
    for k, link in zip(apart[left], direct, strict=True):
        links[k] = link
    return runs, links


def _between(path: ContactPath, axes: Float[ndarray, "n 3"], runs: Sequence[Run]) -> tuple[Contacts, Contacts]:
    """The last contacts of all runs but the last one, and the first ones of those that follow."""
    last = np.array([run[-1] for run in runs[:-1]], dtype=np.int64)
    first = np.array([run[0] for run in runs[1:]], dtype=np.int64)
    ends = path.centres[last], path.normals[last], axes[last]
    return ends, (path.centres[first], path.normals[first], axes[first])
