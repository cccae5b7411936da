"""How far the whole tool stays from table, chuck, what stands on the table and other solids, over all moves and between
them.

How near the bodies of a machine's links come to the tool, and to one another, over a whole program.

No point of a solid moves further, from one pose to another, than the corner of its bounding box that moves most. So a
distance d in one pose bounds that in all others from below, by d less that motion: of places evenly spread over the
way of a pair the one of the lowest bound is measured, until no other can be nearer; where one between two of them may
be, more places are laid. (Branch and bound for a Lipschitz function, Shubert 1972.)
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import angles_between, numbered, unit
from bonecam.kernels.removal import Pieces, fixed_clearance
from bonecam.machine.control import Control
from bonecam.machine.kinematics import link_poses
from bonecam.machine.machine import Machine
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.triangle_mesh import TriangleMesh, side_by_side
from bonecam.nc.motions import Motions
from bonecam.planning.collision import (
    Solid,
    block_mesh,
    carried_links,
    column_mesh,
    cutter_mesh,
    link_solids,
    section_mesh,
    table_mesh,
)
from bonecam.runtime.threads import in_pieces
from bonecam.tool.cutter import Cutter
from bonecam.verify.findings import Clearance, Spot
from bonecam.verify.sweeping import sections_of, straight_pieces
from bonecam.workholding.clamping import Clamping

AT_ONCE = 16384
"""Pieces measured at once."""
NEAR = 0.2
"""Distances from a solid are told to this, mm."""
DEEPEST = -1e4
"""Columns without end go down to here, mm."""


def table_clearance(pieces: Pieces, cutter: Cutter, clamping: Clamping, within: float) -> tuple[float, int, str, int]:
    """The least distance (mm) of the tool from its clamping, its move and the part of the tool (-1 and none where it
    is more than `within`); and the first move in which they meet, -1 for none."""
    sections, _ = sections_of(cutter)
    names = [*(section.name for section in cutter.profile), "ball"]
    columns = np.array([replace(one, bottom=max(one.bottom, DEEPEST)).row for one in clamping.kept_off])

    def measure(some: slice) -> tuple[float, int, str, int]:
        part = Pieces._make(column[some] for column in pieces)
        least, where, section, touched = fixed_clearance(
            part, sections, radius=cutter.radius, columns=columns.reshape(-1, 5), closed=clamping.closed, within=within
        )
        move = int(part.moves[where]) if where >= 0 else -1
        return (least, move, names[section] if where >= 0 else "", int(part.moves[touched]) if touched >= 0 else -1)

    clearances = in_pieces(measure, len(pieces.starts), AT_ONCE)
    least, move, name, _ = min(clearances, key=lambda one: one[0])
    return least, move, name, min((one[3] for one in clearances if one[3] >= 0), default=-1)


def nearest_body(pieces: Pieces, cutter: Cutter, clamping: Clamping) -> str:
    """The name of what the tool comes nearest to of its clamping."""
    sections, _ = sections_of(cutter)
    bodies = [(one.name, np.array([replace(one, bottom=max(one.bottom, DEEPEST)).row])) for one in clamping.kept_off]
    bodies += [("table", np.zeros((0, 5)))] if clamping.closed else []
    least = [
        fixed_clearance(pieces, sections, cutter.radius, columns, closed=not len(columns), within=np.inf)[0]
        for _, columns in bodies
    ]
    return bodies[int(np.argmin(least))][0]


def shell_clearance(motions: Motions, cutters: Sequence[Cutter], shell: TriangleMesh) -> Clearance:
    """How near the whole tool comes to the shell of a second clamping, to NEAR mm; they touch where that is not sure
    to be no contact."""
    solid = MeshDistance(shell)
    used = [(cutter, np.flatnonzero(motions.tools == cutter.number)) for cutter in cutters]
    clearances = [solid_clearance(motions, moves, cutter, solid) for cutter, moves in used if len(moves)]
    near, move = min(clearances)
    x, y, z = (float(value) for value in motions.tips[move])
    line = int(motions.lines[move])
    return Clearance("tool", Spot(near, line, (x, y, z)), line if near < NEAR else 0)


def solid_clearance(
    motions: Motions, moves: Int[ndarray, " m"], cutter: Cutter, solid: MeshDistance
) -> tuple[float, int]:
    """The least distance (mm, within NEAR) of the whole tool from a closed solid on moves of one cutter, and its
    move.

    The tool is a row of balls on its axis, as wide as it is there: what is between two of them is no nearer to the
    solid than they are by more than half of their distance. That is halved where it matters.
    """
    pieces = straight_pieces(motions, moves, cutter)

    # Moves, ball centres and axes of poses on pieces, between which no point of the tool moves by more than NEAR
    turns = angles_between(pieces.start_axes, pieces.end_axes)
    ways = np.linalg.norm(pieces.ends - pieces.starts, axis=1) + turns * cutter.length
    counts = np.ceil(ways / NEAR).astype(np.int64).clip(1)
    piece, place = numbered(counts)
    share = ((place + 1) / counts[piece])[:, None]
    centres = (1 - share) * pieces.starts[piece] + share * pieces.ends[piece]
    axes = unit((1 - share) * pieces.start_axes[piece] + share * pieces.end_axes[piece])
    owner = pieces.moves[piece]

    sections, _ = sections_of(cutter)
    best = np.inf
    where = int(moves[0])
    pose = np.repeat(np.arange(len(centres)), len(sections))
    low, high, radius, end_radius = np.tile(sections, (len(centres), 1)).T
    while len(pose):
        middle = (low + high) / 2
        distance = solid.signed(centres[pose] + middle[:, None] * axes[pose])
        near = distance - (radius + end_radius) / 2
        if near.min() < best:
            best = float(near.min())
            where = int(owner[pose[np.argmin(near)]])
        bound = distance - np.maximum(radius, end_radius) - (high - low) / 2
        open_ = (bound < best - NEAR) & (high - low > NEAR)
        pose, low, middle, high = pose[open_], low[open_], middle[open_], high[open_]
        first, last = radius[open_], end_radius[open_]
        pose = np.tile(pose, 2)
        low = np.r_[low, middle]
        high = np.r_[middle, high]
        radius = np.r_[first, (first + last) / 2]
        end_radius = np.r_[(first + last) / 2, last]
    return best, where


TOUCHING = 0.5
"""Distances of bodies are told to this, mm; nearer ones are contacts."""
SHARE = 0.02
"""Or to this share of them, where that is more: how far off they are exactly then matters to nobody."""
FIRST = 64.0
"""Places are so far apart at first, mm of motion,"""
FINER = 8
"""and so many times nearer each time, until half of that is NEAR."""
MOST_TURN = np.radians(2.0)
"""Of a rotary axis from one known pose to the next, rad: a point 500 mm off bows by 0.08 mm from the straight way."""
PART = "part"
"""The link of what stands on the table, in the part's frame."""


@dataclass(frozen=True, eq=False)
class _Way:
    """The `words` (mm, rad) of one cutter's moves in their order, the `moves` that they are of, and whether each is
    `joined` to the row before: else nothing is known of the way to it."""

    control: Control
    words: Float[ndarray, "n 5"]
    moves: Int[ndarray, " n"]
    joined: Bool[ndarray, " n"]

    def poses(self, link: str, words: Float[ndarray, "m 5"]) -> tuple[ndarray, ndarray]:
        """Rotations (m, 3, 3) and places (m, 3) of a link in the part's frame, at some words."""
        if link == PART:
            return np.tile(np.eye(3), (len(words), 1, 1)), np.zeros((len(words), 3))
        control = self.control
        return link_poses(control.machine, link, control.joints(words), control.tool_length)


@dataclass(frozen=True, eq=False)
class _Pair:
    """Two solids on links that move against each other on a way."""

    way: _Way
    solid: Solid
    link: str
    other: Solid
    other_link: str

    def poses(self, words: Float[ndarray, "m 5"]) -> tuple[Float[ndarray, "m 3 3"], Float[ndarray, "m 3"]]:
        """Rotations and places (mm) of the solid in the frame of the other one."""
        turned, at = self.way.poses(self.link, words)
        base, origin = self.way.poses(self.other_link, words)
        return np.einsum("nji,njk->nik", base, turned), np.einsum("nji,nj->ni", base, at - origin)

    def corners(self, words: Float[ndarray, "m 5"]) -> Float[ndarray, "m 8 3"]:
        """The corners of the solid's bounding box in the frame of the other one, mm."""
        turned, at = self.poses(words)
        return np.einsum("nij,kj->nki", turned, self.solid.corners) + at[:, None]

    def distance(self, words: Float[ndarray, "5"]) -> float:
        """The distance of the two at some words, mm."""
        turned, at = self.poses(words[None])
        return self.solid.distance(turned[0], at[0], self.other)


def body_clearance(
    motions: Motions, machine: Machine, cutters: Sequence[Cutter], clamping: Clamping, bounds: Float[ndarray, "2 3"]
) -> Clearance | None:
    """How near the bodies of a machine come to the tool, to one another, to table and chuck and to the box round the
    stock (`bounds`, mm), to NEAR or SHARE: the least of all pairs that move against each other; None where it
    has no bodies. They touch where that is not sure to be no contact. MachineError as in `body_meshes`."""
    if not machine.link_bodies:
        return None

    # Table, chuck and what stands there as one solid, if there is any
    meshes = [table_mesh(0.0)] if clamping.closed else []
    meshes += [column_mesh(column) for column in clamping.kept_off]
    fixed = [
        *([Solid("table or chuck", side_by_side(meshes))] if meshes else []),
        Solid("box round the stock", block_mesh(bounds)),
    ]
    solids = link_solids(machine)
    least = Clearance("bodies", None, 0)
    nearest = np.inf
    for cutter in cutters:
        rows = np.flatnonzero(motions.tools == cutter.number)
        if not len(rows):
            continue
        way = _way_of(motions, rows, motions.controls[cutter.number])
        for pair in _pairs(way, cutter, solids, fixed):
            distance, place, words = _least(pair, nearest)
            if distance < nearest:
                nearest = distance
                least = _clearance(pair, cutter, motions, distance, int(way.moves[place]), words)
            if nearest < TOUCHING:
                return least
    return least


def _clearance(
    pair: _Pair, cutter: Cutter, motions: Motions, distance: float, move: int, words: Float[ndarray, "5"]
) -> Clearance:
    """What is told of the least distance (mm) of a pair, in some words within a move."""
    name = pair.solid.name
    if pair.solid.name == "tool":
        parts = [(replace(pair, solid=one).distance(words), one.name) for one in _sections(cutter)]
        name = min(parts)[1]
    x, y, z = (float(value) for value in pair.way.control.poses(words[None])[0][0])
    line = int(motions.lines[move])
    return Clearance(name, Spot(distance, line, (x, y, z)), line if distance < TOUCHING else 0, other=pair.other.name)


def _way_of(motions: Motions, rows: Int[ndarray, " n"], control: Control) -> _Way:
    """The way of the moves `rows`, divided so that no rotary axis turns further than MOST_TURN at once."""
    end = motions.words[rows]
    joined = motions.known_start[rows] & np.r_[False, np.diff(rows) == 1]
    start = np.where(joined[:, None], np.vstack([end[:1], end[:-1]]), end)
    counts = np.ceil(np.abs(end - start)[:, 3:].max(axis=1) / MOST_TURN).astype(np.int64).clip(1)
    owner, place = numbered(counts)
    share = ((place + 1) / counts[owner])[:, None]
    words = start[owner] + share * (end - start)[owner]
    return _Way(control, words, rows[owner], joined[owner] | (place > 0))


def _pairs(way: _Way, cutter: Cutter, solids: dict[str, list[Solid]], fixed: Sequence[Solid]) -> Iterator[_Pair]:
    """The pairs of solids on links that move against each other, or may: bodies beside the part against what is on the
    tool's side, and bodies there against what stands on the table."""
    heads = carried_links(way.control.machine)
    tool = Solid("tool", side_by_side([section.mesh for section in _sections(cutter)]))
    for link, bodies in solids.items():
        for body in bodies:
            if link in heads:
                yield from (_Pair(way, body, link, one, PART) for one in fixed)
                continue
            yield _Pair(way, tool, heads[-1], body, link)
            for head in heads:
                yield from (_Pair(way, one, head, body, link) for one in solids.get(head, ()))


def _sections(cutter: Cutter) -> list[Solid]:
    """The sections of a tool, the nose of the spindle too, their origin at the spindle nose."""
    pose = np.eye(4)
    pose[2, 3] = -cutter.length
    first, *others = cutter.profile
    meshes = [(first.name, cutter_mesh(cutter, 0.0)), *((one.name, section_mesh(one)) for one in others)]
    return [Solid(name, mesh.move(pose)) for name, mesh in meshes]


def _least(pair: _Pair, within: float) -> tuple[float, int, Float[ndarray, "5"]]:
    """The least distance (mm) of a pair on its way, the row where it is and the words there; of distances that are not
    below `within` none."""
    way = pair.way
    corners = pair.corners(way.words)
    steps = np.linalg.norm(np.diff(corners, axis=0), axis=2).max(axis=1, initial=0.0)
    # half of what leads to a row that is not joined belongs to the row before it, half to it
    steps = np.where(way.joined[1:], steps, 2 * steps)
    along = np.r_[0.0, np.cumsum(steps)]
    best, row, found = within, 0, way.words[0]
    apart = FIRST
    places = np.arange(0.0, along[-1] + apart, apart)
    while len(places):
        places = np.minimum(places, along[-1])

        # Of some places on a way, whose rows are at the lengths `along`, the rows that they lead to and their words
        after = np.clip(np.searchsorted(along, places), 1, max(len(along) - 1, 1)).clip(max=len(along) - 1)
        before = np.maximum(after - 1, 0)
        step = along[after] - along[before]
        share = np.divide(places - along[before], step, out=np.ones(len(places)), where=step > 0)
        share = np.where(way.joined[after], share, np.round(share))
        words = way.words[before] + share[:, None] * (way.words[after] - way.words[before])
        rows = np.where(share > 0, after, before)

        corners = pair.corners(words)
        bounds = np.full(len(places), -np.inf)
        measured = np.zeros(len(places), dtype=bool)
        while True:
            k = int(np.argmin(np.where(measured, np.inf, bounds)))
            if measured[k] or bounds[k] - apart / 2 >= _to_beat(best):
                break
            distance = pair.distance(words[k])
            measured[k] = True
            if distance < best:
                best, row, found = distance, int(rows[k]), words[k]
            if best < TOUCHING:
                return best, row, found
            motion = np.linalg.norm(corners - corners[k], axis=2).max(axis=1)
            bounds = np.maximum(bounds, distance - motion)
        open_ = bounds - apart / 2 < _to_beat(best)
        apart /= FINER
        finer = (np.arange(FINER) - (FINER - 1) / 2) * apart
        places = np.maximum(places[open_][:, None] + finer, 0.0).ravel()
    return best, row, found


def _to_beat(best: float) -> float:
    """What a distance must be below to be told in the place of the `best` known, mm."""
    return best if best == np.inf else best - max(TOUCHING, SHARE * best)
