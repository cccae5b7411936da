"""The contacts of a level of a channel whose ball comes as near to the blades as it may.

Lines of a pattern end wherever a blade begins, so that what they leave beside it is up to a side step thick. These
lines follow the blades, and run round their edges where passes go on beyond them.

The tool paths of the channel between two blades of a wheel, from the blank down to the hub.

The levels are an open morph from the hub to the blank. The ball follows each level as far as the blades beside it let
it, which keep an allowance for their own cut. All channels are cut to one level before any is cut to the next, so that
what stands is, everywhere, no higher than the level before, which is what shank and holder keep off.

The path of one blade or channel of a wheel, repeated at every pitch about the Z axis.

The tool path of one surface, closed or open, beside solids that must not be gouged: one level, one cutter.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import lengths
from bonecam.job import Job, PathJob, field_error
from bonecam.levels.measure import NO_CUT, Level, MachinedLevel, PartLevel, machined_levels
from bonecam.machine.bodies import MachineBodies
from bonecam.machine.limits import MachineLimits
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.meshlab import split_edges
from bonecam.mesh.solids import solid_union
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.axes.cones import admissible_cones
from bonecam.planning.axes.field import HASTES, AxisField, FieldDomain, contact_facets, smooth_axes, soonest
from bonecam.planning.axes.lead import check_lead
from bonecam.planning.axes.tool_axes import WantedAxes, added_axes
from bonecam.planning.collision import CollisionChecker
from bonecam.planning.contacts import candidate_contacts, contact_path, flute_slack
from bonecam.planning.estimate import cutter_of
from bonecam.planning.layers import HeightMesh
from bonecam.planning.oriented_path import orient
from bonecam.planning.patterns import CLOSED_PATTERNS, LineContacts, feeds_along
from bonecam.planning.post_length import GOUGE, SampledContacts, least_lifts, shortest_post
from bonecam.planning.scene import Scene
from bonecam.planning.spacing import ROUND, contact_frames
from bonecam.setup.capsule import Capsule, smallest_capsule
from bonecam.setup.placement import TALL
from bonecam.surface.blades import Channel, revolved
from bonecam.surface.tspline import TSpline
from bonecam.tool.cutter import Cutter
from bonecam.tool.elliptic_cones import EllipticCones
from bonecam.tool.path import ContactPath, ToolPath
from bonecam.workholding.clamping import Clamping, clamping_of
from bonecam.workholding.post import Post

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
    contours = contour_lines(s, t, np.minimum(field + RESTS, CELL).reshape(len(s), len(t)), 0.0)
    lines = []
    for contour in contours:
        way = np.r_[0.0, np.cumsum(lengths(np.diff(surface.positions(*contour.T), axis=0)))]
        if way[-1] >= SHORTEST:
            places = np.linspace(0.0, way[-1], int(way[-1] / STEP) + 2)
            parameters = np.column_stack([np.interp(places, way, contour[:, k]) for k in range(2)])
            points, normals, _ = contact_frames(surface, parameters, ROUND)
            feeds = feeds_along(np.gradient(points, axis=0), normals)
            lines.append(LineContacts(parameters, points, normals, feeds))
    return lines


def contour_lines(
    a: Float[ndarray, " p"], b: Float[ndarray, " q"], field: Float[ndarray, "p q"], value: float
) -> list[Float[ndarray, "_ 2"]]:
    """The lines (a, b) on which a field over a grid has a value."""
    from contourpy import contour_generator

    return [line[:, ::-1] for line in contour_generator(b, a, field).lines(value)]


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
            left = self._left(level)
            paths.append(self._path(level, left, above))
            above = left
        return paths, above.material

    def _left(self, level: MachinedLevel) -> "_Body":
        """What is left where all channels are cut to a level: the blades with their allowance, and what lies under
        the level."""
        if not level.index:
            return _Body(self._finished, self._blade_chord + wall_cusp(self.job))
        profile, above = self.channel.under(level.surface)
        under = revolved(profile, CHORD, self.channel.wheel.count)
        return _Body(solid_union([under, self._finished]), above + CHORD + wall_cusp(self.job))

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


SAMPLED = 40
"""Places along s and along t from which the length of the post is found."""
ALLOWANCE = 0.5
"""The capsule that links keep out of is so much larger than the solids, mm."""


@dataclass(frozen=True, eq=False)
class Workpiece:
    """A surface to machine and the `solid` of everything that must not be gouged, on a post of this `length`, mm; the
    table is z = 0."""

    surface: TSpline
    solid: TriangleMesh
    length: float

    def stand(self, length: float) -> "Workpiece":
        """The workpiece on a post of another length."""
        shift = np.array([0.0, 0.0, length - self.solid.bounds[0, 2]])
        pose = np.eye(4)
        pose[:3, 3] = shift
        points = self.surface.control_points + shift
        return Workpiece(self.surface.with_control_points(points), self.solid.move(pose), length)

    def scene(self, job: Job, clamping: Clamping) -> Scene:
        """The obstacles: all of the solid, with the last cut's depth of material on it, and the post."""
        capsule = smallest_capsule(self.solid.vertices, ALLOWANCE)
        post = Post(job.holding.diameter / 2, self.length)
        depth = job.levels.finishing_depth
        return Scene(
            level=self.solid,
            material=self.solid,
            stock=capsule,
            post=post,
            material_deviation=depth,
            known_level_distance=MeshDistance(self.solid),
            clamping=clamping,
            tangent_slack=flute_slack(job.path.gouge_tolerance),
        )


def stand_workpiece(surface: TSpline, solid: TriangleMesh, job: Job, limits: MachineLimits) -> Workpiece:
    """The workpiece on its post; one of length 0 in the job is the shortest with which all that the tool can reach is
    reached. OrientationError where that is too long, JobError where the job wants to be parted from it."""
    if job.holding.parting:
        raise field_error("holding", "parting", True, "a surface that is finished alone is not parted: leave it out")
    given = Workpiece(surface, solid, 0.0)
    if job.holding.length:
        return given.stand(job.holding.length)
    tall = given.stand(TALL)
    cutter = finishing_cutter(job, limits.bodies)
    s, t = (np.linspace(low, high, SAMPLED) for low, high in tall.surface.domain)
    parameters = np.stack(np.meshgrid(s, t, indexing="ij"), axis=2).reshape(-1, 2)
    normals = tall.surface.normals(parameters[:, 0], parameters[:, 1])
    centres = tall.surface.positions(parameters[:, 0], parameters[:, 1]) + cutter.radius * normals
    scene = tall.scene(job, Clamping((), closed=False, clearance=job.holding.clearance))
    fits = scene.level_distance.signed(centres, cutter.radius) >= cutter.radius - GOUGE
    contacts = SampledContacts(CollisionChecker(scene, cutter), centres[fits], normals[fits])
    clamping = clamping_of(job.holding, limits.bodies.table)
    return given.stand(shortest_post(least_lifts(contacts, clamping, job, limits), TALL, clamping))


def finishing_cutter(job: Job, bodies: MachineBodies) -> Cutter:
    """The finishing cutter of the job; JobError where it cannot lean by the lead angle."""
    cutter = Cutter.from_job(2, "finishing", job.tool("finishing"), bodies.nose)
    check_lead(cutter, job.path.lead_deg)
    return cutter


def surface_contacts(workpiece: Workpiece, scene: Scene, job: Job, cutter: Cutter) -> ContactPath:
    """The contacts of the surface that the ball fits on, ToolPathError where there are none; JobError where the
    pattern is one for closed surfaces with poles, and this is none."""
    pattern = job.path.pattern
    if pattern in CLOSED_PATTERNS and not all(workpiece.surface.poles):
        bound = "this surface has edges: give along, round or fastest"
        raise field_error("path", "pattern", pattern, bound)
    level = PartLevel(workpiece.surface, workpiece.solid, NO_CUT)
    return contact_path(candidate_contacts(level, [scene.level_distance], cutter, scene.post, job.path))


def plan_surface(
    workpiece: Workpiece,
    job: Job,
    limits: MachineLimits,
    stock: Capsule | None = None,
    material: HeightMesh | None = None,
) -> ToolPath:
    """The path of the finishing cutter over the surface; `limits` are the machine's, `stock` is what links keep out of
    (None: a capsule round the solid), `material` what stands before, if that is known.

    JobError, ToolPathError or OrientationError where there is none.
    """
    cutter = finishing_cutter(job, limits.bodies)
    scene = workpiece.scene(job, clamping_of(job.holding, limits.bodies.table))
    scene = scene if stock is None else replace(scene, stock=stock)
    if material is not None:
        scene = replace(scene, material=material.mesh, material_deviation=material.deviation)
    contacts = surface_contacts(workpiece, scene, job, cutter)
    fixed = added_axes(contacts, workpiece.surface, scene, limits, job.path)
    return orient(
        contacts,
        scene,
        limits=limits,
        job=job.path,
        nc=job.nc,
        wanted=wanted_axes(workpiece, contacts, scene, limits, job.path),
        material=material,
        fixed=fixed,
        explained=fixed is None,
    )


def wanted_axes(
    workpiece: Workpiece, contacts: ContactPath, scene: Scene, limits: MachineLimits, job: PathJob
) -> WantedAxes | None:
    """The smooth axes of the contacts; None where the job wants them to lean by the lead angle.

    Round a closed surface they either turn with the normals or swing about one direction and back, and the better ones
    may be smoother than the feed asks: those are taken that cost the fewest minutes for each contact certified free,
    and of these the smoothest.
    """
    if job.orientation != "cones":
        return None
    cones = admissible_cones(contacts, scene, limits, job)
    domain = FieldDomain.of(workpiece.surface)
    starts: list[AxisField | None] = [None]
    if domain.closed:
        # a constant field of winding 0: the direction that is free at most contacts
        contacts_of_node = np.bincount(cones.free.net.node_of, minlength=len(cones.shapes))
        direction = cones.free.directions[(contacts_of_node @ cones.free.free).argmax()]
        starts.append(AxisField.constant(domain, direction))
    facets = contact_facets(contacts, workpiece.surface)
    make = partial(smooth_axes, cones, domain, limits, job, facets=facets)
    best = soonest([make(start=start) for start in starts], limits)
    candidates = [best]
    # unless their energy is asked for: the weights of cells would leave more contacts outside their cones
    asked = facets if job.membrane or job.thin_plate else None
    for haste in HASTES:
        candidates.append(make(start=candidates[-1].field, haste=haste, facets=asked))
    best = soonest(candidates, limits)
    return (best if job.certify == "distances" else best.verified(scene)).wanted
