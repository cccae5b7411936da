"""The free tool axes of every node of a net over the contacts of a path: a set of directions, tested one by one."""

from collections import Counter
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import angles_between, unit
from bonecam.errors import OrientationError
from bonecam.kernels.closest.cone_marching import (
    Apexes,
    Groups,
    Obstacles,
    angles_to_blocked,
    free_directions,
)
from bonecam.machine.limits import MachineLimits, polar_angles
from bonecam.planning.axes.admissible import directions_within
from bonecam.planning.axes.cones.cone_nodes import ConeNodes, join_nets, make_net
from bonecam.planning.axes.cones.obstacles import apexes_of, obstacles_of, rooms_at, single_obstacles
from bonecam.planning.axes.lead import table_limits
from bonecam.planning.collision.scene import Scene
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import ContactPath

SPACING = 0.7
"""Distance of the nodes, mm. A node's reach costs 1 to 1.5 % of the directions."""
ENOUGH = 0.9
"""A node has enough free directions if they are this share of the allowed ones."""
FINEST = 0.15
"""Where nodes have too few free directions they are set half as far apart, down to this, mm."""
GROUPS = 100
"""Groups of directions that are tested by one cone first: the time is halved, with 40 to 160 of them."""
WIDEST = np.radians(40.0)
"""No cone is wider: its semi-angle, radians."""


@dataclass(frozen=True, eq=False)
class FreeAxes:
    """Of unit `directions` (d) those `within` the machine's limits and the largest tilt, of these the ones above the
    table too (`allowed`), and of these those that are `free` for the tool on all contacts of a node (k, d)."""

    net: ConeNodes
    apexes: Apexes
    obstacles: Obstacles
    section_names: tuple[str, ...]
    limits: MachineLimits
    directions: Float[ndarray, "d 3"]
    within: Bool[ndarray, "k d"]
    allowed: Bool[ndarray, "k d"]
    free: Bool[ndarray, "k d"]

    @cached_property
    def room(self) -> Float[ndarray, "k d"]:
        """The angle from each free direction to the nearest one that collides, WIDEST at most, radians."""
        order, angles = _neighbours(self.limits)
        return np.asarray(angles_to_blocked(self.free | ~self.allowed, order, angles)) * self.free

    def blocking(self, nodes: Int[ndarray, " k"]) -> list[str]:
        """What leaves each of the nodes without a free axis: `limits` of the machine and of the tilt, or the obstacle,
        and the section of the tool, with which the fewest directions are left: `shank against the material`."""
        apexes, allowed = Apexes(*(part[nodes] for part in self.apexes)), self.allowed[nodes]
        counts = {
            f"{self.section_names[s]} against the {name}": free_directions(
                alone, apexes, self.directions, _groups(self.limits), allowed
            ).sum(axis=1)
            for s in range(len(self.section_names))
            for name, alone in single_obstacles(self.obstacles, s)
        }
        names = list(counts)
        fewest = np.argmin(list(counts.values()), axis=0)
        why = np.where(allowed.any(axis=1), np.array(names)[fewest], "holder against the table")
        return np.where(self.within[nodes].any(axis=1), why, "limits").tolist()  # type: ignore[no-any-return]


def free_axes(path: ContactPath, scene: Scene, limits: MachineLimits, max_tilt: float) -> FreeAxes:
    """The free axes of a net over the contacts; `max_tilt` (radians) from the normal. OrientationError where a mesh of
    the scene is not closed, contacts are not finite, or there are none."""
    if not len(path.centres):
        raise OrientationError("there are no contacts to find tool axes for: give one or more")
    bad = np.flatnonzero(~np.isfinite(path.centres).all(axis=1))
    if len(bad):
        raise OrientationError(f"contact {bad[0]} is not finite: leave it out", contact=int(bad[0]))
    obstacles = obstacles_of(scene, path.cutter, path.centres)
    room = rooms_at(path, scene)
    directions = directions_within(limits)
    middles = _middles(path)
    names = tuple(section.name for section in reversed(path.cutter.profile))
    clearance = scene.clamping.clearance if scene.clamping.closed else -np.inf

    nets, parts = [], []
    left, spacing = np.arange(len(path.centres)), SPACING
    while len(left):
        net = make_net(path.centres[left], path.normals[left], middles[left], spacing)
        apexes = apexes_of(net, room[left])
        within, allowed = _allowed(net, directions, path.cutter, limits, max_tilt, clearance)
        free = free_directions(obstacles, apexes, directions, _groups(limits), allowed)
        spacing /= 2
        most = free.sum(axis=1) >= ENOUGH * allowed.sum(axis=1)
        settled = most | (spacing < FINEST)
        nets.append((left, net, settled))
        parts.append(tuple(part[settled] for part in (*apexes, within, allowed, free)))
        left = left[~settled[net.node_of]]
    net = join_nets(nets, len(path.centres))
    *apex, within, allowed, free = (np.concatenate(part) for part in zip(*parts))
    return FreeAxes(net, Apexes(*apex), obstacles, names, limits, directions, within, allowed, free)


def blocked_by(path: ContactPath, scene: Scene, limits: MachineLimits, max_tilt: float) -> dict[str, int]:
    """How many contacts of a path without free axes are blocked by what (`FreeAxes.blocking`), the most frequent
    first; raises as `free_axes`."""
    free = free_axes(path, scene, limits, max_tilt)
    why = free.blocking(np.arange(len(free.net.places)))
    return dict(Counter(why[node] for node in free.net.node_of).most_common())


def _middles(path: ContactPath) -> Float[ndarray, "n 2 3"]:
    """Middles of the moves of the ball's centre to each contact and from it; the contact where there is none."""
    centres = path.centres
    same = (path.pass_index[1:] == path.pass_index[:-1])[:, None]
    middle = (centres[1:] + centres[:-1]) / 2
    before = np.vstack([centres[:1], np.where(same, middle, centres[1:])])
    behind = np.vstack([np.where(same, middle, centres[:-1]), centres[-1:]])
    return np.stack([before, behind], axis=1)


def _allowed(
    net: ConeNodes,
    directions: Float[ndarray, "d 3"],
    cutter: Cutter,
    limits: MachineLimits,
    max_tilt: float,
    clearance: float,
) -> tuple[Bool[ndarray, "k d"], Bool[ndarray, "k d"]]:
    """The directions within the machine's limits and near enough to a node's normal, and those of them above the
    table."""
    angle = polar_angles(directions)
    lowest = net.places - np.outer(net.reach, [0.0, 0.0, 1.0])
    above = table_limits(lowest, cutter, clearance) if np.isfinite(clearance) else np.full(len(lowest), np.pi)
    near = net.normals @ directions.T >= np.cos(max_tilt)
    within = near & limits.allow(directions)
    return within, within & (angle <= above[:, None])


@lru_cache(maxsize=2)
def _groups(limits: MachineLimits) -> Groups:
    """The candidate directions in GROUPS groups, each of those nearest to one of so many that are far apart."""
    directions = directions_within(limits)
    count = min(GROUPS, len(directions))
    seeds = [0]
    nearest = directions @ directions[0]
    for _ in range(count - 1):
        seeds.append(int(nearest.argmin()))
        nearest = np.maximum(nearest, directions @ directions[seeds[-1]])
    group = (directions @ directions[seeds].T).argmax(axis=1)
    axes = unit(np.array([directions[group == g].sum(axis=0) for g in range(count)]))
    off = angles_between(directions, axes[group])
    angles = np.array([off[group == g].max() for g in range(count)])
    starts = np.cumsum(np.r_[0, np.bincount(group)])
    return Groups(axes, angles, starts, np.argsort(group, kind="stable"))


@lru_cache(maxsize=2)
def _neighbours(limits: MachineLimits) -> tuple[Int[ndarray, "d m"], Float[ndarray, "d m"]]:
    """The neighbours of each direction within WIDEST, itself first and as many as the one with the fewest has, and how
    far they are, radians."""
    directions = directions_within(limits)
    angles = np.arccos(np.clip(directions @ directions.T, -1, 1))
    order = np.argsort(angles, axis=1, kind="stable")
    sorted_ = np.take_along_axis(angles, order, axis=1)
    m = int((sorted_ <= WIDEST).sum(axis=1).min())
    return order[:, :m], sorted_[:, :m]
