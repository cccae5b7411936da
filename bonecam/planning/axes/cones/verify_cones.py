"""FCL's word on cones of free axes (Xu et al. 2013, section 6): what the tool sweeps in a cone, against the meshes of
a scene.

The cones are proven by spheres in grids of distances; this shares neither. What each section of the tool sweeps for all
axes of a cone, grown by the node's reach, is a closed mesh (`envelope.py`) that must not cross level, material, post or
what stands on the table. FCL never reports containment: so a point of it is tested for being inside the obstacles, and
one of each of their pieces for being inside of it.

Next to the contact the cutter touches the level: it is asked from where the empty ball at its contacts ends
(`Apexes.room`). The table's plane, like the limits of the machine, cuts the cones: it is no obstacle.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.arrays import rotations_of
from bonecam.mesh.healing.topology import pieces_of
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.axes.cones.admissible_cones import NO_CONE, AxisCones
from bonecam.planning.axes.cones.envelope import Sweep, held
from bonecam.planning.axes.cones.obstacle_grids import require_closed
from bonecam.planning.collision.fcl_model import FclObject, crosses, fcl_object, solid_object
from bonecam.planning.collision.scene import Scene
from bonecam.planning.collision.tool_mesh import column_mesh
from bonecam.tool.cutter import Cutter, ToolSection
from bonecam.tool.path import ConeCheck

SIDES = 24, 96
"""Sides of meshes of what is swept: a cone that the coarse one refuses is asked again with the fine one. An FCL object
takes 2.5 us a triangle to build, longer than it takes to ask it:"""
GRID = 0.1, np.radians(1.0)
"""coarse ones are shared first by cones that are alike up to these steps (mm, radians)."""
SHRUNK = (0.9, 0.75, 0.5)
"""Shares of its angle that a refused cone is tried with."""


@dataclass(frozen=True, eq=False)
class ConeVerdict:
    """The nodes whose cones were `asked`, and for those (k) that FCL does not find free what meets, as `shank against
    the material`."""

    asked: Int[ndarray, " n"]
    refused: dict[int, str]


def verify_cones(cones: AxisCones, scene: Scene) -> ConeVerdict:
    """FCL's word on each cone, in the scene that they were made in. OrientationError where a mesh of it is not
    closed."""
    asked = np.flatnonzero(cones.angles > 0)
    return ConeVerdict(asked, _refusals(cones, asked, cones.angles[asked], _kept(scene, cones.path.cutter)))


def verified_cones(cones: AxisCones, scene: Scene) -> AxisCones:
    """The cones, of which those are narrowed that FCL refuses: to the largest share of SHRUNK of their angle that it
    does not, or to none; `check` counts them."""
    kept = _kept(scene, cones.path.cutter)
    asked = np.flatnonzero(cones.angles > 0)
    refused = np.array(list(_refusals(cones, asked, cones.angles[asked], kept)), dtype=np.int64)
    angles = cones.angles.copy()
    left = refused
    for share in SHRUNK:
        angles[left] = share * cones.angles[left]
        left = np.array(list(_refusals(cones, left, angles[left], kept)), dtype=np.int64)
    angles[left] = NO_CONE
    return replace(cones, angles=angles, check=ConeCheck(len(asked), len(refused) - len(left), len(left)))


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
class _Kept:
    """A section of the tool, by how much thinner it is held against the level (mm; None: against the material), and its
    obstacles."""

    section: ToolSection
    slack: float | None
    solids: tuple[_Solid, ...]


def _kept(scene: Scene, cutter: Cutter) -> tuple[_Kept, ...]:
    """The sections of a cutter from the spindle down, with what they stay out of."""
    meshes: dict[str, tuple[FclObject, ndarray]] = {}
    kept = []
    for section in reversed(cutter.profile):
        around = scene.around(section.name, cutter.radius)
        if around.obstacle not in meshes:
            require_closed(around.mesh)
            meshes[around.obstacle] = fcl_object(around.mesh), _piece_points(around.mesh)
        mesh = _Solid(
            around.obstacle, *meshes[around.obstacle], around.deviation, around.mesh_distance.signed
        )
        columns = [
            _Solid(
                name, fcl_object(column_mesh(column)), np.array([[0, 0, column.top]]), 0.0, column.distance
            )
            for name, column in zip(["post", *["clamping"] * len(around.columns)], around.columns)
        ]
        slack = scene.tangent_slack if around.obstacle == "level" else None
        kept.append(_Kept(section, slack, (mesh, *columns)))
    return tuple(kept)


def _piece_points(mesh: TriangleMesh) -> Float[ndarray, "p 3"]:
    """A vertex of each connected piece."""
    _, first = np.unique(pieces_of(mesh), return_index=True)
    return mesh.vertices[mesh.faces[first, 0]]


def _refusals(
    cones: AxisCones, nodes: Int[ndarray, " m"], angles: Float[ndarray, " m"], kept: tuple[_Kept, ...]
) -> dict[int, str]:
    """For each of the nodes in whose cone with this angle (radians) the tool meets something, what does."""
    found: dict[int, str] = {}
    for item in kept:
        for solid in item.solids:
            free = np.array([int(k) not in found for k in nodes], dtype=bool)
            for k in _meeting(cones, nodes[free], angles[free], item, solid):
                found[k] = f"{item.section.name} against the {solid.name}"
    return found


def _meeting(
    cones: AxisCones, nodes: Int[ndarray, " m"], angles: Float[ndarray, " m"], item: _Kept, solid: _Solid
) -> Iterator[int]:
    """The nodes in whose cones a section of the tool meets a solid."""
    sweeps = [_sweep(cones, k, angle, item, solid) for k, angle in zip(nodes.tolist(), angles.tolist())]
    there = np.array([sweep.start < sweep.end for sweep in sweeps], dtype=bool)
    if not there.any():
        return
    nodes, sweeps = nodes[there], [sweep for sweep, is_there in zip(sweeps, there) if is_there]
    places, axes = cones.free.apexes.places[nodes], cones.axes[nodes]
    heights = np.array([(sweep.start + sweep.end) / 2 for sweep in sweeps])
    contained = solid.distance(places + heights[:, None] * axes) < 0
    for point in solid.pieces:
        contained |= held(point, places, axes, sweeps)
    for k, sweep, place, turn, inside in zip(nodes, sweeps, places, rotations_of(axes), contained):
        if inside or all(crosses(mesh, turn, place, solid.surface) for mesh in _meshes(sweep)):
            yield int(k)


def _sweep(cones: AxisCones, node: int, angle: float, item: _Kept, solid: _Solid) -> Sweep:
    """What a section sweeps in the cone of a node with this angle (radians), grown by what the solid needs."""
    apexes, section, radius = cones.free.apexes, item.section, cones.path.cutter.radius
    start, thick = section.start - radius, section.widest
    if item.slack is not None:
        cosine = np.clip(cones.axes[node] @ apexes.normals[node], -1.0, 1.0)
        lean = min(np.arccos(cosine) + apexes.spread[node] + angle, np.pi / 2)
        start = max(start, 2 * apexes.room[node] * np.cos(lean))
        thick -= item.slack
    growth = apexes.growth[node] + solid.deviation
    return Sweep(float(start), section.end - radius, thick, float(angle), float(growth))


def _meshes(sweep: Sweep) -> Iterator[FclObject]:
    """Meshes that hold a sweep, the cheapest first."""
    yield _shared(sweep.rounded(*GRID))
    for sides in SIDES:
        yield solid_object(*sweep.mesh(sides))


@lru_cache(maxsize=4096)
def _shared(sweep: Sweep) -> FclObject:
    return solid_object(*sweep.mesh(SIDES[0]))
