"""Links near the level from the end of each run to the begin of the next: a step over on the surface, or a direct link,
by way of lead arcs where there is room for them."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.planning.links.direct import Contacts, contacts_of, direct_links
from bonecam.planning.links.leads import Run, led_links
from bonecam.planning.links.link_space import LinkSpace
from bonecam.planning.links.moves import NO_MOVES, LinkMoves
from bonecam.planning.links.step_over import steps_over
from bonecam.tool.path import ContactPath

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


def _between(
    path: ContactPath, axes: Float[ndarray, "n 3"], runs: Sequence[Run]
) -> tuple[Contacts, Contacts]:
    """The last contacts of all runs but the last one, and the first ones of those that follow."""
    last = np.array([run[-1] for run in runs[:-1]], dtype=np.int64)
    first = np.array([run[0] for run in runs[1:]], dtype=np.int64)
    ends = path.centres[last], path.normals[last], axes[last]
    return ends, (path.centres[first], path.normals[first], axes[first])
