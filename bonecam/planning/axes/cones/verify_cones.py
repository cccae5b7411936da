"""FCL's word on cones of free axes (Xu et al. 2013, section 6): what the tool sweeps in a cone, against the meshes of
a scene.

The cones are proven by spheres in grids of distances; this shares neither. What the sections of the tool sweep for all
axes of a cone, grown by the node's reach, are closed meshes (`envelope.py`) that must not cross level, material, post
or what stands on the table. FCL never reports containment: so a point of each is tested for being inside the obstacles,
and one of each of their pieces for being inside of it.

Next to the contact the cutter touches the level: it is asked from where the empty ball at its contacts ends
(`Apexes.room`). The table's plane, like the limits of the machine, cuts the cones: it is no obstacle.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.mesh.healing.topology import pieces_of
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.axes.cones.admissible_cones import AxisCones
from bonecam.planning.axes.cones.envelope import Sweep
from bonecam.planning.axes.cones.obstacle_grids import require_closed
from bonecam.planning.collision.fcl_model import FclObject, crosses, fcl_object, solid_object
from bonecam.planning.collision.scene import Scene
from bonecam.planning.collision.tool_mesh import column_mesh
from bonecam.tool.cutter import Cutter, ToolSection
from bonecam.tool.path import ConeCheck

SIDES = 20, 96
"""Sides of meshes of what is swept: a cone that the coarse ones refuse is asked again with the fine ones. FCL takes
2.5 us a triangle to build a mesh, longer than to ask it once:"""
GRID = 0.2, np.radians(4.0)
"""coarse ones are a catalogue, shared by cones that are alike up to these steps (mm, radians), of all levels."""
CATALOGUE = 1024
"""So many are kept at most, about 0.3 MB each."""
SHRUNK = (0.9, 0.75, 0.5)
"""Shares of its angles that a refused cone is tried with."""
WIDEST = np.radians(80.0)
"""No semi-angle is rounded up beyond this, radians."""
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
    return ConeVerdict(asked, _refusals(cones, asked, _pairs(scene, cones.path.cutter)))


def verified_cones(cones: AxisCones, scene: Scene) -> AxisCones:
    """The cones, of which those are narrowed that FCL refuses: to the largest share of SHRUNK of their angles that it
    does not, or to none; `check` counts them."""
    pairs = _pairs(scene, cones.path.cutter)
    asked = np.flatnonzero(cones.shapes.found)
    refused = np.array(list(_refusals(cones, asked, pairs)), dtype=np.int64)
    shares = np.ones(len(cones.shapes))
    left = refused
    for share in SHRUNK:
        shares[left] = share
        tried = replace(cones, shapes=cones.shapes.scaled(shares))
        left = np.array(list(_refusals(tried, left, pairs)), dtype=np.int64)
    shares[left] = -1.0
    check = ConeCheck(len(asked), len(refused) - len(left), len(left))
    return replace(cones, shapes=cones.shapes.scaled(shares), check=check)


@dataclass(frozen=True, eq=False)
class _Solid:
    """An obstacle of a section of the tool: its name, its surface, a point of each of its pieces, how far it may reach
    out of its mesh (mm), and `distance`, negative inside."""

    name: str
    surface: FclObject
    pieces: Float[ndarray, "p 3"]
    deviation: float
    distance: Callable[[ndarray], ndarray]


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
    pairs = []
    for section in cutter.profile:
        around = scene.around(section.name, cutter.radius)
        if around.obstacle not in meshes:
            require_closed(around.mesh)
            points, distance = _piece_points(around.mesh), around.mesh_distance.signed
            surface = fcl_object(around.mesh)
            meshes[around.obstacle] = [], _Solid(around.obstacle, surface, points, around.deviation, distance)
        meshes[around.obstacle][0].append(section)
        for name, column in zip(["post", *["clamping"] * len(around.columns)], around.columns):
            top = np.array([[column.x, column.y, column.top]])
            solid = _Solid(name, fcl_object(column_mesh(column)), top, 0.0, column.distance)
            pairs.append(_Pair((section,), None, solid))
    for name, (sections, solid) in meshes.items():
        pairs.append(_Pair(tuple(sections), scene.tangent_slack if name == "level" else None, solid))
    return pairs


def _piece_points(mesh: TriangleMesh) -> Float[ndarray, "p 3"]:
    """A vertex of each connected piece."""
    _, first = np.unique(pieces_of(mesh), return_index=True)
    return mesh.vertices[mesh.faces[first, 0]]


def _refusals(cones: AxisCones, nodes: Int[ndarray, " m"], pairs: list[_Pair]) -> dict[int, str]:
    """For each of the nodes in whose cone the tool meets something, what does."""
    node_of = cones.free.apex_nodes
    asked = np.isin(node_of, nodes)
    found: dict[int, str] = {}
    for pair in pairs:
        for row, name in _meeting(cones, np.flatnonzero(asked), pair):
            found[int(node_of[row])] = f"{name} against the {pair.solid.name}"
        asked &= ~np.isin(node_of, list(found))
    return found


def _meeting(cones: AxisCones, rows: Int[ndarray, " m"], pair: _Pair) -> Iterator[tuple[int, str]]:
    """The apexes about which sections of the tool meet a solid in their cones, and one of these sections: first those
    that a mesh of the catalogue tells, then each of these with meshes of its own."""
    places, turns = cones.free.apexes.places[rows], _turns(cones, rows)
    sizes = _sizes(cones, rows, pair)
    keys, which = np.unique(_rounded(sizes), axis=0, return_inverse=True)
    for k, key in enumerate(keys):
        sweeps = _sweeps(cones.path.cutter, pair, key)
        some = np.flatnonzero(which.ravel() == k)
        if not sweeps:
            continue
        near = _near(sweeps, places[some], turns[some], pair.solid)
        met = near & _contained(sweeps, places[some], turns[some], pair.solid)
        for i in np.flatnonzero(near & ~met):
            met[i] = crosses(_catalogued(sweeps), turns[some[i]], places[some[i]], pair.solid.surface)
        for i in some[met]:
            own = _sweeps(cones.path.cutter, pair, sizes[i])
            name = _meeting_section(own, pair, places[i : i + 1], turns[i : i + 1])
            if name:
                yield int(rows[i]), name


def _meeting_section(
    sweeps: tuple[Sweep, ...], pair: _Pair, place: Float[ndarray, "1 3"], turn: Float[ndarray, "1 3 3"]
) -> str:
    """The lowest of the last sections of a pair whose sweep meets its solid, in meshes of its own; or an empty
    string."""
    for section, sweep in zip(pair.sections[len(pair.sections) - len(sweeps) :], sweeps, strict=True):
        meshes = (solid_object(*sweep.mesh(sides)) for sides in SIDES)
        if _contained((sweep,), place, turn, pair.solid)[0] or all(
            crosses(mesh, turn[0], place[0], pair.solid.surface) for mesh in meshes
        ):
            return section.name
    return ""


def _turns(cones: AxisCones, rows: Int[ndarray, " m"]) -> Float[ndarray, "m 3 3"]:
    """From the frames of the meshes to the scene."""
    shapes = cones.shapes.take(cones.free.apex_nodes[rows])
    return np.stack([shapes.sides, np.cross(shapes.axes, shapes.sides), shapes.axes], axis=2)


def _sizes(cones: AxisCones, rows: Int[ndarray, " m"], pair: _Pair) -> Float[ndarray, "m 4"]:
    """For each apex from where on the sections are asked (mm above it), both semi-angles (radians) and the growth
    (mm)."""
    apexes = cones.free.apexes
    shapes = cones.shapes.take(cones.free.apex_nodes[rows])
    begins = np.zeros(len(rows))
    if pair.slack is not None:
        lean = shapes.largest_angles(apexes.normals[rows]) + apexes.spread[rows] + RIM_ERROR
        begins = 2 * apexes.room[rows] * np.cos(np.minimum(lean, np.pi / 2))
    return np.column_stack([begins, shapes.angles, apexes.growth[rows] + pair.solid.deviation])


def _rounded(sizes: Float[ndarray, "m 4"]) -> Float[ndarray, "m 4"]:
    """Sizes of the catalogue, with which sweeps hold those of these."""
    step, turn = GRID
    steps = np.array([step, turn, turn, step])
    up = np.ceil(sizes / steps)
    up[:, 0] = np.floor(sizes[:, 0] / step)
    up[:, 1:3] = np.minimum(up[:, 1:3], np.maximum(np.floor(WIDEST / turn), sizes[:, 1:3] / turn))
    return np.asarray(steps * up)


def _sweeps(cutter: Cutter, pair: _Pair, size: Float[ndarray, "4"]) -> tuple[Sweep, ...]:
    """What the sections that begin or end above `size[0]` sweep."""
    begins, first, second, growth = map(float, size)
    found = []
    for section in pair.sections:
        start, end = max(section.start - cutter.radius, begins), section.end - cutter.radius
        if start < end:
            found.append(Sweep(start, end, section.widest - (pair.slack or 0.0), first, second, growth))
    return tuple(found)


def _near(
    sweeps: tuple[Sweep, ...], places: Float[ndarray, "n 3"], turns: Float[ndarray, "n 3 3"], solid: _Solid
) -> Bool[ndarray, " n"]:
    """Where a column may meet the sweeps: not further off than their reach about the middle of the cone's axis. Meshes
    may everywhere."""
    if solid.name in ("level", "material"):
        return np.ones(len(places), dtype=bool)
    middle = (sweeps[0].start + sweeps[-1].end) / 2
    reach = max(sweep.reach(middle) for sweep in sweeps)
    return np.asarray(solid.distance(places + middle * turns[:, :, 2]) <= reach)


def _contained(
    sweeps: tuple[Sweep, ...], places: Float[ndarray, "n 3"], turns: Float[ndarray, "n 3 3"], solid: _Solid
) -> Bool[ndarray, " n"]:
    """Where a point of the sweeps, which touch each other, lies inside a solid, or a piece of it inside of one."""
    lowest = sweeps[0]
    inside = solid.distance(places + (lowest.start + lowest.end) / 2 * turns[:, :, 2]) < 0
    for point in solid.pieces:
        seen = np.einsum("nij,ni->nj", turns, point - places)
        for sweep in sweeps:
            inside |= sweep.holds(seen, SIDES[0])
    return np.asarray(inside)


@lru_cache(maxsize=CATALOGUE)
def _catalogued(sweeps: tuple[Sweep, ...]) -> FclObject:
    """One mesh of all of these."""
    parts = [sweep.mesh(SIDES[0]) for sweep in sweeps]
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in parts)])
    faces = [faces + start for (_, faces), start in zip(parts, starts)]
    return solid_object(np.vstack([vertices for vertices, _ in parts]), np.vstack(faces))
