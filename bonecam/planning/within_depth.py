"""Contacts of a path that would cut deeper than allowed, told by the rays that the proof measures with.

The depth at a contact (`InProcessStock.depths`) is that of the ball there, among places of a height field. What a path
removes in all, its flutes and the moves between its contacts included, is measured as the simulation of the posted text
measures it: how far the nearest air was from places of the new surface (`material/cut_depths.py`), as near to one
another as there, on the rays of the planner, which are farther apart.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from jaxtyping import Bool
from numpy import ndarray
from scipy.spatial import KDTree

from bonecam.arrays import dots
from bonecam.levels.measure.level import MachinedLevel
from bonecam.material.cut_depths import cut_depths
from bonecam.material.in_process_stock import InProcessStock, remove_material
from bonecam.planning.passes.engaged_segments import DepthLimits
from bonecam.tool.path import ContactPath, MoveKind, ToolPath

SLACK = 0.02
"""A place may be so much (mm) deeper than is allowed at a contact. The proof allows 0.04 (half of the distance of its
rays, of which a contact's depth takes UNCERTAIN), and finds places up to 0.016 deeper than the planner's rays do."""
MOST_PLACES = 500
"""So many of the places that are too deep are asked for what cut them at once, the deepest."""
MAX_ROUNDS = 3
"""Times that a path is made anew without the contacts at which it was too deep, at most."""
SAME = 1e-6
"""A ball of the path and a contact's are one, mm."""


Cut = tuple[ToolPath, InProcessStock]
"""A path, and what stands behind it."""


def cut_within_depth(
    contacts: ContactPath,
    material: InProcessStock,
    level: MachinedLevel,
    allowed: DepthLimits,
    oriented: Callable[[ContactPath], ToolPath],
) -> Cut:
    """The path that is `oriented` over the contacts of a level and what it leaves of the material, made anew without
    those at which it cuts too deep."""
    for _ in range(MAX_ROUNDS):
        path = oriented(contacts)
        after = remove_material(material, level, path)
        kept = within_depth(contacts, path, material, after, allowed)
        if kept.all():
            break
        contacts = leave_out(contacts, kept)
    return path, after


def within_depth(
    contacts: ContactPath, path: ToolPath, before: InProcessStock, after: InProcessStock, allowed: DepthLimits
) -> Bool[ndarray, " n"]:
    """Which of the contacts may stay, where `path`, made of them, leads from the material `before` to that `after` it:
    all but those at which the cutter touches a place that it cuts too deep."""
    kept = np.ones(len(contacts.centres), dtype=bool)
    left = after.rays.cutters
    grid = after.rays.cutters.grid
    cuts = cut_depths(left.sets, before.rays.cutters.sets, grid)
    deep = np.flatnonzero(cuts.depths > allowed.deepest + SLACK)
    if not len(deep):
        return kept
    deep = deep[np.argsort(-cuts.depths[deep])][:MOST_PLACES]
    cutting = np.flatnonzero(path.kinds == MoveKind.CUT)

    # Whether ball or flutes come within `room` (mm) of one of the places in each of these rows
    points = cuts.places[deep]
    balls, axes = path.balls[cutting], path.axes[cutting]
    touching = np.zeros(len(cutting), dtype=bool)
    for place in points:
        height = np.clip(dots(place - balls, axes), path.cutter.corner - path.cutter.centre_height, path.cutter.reach)
        away = np.linalg.norm(place - balls - height[:, None] * axes, axis=1)
        touching |= away < path.cutter.radius + grid.cell

    away, nearest = KDTree(contacts.centres).query(path.balls[cutting[touching]])
    kept[np.asarray(nearest)[np.asarray(away) < SAME]] = False
    return kept


def leave_out(contacts: ContactPath, kept: Bool[ndarray, " n"]) -> ContactPath:
    """The contacts that are `kept`, their passes ended where one is left out; the others are `covered`."""
    index = np.flatnonzero(kept)
    goes_on = (np.diff(index) == 1) & (np.diff(contacts.pass_index[index]) == 0)
    return replace(
        contacts.take(index),
        pass_index=np.r_[0, np.cumsum(~goes_on)][: len(index)],
        uncut=np.vstack([contacts.uncut, contacts.contacts[~kept]]),
        reasons=(*contacts.reasons, *("covered",) * int((~kept).sum())),
    )
