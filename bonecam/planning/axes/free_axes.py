"""A net of nodes on the surface of ball centres, each of which stands for the contacts round it.

The tool on a contact is the tool at the node moved by less than the node's reach. So what is proven at a node with
that much to spare holds for all of its contacts, and on the moves between them.

Directions as the triangles of an icosahedron on the unit sphere, each divided into four, several times.

Nested grids of distances to a closed mesh, fine near it and coarse far from it.

What the sections of a cutter stay out of in a scene, as compiled marching takes it, and the places where the
cutter pivots.

The free tool axes of every node of a net over the contacts of a path: a map of proven directions for each.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import combinations

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.spatial import KDTree

from bonecam.arrays import angles_between, frozen, lengths, unit
from bonecam.errors import OrientationError
from bonecam.kernels.cones import (
    Apexes,
    AxisLimits,
    LeafMesh,
    Obstacles,
    SphereTriangles,
    direction_maps,
    within_limits,
)
from bonecam.kernels.distances import Grids, distance_bounds, flood
from bonecam.machine.limits import MachineLimits
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.solids import edges_of
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.axes.lead import icosahedron_vertices, table_limits
from bonecam.planning.scene import Scene
from bonecam.runtime.threads import in_pieces
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import ContactPath


@dataclass(frozen=True, eq=False)
class ConeNodes:
    """Nodes at `places` (ball centres, mm); `node_of` each contact; how far a node's contacts are from it, with half
    of the moves that begin or end there (`reach`, mm); their mean normal, and the largest angle of one from it
    (`spread`, radians)."""

    places: Float[ndarray, "k 3"]
    node_of: Int[ndarray, " n"]
    reach: Float[ndarray, " k"]
    normals: Float[ndarray, "k 3"]
    spread: Float[ndarray, " k"]

    def __post_init__(self) -> None:
        for name in ("places", "reach", "normals", "spread"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        object.__setattr__(self, "node_of", frozen(self.node_of, np.int64))


def _means(group: Int[ndarray, " n"], values: Float[ndarray, " n"]) -> Float[ndarray, " k"]:
    return np.bincount(group, values) / np.bincount(group)


def _largest(group: Int[ndarray, " n"], values: Float[ndarray, " n"]) -> Float[ndarray, " k"]:
    largest = np.zeros(group.max(initial=-1) + 1)
    np.maximum.at(largest, group, values)
    return largest


def join_nets(nets: Sequence[tuple[ndarray, ConeNodes, ndarray]], contacts: int) -> ConeNodes:
    """One net over all `contacts` of nets over some of them (their rows) each, with those of its nodes that are
    kept."""
    node_of = np.full(contacts, -1)
    count = 0
    for rows, net, kept in nets:
        number = np.where(kept, count + np.cumsum(kept) - 1, -1)
        node_of[rows] = number[net.node_of]
        count += int(kept.sum())
    fields = ("places", "reach", "normals", "spread")
    joined = {name: np.concatenate([getattr(net, name)[kept] for _, net, kept in nets]) for name in fields}
    return ConeNodes(joined["places"], node_of, joined["reach"], joined["normals"], joined["spread"])


COARSEST, FINEST_LEVEL = 2, 4
"""Times that the 20 triangles are divided: those that are tried first (320, in cones of 10.8 degrees), and leaves
(5,120 of 2.7 degrees, 4 degrees apart at most)."""


@lru_cache(maxsize=1)
def sphere_leaves() -> tuple[SphereTriangles, LeafMesh]:
    """The triangles of all levels, and the leaves as a mesh."""
    vertices = icosahedron_vertices()
    near = vertices @ vertices.T > 0.4
    faces = np.array([(i, j, k) for i, j, k in combinations(range(12), 3) if near[i, j] and near[j, k] and near[i, k]])
    inward = np.linalg.det(vertices[faces]) < 0
    faces[inward] = faces[inward][:, [0, 2, 1]]
    levels = []
    for level in range(FINEST_LEVEL + 1):
        if level:
            # With every face in four, those of face i from 4 i on
            edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
            ends, which = np.unique(edges, axis=0, return_inverse=True)
            middles = unit(vertices[ends].sum(axis=1))
            c, a, b = (which.reshape(-1, 3) + len(vertices)).T
            i, j, k = faces.T
            parts = np.stack([(i, c, b), (j, a, c), (k, b, a), (a, b, c)])
            vertices = np.vstack([vertices, middles])
            faces = parts.transpose(2, 0, 1).reshape(-1, 3)
        if level >= COARSEST:
            # The centre of each triangle, and the largest angle (radians) to a corner, its rounding included
            corners = vertices[faces]
            centres = unit(corners.sum(axis=1))
            levels.append((centres, np.arccos(np.einsum("fi,fci->fc", centres, corners).min(axis=1)) + 1e-9))
    starts = np.cumsum([0, *(len(caps) for _, caps in levels)])
    centres, caps = (np.concatenate(part) for part in zip(*levels))

    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    ends, which = np.unique(edges, axis=0, return_inverse=True)
    order = np.argsort(which.ravel(), kind="stable")
    return SphereTriangles(centres, caps, starts), LeafMesh(vertices, faces, ends, (order // 3).reshape(-1, 2))


def leaf_centres() -> Float[ndarray, "5120 3"]:
    """Unit vectors to the centres of the leaves."""
    triangles, _ = sphere_leaves()
    return triangles.centres[triangles.starts[-2] :]


GRIDS = ((0.4, 3.0, 2.0, 0.0), (1.2, 14.0, 14.0, 0.02), (4.0, 60.0, np.inf, 0.01))
"""Sides of the cells, how far the grids reach out from the mesh and from the box of the ball centres, mm, and by which
share their distances may be too small; sides grow with the size of grids, and with the root of a radius above 1."""
USUAL_SIZE = 65.0
"""Diagonal (mm) of what a grid is about, up to which GRIDS hold: a quarter of a million nodes."""


def distance_grids(distance: MeshDistance, radius: float, far: float, centres: Float[ndarray, "n 3"]) -> Grids:
    """The grids of a mesh for tools of a `radius` that reach `far` out of it (mm) with their balls at `centres`: fine
    ones only where the tools are, since a bound of interpolated distances is low by the square of the cells.

    OrientationError where the mesh is not closed: what is inside of it cannot be told.
    """
    mesh = distance.mesh
    require_closed(mesh)
    needed = [grid for grid, nearer in zip(GRIDS, [0.0, *(reach for _, reach, *_ in GRIDS)]) if nearer < far]
    low, high = mesh.bounds
    grids = Grids(np.array([[0.0, *low, *high, 0.0]]), np.zeros(0))
    for side, reach, beside, slack in reversed(needed):
        near = beside if len(grids.values) else np.inf
        first = np.maximum(low, centres.min(axis=0) - near)
        last = np.maximum(np.minimum(high, centres.max(axis=0) + near), first)
        # a tool is free where the distance exceeds its radius, and there interpolation errs by 3 h^2 / (8 radius)
        step = side * max(1.0, float(np.linalg.norm(last - first)) / USUAL_SIZE) * max(1.0, radius**0.5)
        origin = first - max(reach, 2 * step)
        shape = np.ceil((last - first + 2 * max(reach, 2 * step)) / step).astype(np.int64) + 1
        nodes = (origin + step * np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1)).reshape(-1, 3)
        apart = distance.lower_bound(nodes, slack).reshape(shape)
        off = ((nodes < low) | (nodes > high)).any(axis=1)
        values = flood(apart, step, off | (distance_bounds(grids, nodes) > 0)).ravel()
        grids.cells[:-1, 7] += len(values)
        row = [step, *origin, *shape, 0.0]
        grids = Grids(np.vstack([row, grids.cells]), np.concatenate([values, grids.values]))
    return grids


def require_closed(mesh: TriangleMesh) -> None:
    """OrientationError where an edge of the mesh has not two faces."""
    _, counts = edges_of(mesh)
    if (counts % 2).any():
        open_ = int((counts % 2 == 1).sum())
        raise OrientationError(
            f"an obstacle is not closed: {open_} edges have a face on one side only: close it first", edges=open_
        )


ROOMS = tuple(0.2 * 2 ** (k / 2) for k in range(14))
"""By how much larger (mm) empty balls are sought that touch a contact; even the least is as if the surface were as
hollow as a ball that much larger than the cutter's."""

NOWHERE = 1e6
"""A mesh that is this far off (mm) is no obstacle."""


def obstacles_of(scene: Scene, cutter: Cutter, centres: Float[ndarray, "n 3"]) -> Obstacles:
    """The sections of the cutter with their obstacles round balls at `centres` (mm).

    OrientationError where a mesh of the scene is not closed.
    """
    rows: list[tuple[float, ...]] = []
    columns: list[tuple[float, ...]] = []
    for section in reversed(cutter.profile):
        around = scene.around(section.name, cutter.radius)
        is_level = around.obstacle == "level"
        first = len(columns)
        columns += [column.row for column in around.columns]
        start, end = section.start - cutter.radius, section.end - cutter.radius
        radius = section.widest - (scene.tangent_slack if is_level else 0.0)
        rows.append((start, end, radius, float(is_level), around.deviation, first, len(columns), 0, 0))
    sections = np.array(rows)
    to_level = sections[:, 3] > 0
    grids = [
        distance_grids(distance, cutter.radius, sections[held, 1].max(initial=0.0) + cutter.radius, centres)
        for distance, held in ((scene.level_distance, to_level), (scene.material_distance, ~to_level))
    ]
    cells = [grid.cells.copy() for grid in grids]
    cells[1][:, 7] += len(grids[0].values)
    sections[:, 7] = np.where(to_level, 0, len(cells[0]))
    sections[:, 8] = np.where(to_level, len(cells[0]), len(cells[0]) + len(cells[1]))
    values = np.concatenate([grid.values for grid in grids])
    return Obstacles(sections, np.array(columns, dtype=float).reshape(-1, 5), np.concatenate(cells), values)


def single_obstacles(obstacles: Obstacles, section: int) -> Iterator[tuple[str, Obstacles]]:
    """Each obstacle of a section of the tool by its name, alone."""
    row = obstacles.sections[section].copy()
    first, end = int(row[5]), int(row[6])
    row[6] = first
    yield ("level" if row[3] else "material"), obstacles._replace(sections=row[None])
    row = row.copy()
    row[4] = -NOWHERE
    for column in range(first, end):
        alone = row.copy()
        alone[5:7] = column, column + 1
        yield ("clamping" if column > first else "post"), obstacles._replace(sections=alone[None])


def rooms_at(path: ContactPath, scene: Scene) -> Float[ndarray, " n"]:
    """How much larger (mm) than the cutter's ball a ball may be that touches each contact from outside and meets no
    obstacle: of ROOMS the largest for which this holds, or 0."""
    around = scene.around("cutter", path.cutter.radius)
    rooms = np.array([0.0, *ROOMS])
    free, most = np.zeros((2, len(path.centres)), dtype=np.int64)
    most += len(ROOMS)
    left = np.arange(len(path.centres))
    while len(left):
        # a ball contains the smaller ones that touch the same contact
        tried = (free[left] + most[left] + 1) // 2
        more = rooms[tried]
        radius = path.cutter.radius + more - scene.tangent_slack
        middles = path.centres[left] + more[:, None] * path.normals[left]
        empty = around.distance_bound(middles, radius, outside=True) >= radius
        free[left[empty]] = tried[empty]
        most[left[~empty]] = tried[~empty] - 1
        left = left[free[left] < most[left]]
    return rooms[free]


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
        # Nodes about `spacing` (mm) apart; `middles` are those of the moves to and from each contact.
        centres = path.centres[left]
        normals = path.normals[left]
        cells = np.floor(centres / spacing).astype(np.int64)
        facing = normals @ np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]).T
        _, first = np.unique(np.column_stack([cells, facing.argmax(axis=1)]), axis=0, return_inverse=True)
        means = np.column_stack([_means(first, x) for x in np.hstack([centres, normals]).T])
        # a contact goes to the nearest node that faces its way: a groove's walls are near each other
        apart = np.hstack([means[:, :3] / spacing, unit(means[:, 3:])])
        _, node = KDTree(apart).query(np.hstack([centres / spacing, normals]))
        _, node_of = np.unique(node, return_inverse=True)
        points = np.column_stack([_means(node_of, x) for x in centres.T])
        facing_of = unit(np.column_stack([_means(node_of, x) for x in normals.T]))
        # half a move, being straight, is no further off than its ends
        ends = np.concatenate([centres[:, None], middles[left]], axis=1)
        off = np.linalg.norm(ends - points[node_of][:, None], axis=2).max(axis=1)
        turned = 2 * np.arcsin(np.clip(lengths(normals - facing_of[node_of]) / 2, 0, 1))
        net = ConeNodes(points, node_of, _largest(node_of, off), facing_of, _largest(node_of, turned))
        # where the cutter pivots, with the least room of the contacts there
        least = np.full(len(net.places), np.inf)
        np.minimum.at(least, net.node_of, room[left])
        apexes = Apexes(net.places, net.reach, net.normals, net.spread, least)
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
