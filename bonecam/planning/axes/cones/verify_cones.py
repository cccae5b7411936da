"""FCL's word on cones of free axes (Xu et al. 2013, section 6): what the tool sweeps in a cone, against the meshes of
a scene.

The cones are proven by spheres in grids of distances; this shares neither. What the sections of the tool sweep for
all axes of a cone, grown by the node's reach, are closed meshes (`envelope_catalogue`) that must not cross level,
material, post or what stands on the table. FCL is asked where no planes tell the sweep from each of their triangles.
It never reports containment: so a point of each is tested for being inside the obstacles, and one of each of their
pieces for being inside of it.

Next to the contact the cutter touches the level: it is asked from where the empty ball at its contacts ends
(`Apexes.room`). The table's plane, like the limits of the machine, cuts the cones: it is no obstacle.

The contacts of some nodes as apexes of their own: a node's apex is grown by how far its contacts are from it, and
stands for the largest turn of their normals; those of contacts need half of their moves alone.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.kernels.closest.cone_marching import Apexes
from bonecam.kernels.closest.swept_bounds import swept_hold
from bonecam.mesh.healing.topology import pieces_of
from bonecam.planning.axes.cones.admissible_cones import AxisCones
from bonecam.planning.axes.cones.envelope_catalogue import SIDES, Obstacle, crossing
from bonecam.planning.axes.cones.free_axes import FreeAxes, half_moves
from bonecam.planning.axes.cones.obstacle_grids import require_closed
from bonecam.planning.axes.cones.obstacles import rooms_at
from bonecam.planning.collision.scene import Scene, Surroundings
from bonecam.planning.collision.tool_mesh import column_mesh
from bonecam.tool.cutter import Cutter, ToolSection
from bonecam.tool.path import ConeCheck, ContactPath
from bonecam.workholding.column import Column


def at_contacts(free: FreeAxes, nodes: Int[ndarray, " m"], path: ContactPath, scene: Scene) -> FreeAxes:
    """The free axes of a path with an apex for each contact of these nodes, and none for other nodes; a node of one
    contact that has several apexes keeps them."""
    node_of = free.net.node_of
    of_apex = free.apex_nodes
    several = np.diff(free.starts) > 1
    rows = np.flatnonzero(np.isin(node_of, nodes) & ~several[node_of])
    kept = np.flatnonzero(np.isin(of_apex, nodes) & several[of_apex])
    places = path.centres[rows]
    growth = np.linalg.norm(half_moves(path)[rows] - places[:, None], axis=2).max(axis=1, initial=0.0)
    made = places, growth, path.normals[rows], np.zeros(len(rows)), rooms_at(path.take(rows), scene)
    each = np.r_[node_of[rows], of_apex[kept]]
    order = np.argsort(each, kind="stable")
    apexes = Apexes(*(np.concatenate([new, old[kept]])[order] for new, old in zip(made, free.apexes)))
    counts = np.bincount(each, minlength=len(free.net.places))
    return replace(free, apexes=apexes, starts=np.cumsum(np.r_[0, counts]))


SHRUNK = (0.9, 0.75, 0.5)
"""Shares of its angles that a refused cone is tried with."""
RIM_ERROR = 0.01
"""The lean of the rim of a cone may be larger by this between the directions that are asked, radians."""


@dataclass(frozen=True, eq=False)
class ConeVerdict:
    """The nodes whose cones were `asked`, and for those (k) that FCL does not find free what meets, as `shank against
    the material`."""

    asked: Int[ndarray, " n"]
    refused: dict[int, str]


def verify_cones(cones: AxisCones, scene: Scene) -> ConeVerdict:
    """FCL's word on each cone, in the scene that they were made in. OrientationError where a mesh of it is not
    closed."""
    asked = np.flatnonzero(cones.shapes.found)
    return ConeVerdict(asked, _judged(cones, asked, scene, _pairs(scene, cones.path.cutter))[1])


def verified_cones(cones: AxisCones, scene: Scene) -> AxisCones:
    """The cones, of which those are narrowed that FCL refuses: to the largest share of SHRUNK of their angles that it
    does not, or to none; `check` counts them."""
    pairs = _pairs(scene, cones.path.cutter)
    asked = np.flatnonzero(cones.shapes.found)
    near, refusals = _judged(cones, asked, scene, pairs)
    refused = np.array(list(refusals), dtype=np.int64)
    shares = np.ones(len(cones.shapes))
    left = refused
    for share in SHRUNK:
        shares[left] = share
        tried = replace(near, shapes=cones.shapes.scaled(shares))
        left = np.array(list(_refusals(tried, left, pairs)), dtype=np.int64)
    shares[left] = -1.0
    check = ConeCheck(len(asked), len(refused) - len(left), len(left))
    return replace(cones, shapes=cones.shapes.scaled(shares), check=check)


def _judged(
    cones: AxisCones, nodes: Int[ndarray, " m"], scene: Scene, pairs: list["_Pair"]
) -> tuple[AxisCones, dict[int, str]]:
    """The cones, those that FCL refuses at their nodes taken to each of their contacts, and what it refuses there
    too."""
    refused = np.array(list(_refusals(cones, nodes, pairs)), dtype=np.int64)
    near = replace(cones, free=at_contacts(cones.free, refused, cones.path, scene))
    return near, _refusals(near, refused, pairs)


@dataclass(frozen=True, eq=False)
class _Solid:
    """An obstacle of a section of the tool: its name, its surface, a point of each of its pieces, how far it may reach
    out of its mesh (mm), and which points are `inside`."""

    name: str
    obstacle: Obstacle
    pieces: Float[ndarray, "p 3"]
    deviation: float
    inside: Callable[[ndarray], ndarray]

    @classmethod
    def of_mesh(cls, around: Surroundings) -> "_Solid":
        """The mesh that a section stays out of. OrientationError where it is not closed."""
        mesh = around.mesh
        require_closed(mesh)
        _, first = np.unique(pieces_of(mesh), return_index=True)
        pieces = mesh.vertices[mesh.faces[first, 0]]
        distance = around.mesh_distance
        obstacle = Obstacle.known(distance)
        return cls(around.obstacle, obstacle, pieces, around.deviation, distance.inside)

    @classmethod
    def of_column(cls, name: str, column: Column) -> "_Solid":
        """A column."""
        top = np.array([[column.x, column.y, column.top]])
        return cls(name, Obstacle.of(column_mesh(column)), top, 0.0, column.holds)


@dataclass(frozen=True, eq=False)
class _Pair:
    """Neighbouring sections of the tool, by how much thinner they are held against the level (mm; None: against
    anything else), and one obstacle of theirs."""

    sections: tuple[ToolSection, ...]
    slack: float | None
    solid: _Solid


def _pairs(scene: Scene, cutter: Cutter) -> list[_Pair]:
    """What is asked together: the sections that stay out of one mesh, and each section with each of its columns."""
    meshes: dict[str, tuple[list[ToolSection], _Solid]] = {}
    columns: dict[Column, _Solid] = {}
    pairs = []
    for section in cutter.profile:
        around = scene.around(section.name, cutter.envelope_radius)
        if around.obstacle not in meshes:
            meshes[around.obstacle] = [], _Solid.of_mesh(around)
        meshes[around.obstacle][0].append(section)
        for name, column in zip(["post", *["clamping"] * len(around.columns)], around.columns):
            if column not in columns:
                columns[column] = _Solid.of_column(name, column)
            pairs.append(_Pair((section,), None, columns[column]))
    for name, (sections, solid) in meshes.items():
        pairs.append(_Pair(tuple(sections), scene.tangent_slack if name == "level" else None, solid))
    return pairs


def _refusals(cones: AxisCones, nodes: Int[ndarray, " m"], pairs: list[_Pair]) -> dict[int, str]:
    """For each of the nodes in whose cone the tool meets something, what does."""
    node_of = cones.free.apex_nodes
    asked = np.isin(node_of, nodes)
    refusals: dict[int, str] = {}
    for pair in pairs:
        for row, name in _meeting(cones, np.flatnonzero(asked), pair):
            refusals[int(node_of[row])] = f"{name} against the {pair.solid.name}"
        asked &= ~np.isin(node_of, list(refusals))
    return refusals


def _meeting(cones: AxisCones, rows: Int[ndarray, " m"], pair: _Pair) -> Iterator[tuple[int, str]]:
    """The apexes about which sections of the tool meet a solid in their cones, and the lowest of these sections."""
    solid = pair.solid
    height = cones.path.cutter.centre_height
    apexes = cones.free.apexes.places[rows]
    # From the frames of the meshes to the scene
    shapes = cones.shapes.take(cones.free.apex_nodes[rows])
    turns = np.stack([shapes.sides, np.cross(shapes.axes, shapes.sides), shapes.axes], axis=2)
    begins = _begins(cones, rows, pair)
    angles = cones.shapes.angles[cones.free.apex_nodes[rows]]
    growth = cones.free.apexes.growth[rows] + solid.deviation
    # sections follow each other, so where none crosses the solid, all are inside of it with their lowest point, or none
    lowest = np.maximum(begins, pair.sections[0].start - height)
    inside = solid.inside(apexes + lowest[:, None] * turns[:, :, 2])
    left = np.ones(len(rows), dtype=bool)
    for section in pair.sections:
        starts, end = np.maximum(begins, section.start - height), section.end - height
        some = np.flatnonzero(left & (starts < end))
        shape = np.tile([end, section.widest - (pair.slack or 0.0)], (len(some), 1))
        sizes = np.column_stack([starts[some], shape, angles[some], growth[some]])
        met = inside[some]
        asked = np.flatnonzero(~met)
        asked = asked[~solid.obstacle.clear(sizes[asked], apexes[some[asked]], turns[some[asked]])]
        here = sizes[asked]
        poses = (apexes[some[asked]], turns[some[asked]])
        met[asked] = _holds_piece(here, *poses, solid) | crossing(here, *poses, solid.obstacle)
        left[some[met]] = False
        for i in some[met]:
            yield int(rows[i]), section.name


def _begins(cones: AxisCones, rows: Int[ndarray, " m"], pair: _Pair) -> Float[ndarray, " m"]:
    """From where on the sections are asked, mm above the apexes: flutes from where the empty ball at the contact
    ends."""
    if pair.slack is None:
        return np.zeros(len(rows))
    apexes = cones.free.apexes
    shapes = cones.shapes.take(cones.free.apex_nodes[rows])
    lean = shapes.largest_angles(apexes.normals[rows]) + apexes.spread[rows] + RIM_ERROR
    return 2 * apexes.room[rows] * np.cos(np.minimum(lean, np.pi / 2))


def _holds_piece(
    sizes: Float[ndarray, "n 6"], apexes: Float[ndarray, "n 3"], turns: Float[ndarray, "n 3 3"], solid: _Solid
) -> Bool[ndarray, " n"]:
    """Where a piece of a solid may lie inside of what is swept."""
    held = np.zeros(len(sizes), dtype=bool)
    for point in solid.pieces:
        seen = np.einsum("nij,ni->nj", turns, point - apexes)
        held |= swept_hold(sizes, SIDES, seen)
    return held
