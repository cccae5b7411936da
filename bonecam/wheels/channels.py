"""The tool paths of the channel between two blades of a wheel, from the blank down to the hub.

The levels are an open morph from the hub to the blank. The ball follows each level as far as the blades beside it let
it, which keep an allowance for their own cut. All channels are cut to one level before any is cut to the next, so that
what stands is, everywhere, no higher than the level before, which is what shank and holder keep off.

Lines of a pattern end wherever a blade begins, so that what they leave beside it is up to a side step thick. More lines
follow the blades, and run round their edges where passes go on beyond them. The path of one channel or blade is
repeated at every pitch about the Z axis.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import lengths
from bonecam.errors import MachineError, place_name
from bonecam.job import Job, field_error
from bonecam.levels import Level
from bonecam.levels.measure import MachinedLevel, machined_levels
from bonecam.machine import Machine, MachineLimits
from bonecam.mesh import MeshDistance, TriangleMesh
from bonecam.mesh.meshlab import split_edges
from bonecam.mesh.solids import solid_union
from bonecam.nc import machine_limits
from bonecam.planning import Scene, candidate_contacts, contact_path, orient
from bonecam.planning.axes.lead import check_lead
from bonecam.planning.estimate import cutter_of
from bonecam.planning.layers import HeightMesh
from bonecam.planning.link_space import UP
from bonecam.planning.patterns import LineContacts, feeds_along
from bonecam.planning.spacing import ROUND, contact_frames
from bonecam.setup import Capsule
from bonecam.surface import TSpline
from bonecam.tool import ToolPath
from bonecam.tool.elliptic_cones import EllipticCones
from bonecam.wheels.wheel import Channel, Wheel, revolved
from bonecam.workholding import Post, clamping_of


def require_upright(machine: Machine) -> None:
    """MachineError where the tool cannot stand upright over the wheel's axis, from where it goes to the next blade."""
    if (machine_limits(machine).nearest(UP[None])[0] != UP).any():
        what = "its tool cannot stand along the wheel's axis, over which it goes from blade to blade"
        raise MachineError(f"{machine.name}: {what}: take a mill of five axes", machine=machine.name)


def require_room(wheel: Wheel, job: Job) -> None:
    """JobError where a cutter does not pass between two blades."""
    gap, place = wheel.gap()
    for name in ("roughing", "finishing"):
        width = 2 * job.tool(name).radius
        kept = 2 * job.levels.finishing_depth if name == "roughing" else 0.0
        if gap < width + kept:
            need = f"{width:g} mm" + (f" and the allowance of {kept:g} mm on both blades" if kept else "")
            what = f"the blades are {gap:.2f} mm apart at {place_name(place)}, the ball needs {need}"
            raise field_error(name, "radius", job.tool(name).radius, f"{what}: give a smaller ball")


CELL = 0.3
"""Distance of the places on which the lines are found, mm."""
STEP = 0.4
"""Contacts are about so far apart, mm."""
SPARE = 0.03
"""The ball keeps so much more from the blades, mm: what lines between places CELL apart are off by."""
SHORTEST = 1.0
"""A shorter line is left out, mm."""


def wall_cusp(job: Job) -> float:
    """What stands on the blades between two levels beside what the roughing ball touches, mm."""
    radius = job.tool("roughing").radius
    half = job.deepest("roughing") / 2
    return SPARE + radius - float(np.sqrt(max(radius**2 - half**2, 0.0)))


def wall_contacts(surface: TSpline, distance: MeshDistance, radius: float) -> list[LineContacts]:
    """The lines on which a ball of `radius` (mm) that follows an open surface comes nearest to the walls on it."""
    from contourpy import contour_generator

    (left, right), (low, high) = surface.domain

    # The largest extents along s and along t, mm, on a few lines
    extents = []
    for k in range(2):
        ways = []
        for at in np.linspace(0.0, 1.0, 5):
            u = np.linspace(0.0, 1.0, 65)
            s, t = (u, np.full(65, at)) if k == 0 else (np.full(65, at), u)
            line = surface.positions(left + s * (right - left), low + t * (high - low))
            ways.append(float(lengths(np.diff(line, axis=0)).sum()))
        extents.append(max(ways))
    across, along = extents

    s = np.linspace(left, right, int(across / CELL) + 2)
    t = np.linspace(low, high, int(along / CELL) + 2)
    parameters = np.stack(np.meshgrid(s, t, indexing="ij"), axis=2).reshape(-1, 2)
    points, normals, _ = contact_frames(surface, parameters, ROUND)
    least = radius + SPARE
    # walls are beside the ball; the level itself touches it from below, by up to its mesh's deviation
    field = distance.signed(points + (radius + SPARE) * normals, least + CELL) - least
    field = np.minimum(field + RESTS, CELL).reshape(len(s), len(t))
    lines = []
    for contour in (line[:, ::-1] for line in contour_generator(t, s, field).lines(0.0)):
        way = np.r_[0.0, np.cumsum(lengths(np.diff(surface.positions(*contour.T), axis=0)))]
        if way[-1] >= SHORTEST:
            places = np.linspace(0.0, way[-1], int(way[-1] / STEP) + 2)
            parameters = np.column_stack([np.interp(places, way, contour[:, k]) for k in range(2)])
            points, normals, _ = contact_frames(surface, parameters, ROUND)
            feeds = feeds_along(np.gradient(points, axis=0), normals)
            lines.append(LineContacts(parameters, points, normals, feeds))
    return lines


RESTS = 0.02
"""A ball enters the mesh of its own level by so much, mm."""
PLACES = 0.8
"""Places of what stands are no farther apart, mm."""
CHORD = 0.1
"""Chord tolerance of the bodies under levels, and of the blades on them, mm."""


@dataclass(frozen=True, eq=False)
class _Body:
    """A closed mesh, out of which what stands reaches by a `deviation` at most, mm."""

    mesh: TriangleMesh
    deviation: float

    @property
    def material(self) -> HeightMesh:
        """What links between passes are held against."""
        return HeightMesh(split_edges(self.mesh, PLACES), self.deviation)


@dataclass(frozen=True, eq=False)
class ChannelPlanner:
    """What the paths of all levels of a channel share; `capsule` encloses the blank."""

    channel: Channel
    job: Job
    limits: MachineLimits
    post: Post
    capsule: Capsule

    def paths(self, levels: Sequence[Level]) -> tuple[list[ToolPath], HeightMesh]:
        """The paths of one channel in machining order, one a level, and what stands after them in all channels;
        `levels` begin at the hub and end at the blank."""
        paths = []
        above = _Body(revolved(self.channel.blank, CHORD, self.channel.wheel.count), CHORD)
        for level in machined_levels(levels)[::-1]:
            # what is left where all channels are cut to a level: blades with their allowance, and what lies under it
            left = _Body(self._finished, self._blade_chord + wall_cusp(self.job))
            if level.index:
                profile, off = self.channel.under(level.surface)
                under = revolved(profile, CHORD, self.channel.wheel.count)
                left = _Body(solid_union([under, self._finished]), off + CHORD + wall_cusp(self.job))
            paths.append(self._path(level, left, above))
            above = left
        return paths, above.material

    @cached_property
    def _finished(self) -> TriangleMesh:
        """Hub and others, and the blades with their allowance."""
        wheel = self.channel.wheel
        chord = self._blade_chord
        blades = wheel.grown_blades(self.job.levels.finishing_depth - 2 * chord, chord)
        return solid_union([revolved(wheel.profile, CHORD, wheel.count), *blades, *wheel.others])

    @property
    def _blade_chord(self) -> float:
        """Chord tolerance of the blades with their allowance, mm."""
        return min(CHORD, self.job.levels.finishing_depth / 4)

    def _path(self, level: MachinedLevel, left: "_Body", before: "_Body") -> ToolPath:
        """The path of a level that leaves one body of another."""
        job = self.job
        cutter = cutter_of(level.index, self.job, self.limits.bodies)
        check_lead(cutter, job.path.lead_deg)
        distance = MeshDistance(left.mesh)
        scene = Scene(
            level=left.mesh,
            material=before.mesh,
            material_deviation=before.deviation,
            stock=self.capsule,
            post=self.post,
            known_level_distance=distance,
            clamping=clamping_of(job.holding, self.limits.bodies.table),
        )
        walls = wall_contacts(level.surface, distance, cutter.radius)
        candidates = candidate_contacts(level, [distance], cutter, self.post, job.path, walls=walls)
        contacts = contact_path(candidates)
        return orient(contacts, scene, self.limits, job.path, job.nc, material=before.material)


ON_AXIS = 1e-6
"""A path that begins and ends so near to the Z axis with an upright tool goes on from turn to turn there, mm."""


def indexed(path: ToolPath, count: int) -> ToolPath:
    """The moves of a path and of its copies, each turned by a `count`-th of a turn more, one after the other.

    ValueError where the safe point of the path is not on the axis, the tool upright: turning there moves no tip.
    """
    ends = path.tips[[0, -1]], path.axes[[0, -1], :2]
    if max(float(np.abs(ends[0][:, :2]).max()), float(np.abs(ends[1]).max())) > ON_AXIS:
        raise ValueError("a path that is repeated about Z begins and ends over Z, its tool upright")
    rows = len(path.tips)
    passes = int(path.pass_index.max()) + 1
    cones = path.cones
    if cones:
        axes, sides = (_turned(vectors, count) for vectors in (cones.shapes.axes, cones.shapes.sides))
        copies = [np.where(cones.cone_of < 0, -1, cones.cone_of + k * len(cones.apexes)) for k in range(count)]
        cones = replace(
            cones,
            apexes=_turned(cones.apexes, count),
            shapes=EllipticCones(axes, sides, np.tile(cones.shapes.angles, (count, 1))),
            cone_of=np.concatenate(copies),
        )
    number = np.repeat(np.arange(count), rows)
    index = np.tile(path.pass_index, count)
    return replace(
        path,
        kinds=np.tile(path.kinds, count),
        pass_index=np.where(index < 0, -1, index + number * passes),
        parameters=np.tile(path.parameters, (count, 1)),
        contacts=_turned(path.contacts, count),
        tips=_turned(path.tips, count),
        axes=_turned(path.axes, count),
        feed_rates=np.tile(path.feed_rates, count),
        uncut=_turned(path.uncut, count),
        reasons=path.reasons * count,
        trimmed=path.trimmed * count,
        blocked_by={what: number * count for what, number in path.blocked_by.items()},
        cones=cones,
        lifts=np.vstack([path.lifts + k * rows for k in range(count)]),
    )


def _turned(vectors: Float[ndarray, "n 3"], count: int) -> Float[ndarray, "m 3"]:
    """Vectors, then those turned by a pitch about Z, and so on."""
    angle = 2 * np.pi * np.arange(count)[:, None] / count
    x, y, z = vectors.T
    flat = x * np.cos(angle) - y * np.sin(angle), x * np.sin(angle) + y * np.cos(angle)
    return np.stack([*flat, np.broadcast_to(z, flat[0].shape)], axis=2).reshape(-1, 3)
