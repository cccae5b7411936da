"""The free tool axes of every node of a net over the contacts of a path: a map of proven directions for each."""

from collections import Counter
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import angles_between
from bonecam.errors import OrientationError
from bonecam.kernels.closest.cone_marching import Apexes, Obstacles
from bonecam.kernels.closest.direction_maps import AxisLimits, direction_maps, within_limits
from bonecam.machine.limits import MachineLimits
from bonecam.planning.axes.cones.cone_nodes import ConeNodes, join_nets, make_net
from bonecam.planning.axes.cones.obstacles import apexes_of, obstacles_of, rooms_at, single_obstacles
from bonecam.planning.axes.cones.sphere_leaves import leaf_centres, sphere_leaves
from bonecam.planning.axes.lead import table_limits
from bonecam.planning.collision.scene import Scene
from bonecam.runtime.threads import in_pieces
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import ContactPath

SPACING = 0.7
"""Distance of the nodes, mm. A node's reach costs 1 to 1.5 % of the directions."""
ENOUGH = 0.5
"""A node has enough free directions if they are this share of the allowed ones."""
FINEST = 0.15
"""Where nodes have too few free directions they are set half as far apart, down to this, mm."""
LEAF = np.radians(4.0)
"""A leaf with a centre this near to what a machine of a narrow band, or of a curve of axes, reaches is within its
limits: leaves are at most so far apart."""
BAND = np.radians(15.0)
"""Directions that miss a limit by this are mapped too: a cone is proven as a whole, and limits cut it by planes."""
NODES = 64
"""So many are mapped on a core in one go."""
FEW = 0.028
"""A node of one contact with fewer free directions than this share of the sphere (0.35 sr) gets several apexes:"""
PIECES = 3
"""so many on each of the half moves that begin or end there, each with less reach."""


@dataclass(frozen=True, eq=False)
class FreeAxes:
    """Of the leaves (l) about `directions` those that are `proven` free for the tool on all contacts of a node (k, l),
    and those whose centres are `allowed` by `limits`; `reached` (l) are those of the machine. Node i has the
    `apexes` from `starts[i]` up to `starts[i + 1]`, which together stand for all of its contacts."""

    net: ConeNodes
    apexes: Apexes
    starts: Int[ndarray, " j"]
    obstacles: Obstacles
    section_names: tuple[str, ...]
    limits: AxisLimits
    reached: Bool[ndarray, " l"]
    allowed: Bool[ndarray, "k l"]
    proven: Bool[ndarray, "k l"]

    @property
    def directions(self) -> Float[ndarray, "l 3"]:
        """Unit vectors."""
        return leaf_centres()

    @cached_property
    def free(self) -> Bool[ndarray, "k l"]:
        """Which of the allowed directions are proven free."""
        return self.proven & self.allowed

    @property
    def apex_nodes(self) -> Int[ndarray, " m"]:
        """The node of each apex."""
        return np.repeat(np.arange(len(self.starts) - 1), np.diff(self.starts))

    def blocking(self, nodes: Int[ndarray, " k"]) -> list[str]:
        """What leaves each of the nodes without a free axis: `limits` of the machine and of the tilt, or the obstacle,
        and the section of the tool, with which the fewest directions are left: `shank against the material`."""
        held = [np.arange(*self.starts[node : node + 2]) for node in nodes]
        some = np.concatenate([np.zeros(0, np.int64), *held])
        apexes = Apexes(*(part[some] for part in self.apexes))
        starts = np.cumsum([0, *map(len, held)])
        allowed = self.allowed[nodes]
        counts: dict[str, ndarray] = {}
        for s in range(len(self.section_names)):
            for name, alone in single_obstacles(self.obstacles, s):
                proven = _maps(alone, apexes, starts, allowed)
                counts[f"{self.section_names[s]} against the {name}"] = (proven & allowed).sum(axis=1)
        names = list(counts)
        fewest = np.argmin(list(counts.values()), axis=0)
        why = np.where(allowed.any(axis=1), np.array(names)[fewest], "holder against the table")
        no_table = self.limits._replace(above=np.full(len(nodes), np.pi), normals=self.limits.normals[nodes])
        within = within_limits(no_table, self.directions, 0.0) & self.reached
        return np.where(within.any(axis=1), why, "limits").tolist()  # type: ignore[no-any-return]


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
    middles = half_moves(path)
    names = tuple(section.name for section in reversed(path.cutter.profile))
    clearance = scene.clamping.clearance if scene.clamping.closed else -np.inf

    reached = _reached_leaves(limits)
    nets, parts = [], []
    left = np.arange(len(path.centres))
    spacing = SPACING
    while len(left):
        net = make_net(path.centres[left], path.normals[left], middles[left], spacing)
        apexes = apexes_of(net, room[left])
        kept = _limits(net, path.cutter, limits, max_tilt, clearance)
        starts = np.arange(len(net.places) + 1)
        allowed = within_limits(kept, leaf_centres(), 0.0) & reached
        asked = within_limits(kept, leaf_centres(), BAND)
        proven = _maps(obstacles, apexes, starts, asked)
        spacing /= 2
        most = (proven & allowed).sum(axis=1) >= ENOUGH * allowed.sum(axis=1)
        alone = np.bincount(net.node_of) == 1
        settled = most | alone | (spacing < FINEST)
        nets.append((left, net, settled))
        parts.append(tuple(part[settled] for part in (*apexes, proven, allowed)))
        left = left[~settled[net.node_of]]
    net = join_nets(nets, len(path.centres))
    *apex, proven, allowed = (np.concatenate(part) for part in zip(*parts))
    free = FreeAxes(
        net,
        Apexes(*apex),
        starts=np.arange(len(net.places) + 1),
        obstacles=obstacles,
        section_names=names,
        limits=_limits(net, path.cutter, limits, max_tilt, clearance),
        reached=reached,
        allowed=allowed,
        proven=proven,
    )
    return _in_pieces(free, middles)


def _in_pieces(free: FreeAxes, middles: Float[ndarray, "n 2 3"]) -> FreeAxes:
    """With several apexes at the nodes of one contact that have FEW free directions, and their maps anew."""
    net, one = free.net, free.apexes
    alone = np.bincount(net.node_of) == 1
    nodes = np.flatnonzero(alone & (free.free.sum(axis=1) < FEW * free.free.shape[1]) & free.allowed.any(axis=1))
    if not len(nodes):
        return free
    contact = np.empty(len(net.places), dtype=np.int64)
    contact[net.node_of] = np.arange(len(net.node_of))
    share = (np.arange(PIECES) + 0.5) / PIECES
    ways = middles[contact[nodes]] - net.places[nodes][:, None]
    apexes = (net.places[nodes][:, None, None] + ways[:, :, None] * share[:, None]).reshape(-1, 3)
    growth = np.repeat(np.linalg.norm(ways, axis=2).ravel() / (2 * PIECES), PIECES)
    each = np.repeat(nodes, 2 * PIECES)
    pieces = Apexes(apexes, growth, one.normals[each], one.spread[each], one.room[each])
    starts = 2 * PIECES * np.arange(len(nodes) + 1)
    limits = free.limits._replace(above=free.limits.above[nodes], normals=free.limits.normals[nodes])
    asked = within_limits(limits, leaf_centres(), BAND)
    proven = _maps(free.obstacles, pieces, starts, asked)
    maps = free.proven.copy()
    maps[nodes] = proven
    others = np.setdiff1d(np.arange(len(net.places)), nodes)
    order = np.argsort(np.concatenate([others, each]), kind="stable")
    joined = Apexes(*(np.concatenate([old[others], new])[order] for old, new in zip(one, pieces)))
    counts = np.ones(len(net.places), dtype=np.int64)
    counts[nodes] = 2 * PIECES
    return replace(free, apexes=joined, starts=np.cumsum(np.r_[0, counts]), proven=maps)


def _maps(
    obstacles: Obstacles, apexes: Apexes, starts: Int[ndarray, " j"], asked: Bool[ndarray, "k l"]
) -> Bool[ndarray, "k l"]:
    """`direction_maps` of all nodes, on all cores."""
    apexes = Apexes(*(np.require(part, requirements=["C", "W"]) for part in apexes))
    asked = np.ascontiguousarray(asked)

    def work(piece: slice) -> Bool[ndarray, "m l"]:
        some = starts[piece.start : piece.stop + 1]
        return direction_maps(obstacles, apexes, some, asked[piece], sphere_leaves()[0])

    return np.concatenate(in_pieces(work, len(asked), NODES))


def _reached_leaves(limits: MachineLimits) -> Bool[ndarray, " l"]:
    """The leaves that a machine's axes reach, as far as polar angles do not tell."""
    centres = leaf_centres()
    if limits.reached is None:
        return np.ones(len(centres), dtype=bool)
    return angles_between(centres, limits.nearest(centres)) <= LEAF


def blocked_by(path: ContactPath, scene: Scene, limits: MachineLimits, max_tilt: float) -> dict[str, int]:
    """How many contacts of a path without free axes are blocked by what (`FreeAxes.blocking`), the most frequent
    first; raises as `free_axes`."""
    free = free_axes(path, scene, limits, max_tilt)
    why = free.blocking(np.arange(len(free.net.places)))
    return dict(Counter(why[node] for node in free.net.node_of).most_common())


def half_moves(path: ContactPath) -> Float[ndarray, "n 2 3"]:
    """Middles of the moves of the ball's centre to each contact and from it; the contact where there is none."""
    centres = path.centres
    same = (path.pass_index[1:] == path.pass_index[:-1])[:, None]
    middle = (centres[1:] + centres[:-1]) / 2
    before = np.vstack([centres[:1], np.where(same, middle, centres[1:])])
    behind = np.vstack([np.where(same, middle, centres[:-1]), centres[-1:]])
    return np.stack([before, behind], axis=1)


def _limits(net: ConeNodes, cutter: Cutter, limits: MachineLimits, max_tilt: float, clearance: float) -> AxisLimits:
    """What the axes of a net's nodes keep to."""
    lowest = net.places - np.outer(net.reach, [0.0, 0.0, 1.0])
    above = table_limits(lowest, cutter, clearance) if np.isfinite(clearance) else np.full(len(lowest), np.pi)
    wider = LEAF if limits.narrow else 0.0
    return AxisLimits(limits.smallest - wider, limits.largest + wider, above, max_tilt, net.normals.copy())
