"""Proofs that the whole tool is free of collision with level, material, post and table.

Poses between two poses: tips on the straight line, axes on the great circle at even angles.

Closed meshes of the tool, of columns and of the table, for collision tests between meshes.

Proving tools free of collision by distances alone: spheres about points of the tool axis, one behind the
other (sphere tracing).

A sphere of radius d about the axis point at height u, d being the distance of that point to the nearest
obstacle, is empty. It holds the tool's disc of radius r at every height within sqrt(d^2 - r^2) of u; the next
sphere begins there. The first lies outside every obstacle (signed distance), so that a tool inside an
obstacle is seen too. Moves are proven with their poses: every pose on a move lies within half of the move
from one of its ends, so a margin that grows along the axis by half of what the neighbouring moves displace
the tool at that height proves them.

Exact collision of the tessellated tool with level, material, post and clamping, by FCL (python-fcl). The only
importer of fcl.

FCL reports surfaces that intersect, never containment; so points of the tool are tested for being inside the
obstacles, and a point of each obstacle for being inside the tool.

Collision checks of poses and moves: proven by distances where that decides, else by FCL at close poses.

What FCL would find of its tool, told by distances where those decide: fifty times as fast.

A section of the tool is a cylinder of radius r from `bottom` to `top`; of a cone, the cylinder that holds it is
proven free, and the one inside it collides. With d the distance from the axis point at height u to the nearest
obstacle:

    collision   the ball of radius min(r, u - bottom, top - u) about the point lies in the cylinder, and the
                obstacle comes nearer than that
    free        the sphere of radius d is empty; it holds the disc at every height within sqrt(d^2 - r^2) of u

In contrast to marching along one axis, a sphere may begin up to 4 radii above the height that is proven so far:
of a wide disc close above a level no sphere about its own middle holds the rim.

What stands round the tool on a level of a morph, taken as the levels have it: no more than the level before.

Solids as FCL measures their distances, and whether the bodies of a machine leave room for tool and part.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import compress
from typing import Any

import fcl
import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import angles_between, dots, lengths, numbered, rotations_of, unit
from bonecam.errors import MachineError
from bonecam.job import Job
from bonecam.levels.measure import Level, morph_surfaces
from bonecam.machine.bodies import BED, MachineBodies
from bonecam.machine.kinematics import link_poses
from bonecam.machine.machine import Machine
from bonecam.material.in_process_stock import DEVIATION
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.healing import winding_numbers
from bonecam.mesh.solids import revolve
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.contacts import flute_slack
from bonecam.planning.scene import TANGENT_SLACK, Scene, Surroundings
from bonecam.setup.capsule import enclosing_capsule
from bonecam.setup.stock import Stock
from bonecam.tool.cutter import Cutter, ToolSection
from bonecam.workholding.clamping import Clamping, body_meshes, clamping_of
from bonecam.workholding.post import Column, post_below

SMALL_ANGLE = 1e-9
"""Below this angle (radians) the great circle is taken as straight: sin x = x to rounding."""


def interpolate_poses(
    first: Float[ndarray, "m 3"],
    last: Float[ndarray, "m 3"],
    first_axes: Float[ndarray, "m 3"],
    last_axes: Float[ndarray, "m 3"],
    steps: int | Int[ndarray, " m"],
) -> tuple[Float[ndarray, "k 3"], Float[ndarray, "k 3"]]:
    """Points and axes of steps + 1 poses of each move, both ends included, one move behind the other.

    The axis at fraction f is (sin((1 - f) a) v0 + sin(f a) v1) / sin(a), a being the angle between the ends
    (spherical linear interpolation, Shoemake 1985).
    """
    counts = np.broadcast_to(np.asarray(steps) + 1, len(first))
    move, place = numbered(counts)
    f = (place / (counts[move] - 1))[:, None]

    angle = angles_between(first_axes, last_axes)[move][:, None]
    bent = angle >= SMALL_ANGLE
    sine = np.where(bent, np.sin(angle), 1.0)
    a = np.where(bent, np.sin((1 - f) * angle) / sine, 1 - f)
    b = np.where(bent, np.sin(f * angle) / sine, f)
    points = (1 - f) * first[move] + f * last[move]
    return points, unit(a * first_axes[move] + b * last_axes[move])


SIDES = 48
"""Sides of the polygons that stand for circles."""
CIRCUMSCRIBED = 1 / np.cos(np.pi / SIDES)
"""Radius of the corners of a polygon of SIDES that contains the circle of radius 1."""
BALL_RINGS = 8
"""Rings of vertices that stand for the half ball of the cutter."""
TABLE_HALF_WIDTH = 2000.0
"""Half of the width, depth and height of the table, mm."""


def sweep_margin(cutter: Cutter, section: ToolSection, margin: float) -> float:
    """How far (mm) a section moves where no point of the tool up to the gauge line moves further than
    `margin` (mm); a turn moves the spindle behind it further."""
    return margin * max(1.0, farthest(section) / reach_to_gauge_line(cutter))


def reach_to_gauge_line(cutter: Cutter) -> float:
    """The largest distance of a point of the tool below the spindle from the tip, mm."""
    return max(farthest(section) for section in cutter.profile if section.name != "spindle")


def farthest(section: ToolSection) -> float:
    """The largest distance of a point of the section from the tip, mm."""
    return float(np.hypot(section.end, section.widest))


def cutter_mesh(cutter: Cutter, slack: float) -> TriangleMesh:
    """The closed mesh of ball and flutes with the tip at the origin and the axis along +Z,
    thinner by `slack`, mm."""
    end = cutter.profile[0].end
    thin = cutter.radius - slack
    angle = np.linspace(0, np.pi / 2, BALL_RINGS + 1)[1:]
    radii = np.append(thin * np.sin(angle), thin)
    heights = np.append(cutter.radius - thin * np.cos(angle), end)
    return revolve(radii, heights, (slack, end), SIDES)


def section_mesh(section: ToolSection, margin: float = 0.0) -> TriangleMesh:
    """The closed mesh that holds a section with the tip at the origin and the axis along +Z, thicker by `margin`
    (mm)."""
    across = margin * np.hypot(1.0, section.taper)
    radii = np.array([section.radius, section.radius, section.end_radius, section.end_radius]) + across
    heights = np.array([section.start - margin, section.start, section.end, section.end + margin])
    if not section.taper:
        radii, heights = radii[[0, -1]], heights[[0, -1]]
    return revolve(radii * CIRCUMSCRIBED, heights, (heights[0], heights[-1]), SIDES)


def column_mesh(column: Column) -> TriangleMesh:
    """A prism about a column; an endless one ends far below the table."""
    bottom = max(column.bottom, -TABLE_HALF_WIDTH)
    radius = np.full(2, column.radius * CIRCUMSCRIBED)
    prism = revolve(radius, np.array([bottom, column.top]), (bottom, column.top), SIDES)
    return TriangleMesh(prism.vertices + np.array([column.x, column.y, 0.0]), prism.faces)


def table_mesh(top: float) -> TriangleMesh:
    """A block below z = `top`, mm."""
    w = TABLE_HALF_WIDTH
    return block_mesh(np.array([[-w, -w, -w], [w, w, top]]))


def block_mesh(bounds: Float[ndarray, "2 3"]) -> TriangleMesh:
    """A block between its lowest and highest corner, mm."""
    (x0, y0, z0), (x1, y1, z1) = bounds
    corners = np.array([[x, y, z] for z in (z0, z1) for x, y in ((x0, y0), (x1, y0), (x1, y1), (x0, y1))])
    quads = [(3, 2, 1, 0), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
    triangles = [triangle for a, b, c, d in quads for triangle in ((a, b, c), (a, c, d))]
    return TriangleMesh(corners, np.array(triangles, dtype=np.int32))


MAX_SPHERES = 40
"""Spheres along a section of the tool at most."""
MIN_STEP = 0.02
"""A sphere that advances by less (mm) proves nothing: the axis runs too close to an obstacle."""
NEAR_SLOPE = 0.25
"""Against the level the margin grows no faster than this with the height above the ball's centre: moves there
run along the surface."""
STEP_SHARE = 0.999
"""Part of the provable step that is taken, against rounding."""
WIDE = 0.7
"""A section wider than this share of its start's height over the tip is proven from above its start: a sphere as wide
about the start leaves a part that stands up beside the tip too little room."""
HIT_SHARE = 0.9
"""A distance below this part of the radius is a collision, well inside the section's ends."""

FREE = 0
UNDECIDED = 1
COLLIDING = 2
"""What is known of a pose: no collision, moves included; nothing; a collision."""


@dataclass(frozen=True, eq=False)
class Poses:
    """Tool positions with the margins that prove their moves.

    At height u above the tip the margin is shift + turn * u: `shift` (mm) and `turn` (radians) are half of
    the largest displacement and turn of the moves that begin or end at the pose.
    """

    tips: Float[ndarray, "n 3"]
    axes: Float[ndarray, "n 3"]
    shift: Float[ndarray, " n"]
    turn: Float[ndarray, " n"]

    @classmethod
    def at_rest(cls, tips: Float[ndarray, "n 3"], axes: Float[ndarray, "n 3"], margin: float = 0.0) -> "Poses":
        """Poses without moves, with an even margin (mm)."""
        return cls(tips, axes, np.full(len(tips), margin), np.zeros(len(tips)))

    @classmethod
    def in_motion(
        cls, tips: Float[ndarray, "n 3"], axes: Float[ndarray, "n 3"], joined: Bool[ndarray, " n"]
    ) -> "Poses":
        """Poses with the moves between them: `joined[i]` where the tool moves from pose i to i + 1."""
        i = np.flatnonzero(joined)
        shift = np.linalg.norm(tips[i + 1] - tips[i], axis=1) / 2
        turn = angles_between(axes[i + 1], axes[i]) / 2
        largest = np.zeros((2, len(tips)))
        for beside, values in zip(largest, (shift, turn), strict=True):
            np.maximum.at(beside, i, values)
            np.maximum.at(beside, i + 1, values)
        return cls(tips, axes, *largest)

    def take(self, which: Int[ndarray, " k"]) -> "Poses":
        """The poses of the given rows."""
        return Poses(self.tips[which], self.axes[which], self.shift[which], self.turn[which])


def classify_poses(
    scene: Scene, cutter: Cutter, poses: Poses, *, air: float | None = None, settled: int = COLLIDING
) -> Int[ndarray, " n"]:
    """FREE (proven, moves included), UNDECIDED or COLLIDING for every pose.

    While cutting (`air` None) the cutter is held against the level, less the scene's `tangent_slack`; else the whole
    tool keeps `air` mm from the material, which the rest of it always stays out of. A pose is left as soon as it is
    `settled`: UNDECIDED where only proofs count. The sections are tried from the spindle down: the wide ones
    decide soonest. A closed table is kept clear of by the lowest rims of the sections: on a straight move a rim sinks
    below its ends by no more than (u + r) turn^2, turn being half of the move's angle.
    """
    state = np.full(len(poses.tips), FREE)
    if scene.clamping.closed:
        lowest = np.full(len(poses.tips), np.inf)
        across = np.hypot(poses.axes[:, 0], poses.axes[:, 1])
        for section in cutter.profile:
            for u, radius in ((section.start, section.radius), (section.end, section.end_radius)):
                rim = poses.tips[:, 2] + u * poses.axes[:, 2] - radius * across
                lowest = np.minimum(lowest, rim - (u + radius) * poses.turn**2)
        state[~(lowest >= scene.clamping.clearance)] = COLLIDING
    for section in cutter.profile[::-1]:
        open_ = np.flatnonzero(state < settled)
        around = scene.around(section.name, cutter.radius, air)
        traced = _trace(around, poses.take(open_), section, cutter)
        state[open_] = np.maximum(state[open_], traced)
    return state


def _trace(around: Surroundings, poses: Poses, section: ToolSection, cutter: Cutter) -> Int[ndarray, " n"]:
    """The state of one section of the tool in its surroundings, spheres advancing on all axes at once; of the cutter
    the first is the ball that holds its end."""
    tangent = around.obstacle == "level"
    slack = around.scene.tangent_slack if tangent else 0.0
    taper = section.taper
    narrowest = min(section.radius, section.end_radius) - slack
    state = np.full(len(poses.tips), UNDECIDED)
    active = np.arange(len(poses.tips))
    u = np.full(len(active), section.start)
    if section.name != "cutter" and section.widest > WIDE * section.start:
        # How far up (mm) a section about as wide as it is far from the tip is proven by one sphere above its start:
        # about the start itself a sphere as wide as its disc would reach the tip, or the part beside it.
        ahead = min(section.start + section.widest, section.end)
        reach = np.hypot(section.end, section.widest)
        needed = section.widest + poses.shift + poses.turn * reach
        distance = around.distance_bound(poses.tips + ahead * poses.axes, np.hypot(needed, ahead - section.start))
        half = np.sqrt(np.maximum(distance**2 - needed**2, 0.0)) * np.sign(np.maximum(distance, 0.0))
        u = np.where((half > 0) & (ahead - half <= section.start), np.minimum(ahead + half, section.end), section.start)
        state[u >= section.end] = FREE
        active = np.flatnonzero(u < section.end)
        u = u[active]
    for sphere in range(MAX_SPHERES):
        if not len(active):
            break
        radius = section.radius + taper * (u - section.start)
        here = poses.take(active)
        # what the moves of each pose need at height u, and how fast it grows with u
        margin = here.shift + here.turn * np.hypot(u, radius)
        slope = here.turn
        if tangent:
            near = NEAR_SLOPE * (u - cutter.radius)
            slope = np.where(near < margin, NEAR_SLOPE, slope)
            margin = np.minimum(margin, near)
        needed = radius - slack + margin
        points = here.tips + u[:, None] * here.axes
        # every sphere but the first begins inside the empty one before
        distance = around.distance_bound(points, needed, outside=sphere > 0)
        # the height w at which a disc that grows by `slope` (shrinks, where negative) still fits into the sphere:
        # w^2 + (needed + slope w)^2 = distance^2; 0 where none does
        slope = slope * np.hypot(1.0, taper) + taper
        spare = np.maximum(distance**2 - needed**2, 0.0)
        root = np.sqrt((needed * slope) ** 2 + (1 + slope**2) * spare)
        step = STEP_SHARE * (root - needed * slope) / (1 + slope**2)
        u = u + step
        state[active[u >= section.end]] = FREE
        from_ends = np.minimum(u - step - section.start, section.end - u + step)
        surely_inside = np.maximum(np.minimum(HIT_SHARE * narrowest, from_ends), 0.0)
        state[active[distance < surely_inside]] = COLLIDING
        going = (u < section.end) & (step > MIN_STEP) & (distance > needed)
        active, u = active[going], u[going]
    return state


FclObject = Any
"""An fcl.CollisionObject: fcl has no types."""


@dataclass(frozen=True, eq=False)
class FclSection:
    """A section of the tool as an FCL object whose origin is at height `at` (mm) above the tip, and those that it must
    stay out of."""

    section: ToolSection
    tool: FclObject
    at: float
    around: Surroundings
    obstacles: tuple[FclObject, ...]


@dataclass(frozen=True, eq=False)
class FclModel:
    """One cutter in one scene while it cuts, as FCL objects."""

    clamping: Clamping
    sections: tuple[FclSection, ...]

    def colliding_sections(
        self, tips: Float[ndarray, "n 3"], axes: Float[ndarray, "n 3"], asked: Bool[ndarray, "n k"] | None = None
    ) -> list[str]:
        """The name of a section of the tool that collides in each pose, or an empty string; of the k sections only
        those are tested that are `asked` for, if it is told."""
        if asked is None:
            asked = np.ones((len(tips), len(self.sections)), dtype=bool)
        names = np.full(len(tips), "", dtype=object)
        for k, (turn, tip) in enumerate(zip(rotations_of(axes), tips, strict=True)):
            for item in compress(self.sections, asked[k]):
                place = tip + item.at * turn[:, 2]
                if any(crosses(item.tool, turn, place, other) for other in item.obstacles):
                    names[k] = item.section.name
                    break

        # else the first that lies wholly inside an obstacle, or contains one
        open_ = np.flatnonzero(names == "")
        for k, item in reversed(list(enumerate(self.sections))):
            here = open_[asked[open_, k]]
            # Whether a section lies wholly inside an obstacle in each pose, or contains one.
            places = tips[here]
            directions = axes[here]
            section, around = item.section, item.around
            middles = places + (section.start + section.end) / 2 * directions
            caught = around.mesh_distance.signed(middles) < 0
            if self.clamping.closed:
                caught |= middles[:, 2] < self.clamping.clearance
            points = [around.mesh.vertices[0]]
            for column in around.columns:
                caught |= column.distance(middles) < 0
                points.append(np.array([column.x, column.y, column.top]))

            for point in points:
                heights = dots(point - places, directions)
                away = lengths(point - places - heights[:, None] * directions)
                radius = section.radius + section.taper * (heights - section.start)
                within = (section.start < heights) & (heights < section.end)
                caught |= within & (away < radius - around.scene.tangent_slack)
            names[here[caught]] = item.section.name
        return names.tolist()


@lru_cache(maxsize=2)
def build_fcl_model(scene: Scene, cutter: Cutter, margin: float = 0.0) -> FclModel:
    """The FCL objects of a cutter in a scene; above the cutter the tool is thicker by `sweep_margin`s of `margin`
    (mm). Those made last, of one with and of one without a margin, are kept: the rest paths of a level have one scene,
    of which they take .1 to .3 s each. FCL answers for a cylinder twice as fast as for a mesh of one."""
    meshes = {"level": obstacle_object(scene.level), "material": obstacle_object(scene.material)}
    table = (fcl_object(table_mesh(scene.clamping.clearance)),) if scene.clamping.closed else ()
    columns: dict[Column, FclObject] = {}
    sections = []
    for section in cutter.profile:
        around = scene.around(section.name, cutter.radius)
        by = sweep_margin(cutter, section, margin) + scene.material_deviation
        at = 0.0
        if section.name == "cutter":
            tool = fcl_object(cutter_mesh(cutter, scene.tangent_slack))
        elif section.taper:
            tool = fcl_object(section_mesh(section, by))
        else:
            cylinder = fcl.Cylinder(section.radius + by, section.end - section.start + 2 * by)
            tool = fcl.CollisionObject(cylinder, fcl.Transform())
            at = (section.start + section.end) / 2
        for column in around.columns:
            columns.setdefault(column, fcl_object(column_mesh(column)))
        standing = [columns[column] for column in around.columns]
        obstacles = (meshes[around.obstacle], *standing, *table)
        sections.append(FclSection(section, tool, at, around, obstacles))
    return FclModel(scene.clamping, tuple(sections))


def fcl_object(mesh: TriangleMesh) -> FclObject:
    """The mesh as a collision object."""
    return solid_object(np.array(mesh.vertices), np.array(mesh.faces))


@lru_cache(maxsize=4)
def obstacle_object(mesh: TriangleMesh) -> FclObject:
    """The mesh as an object that stays where it is: cones and poses are asked for in one scene, whose meshes take .04 s
    each."""
    return fcl_object(mesh)


def solid_object(vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"]) -> FclObject:
    """Vertices and faces as a collision object."""
    model = fcl.BVHModel()
    model.beginModel(len(vertices), len(faces))
    model.addSubModel(vertices, faces)
    model.endModel()
    return fcl.CollisionObject(model, fcl.Transform())


def crosses(solid: FclObject, turned: Float[ndarray, "3 3"], at: Float[ndarray, "3"], other: FclObject) -> bool:
    """Whether the surface of an object, turned and moved there, crosses that of another."""
    solid.setTransform(fcl.Transform(turned, at))
    request = fcl.CollisionRequest(num_max_contacts=1, enable_contact=False)
    return bool(fcl.collide(solid, other, request, fcl.CollisionResult()))


LOOK_AHEAD = (4.0, 2.0, 1.0, 0.5, 0.25, 0.0)
"""How far above the proven height spheres are tried, in radii of the section; a far one proves most."""
ROUNDS = 12
"""Times that the proven height is raised at most; then the section is undecided."""
MIN_RISE = 0.02
"""A round that raises the proven height by less (mm) proves nothing more."""
SURE_SHARE = 0.99
"""Part of a radius or a sphere that counts, against rounding and for polygons inside a circle."""


@dataclass(frozen=True)
class ThickSection:
    """A section from `bottom` to `top` (mm from the tip) between an `inner` and an `outer` cylinder (radii, mm)
    about the tool axis, and what it must stay out of."""

    bottom: float
    top: float
    inner: float
    outer: float
    around: Surroundings


def classify_thick_tool(
    scene: Scene,
    cutter: Cutter,
    margin: float,
    tips: Float[ndarray, "n 3"],
    axes: Float[ndarray, "n 3"],
    *,
    air: float | None = None,
) -> Int[ndarray, "n k"]:
    """FREE, UNDECIDED or COLLIDING for each section of the cutter's profile in each pose above the table; UNDECIDED too
    where one above it collides.

    The tool above the cutter is thicker by `sweep_margin`s of `margin` (mm), the cutter is thinner by
    the scene's `tangent_slack`; `air` as in `classify_poses`.
    """
    sections: list[ThickSection] = []
    for section in cutter.profile:
        around = scene.around(section.name, cutter.radius, air)
        # the prisms that stand for columns
        columns = [replace(column, radius=column.radius * CIRCUMSCRIBED) for column in around.columns]
        around = replace(around, columns=tuple(columns))
        by = sweep_margin(cutter, section, margin)
        inner = min(section.radius, section.end_radius) + by
        outer = section.widest + by * float(np.hypot(1.0, section.taper))
        if not sections:
            by = 0.0
            inner = outer = cutter.radius - scene.tangent_slack
        sections.append(ThickSection(section.start - by, section.end + by, inner, outer, around))
    states = np.full((len(tips), len(sections)), UNDECIDED)
    for k in reversed(range(len(sections))):
        open_ = np.flatnonzero((states != COLLIDING).all(axis=1))
        states[open_, k] = _classify_section(tips[open_], axes[open_], sections[k])

    # Whether the ball, thinner by the scene's `tangent_slack`, is free
    radius = cutter.radius
    centres = cutter.centres_of(tips, axes)
    distance = sections[0].around.distance_bound(centres, np.full(len(centres), radius))
    above = centres[:, 2] > radius + scene.clamping.clearance
    ball_free = (distance > radius - scene.tangent_slack) & (above | (not scene.clamping.closed))
    states[:, 0] = np.where(ball_free, states[:, 0], np.maximum(states[:, 0], UNDECIDED))
    return states


def _classify_section(
    tips: Float[ndarray, "n 3"], axes: Float[ndarray, "n 3"], section: ThickSection
) -> Int[ndarray, " n"]:
    """The state of one section of each tool."""
    state = np.full(len(tips), UNDECIDED)
    proven = np.full(len(tips), section.bottom)
    going = np.arange(len(tips))
    for _ in range(ROUNDS):
        if not len(going):
            break
        # raised by the first sphere that begins below the proven height, unless one before tells a collision
        low = proven[going]
        raised = low.copy()
        hit = np.zeros(len(going), dtype=bool)
        for ahead in LOOK_AHEAD:
            open_ = np.flatnonzero(~hit & (raised <= low + MIN_RISE))
            if not len(open_):
                break
            here = going[open_]
            u = np.minimum(low[open_] + ahead * section.outer, section.top)
            # How far above and below height `u` (mm) discs of the section lie in the empty sphere about the axis point
            # there (-1 where none does), and whether an obstacle enters the section near it; distances are asked as
            # far as a sphere that holds all discs above `low` reaches.
            outer = section.outer * CIRCUMSCRIBED
            wanted = np.hypot(outer, np.maximum(u - low[open_], section.top - u)) / SURE_SHARE
            distance = section.around.distance_bound(tips[here] + u[:, None] * axes[here], wanted)
            room = np.minimum(section.inner, np.minimum(u - section.bottom, section.top - u))
            collides = distance + section.around.deviation < SURE_SHARE * room
            spare = (SURE_SHARE * distance) ** 2 - outer**2
            half, hit[open_] = np.where((distance > 0) & (spare > 0), np.sqrt(np.maximum(spare, 0.0)), -1.0), collides
            reached = u - half <= low[open_]
            raised[open_] = np.where(reached, np.maximum(raised[open_], u + half), raised[open_])
        state[going[hit]] = COLLIDING
        state[going[~hit & (raised >= section.top)]] = FREE
        rising = ~hit & (raised < section.top) & (raised > low + MIN_RISE)
        proven[going] = raised
        going = going[rising]
    return state


REST_MARGIN = 0.1
"""Margin (mm) of poses checked at rest, for the moves that will begin and end there."""
MIN_STEPS = 3
"""Steps that a move checked by FCL is divided into at least."""
SWEEP_MARGIN = 0.2
"""Shank and holder are thicker by this much (mm) while moves are checked by FCL; none of their points moves
further between two poses. The spindle, which moves further, is thicker accordingly."""
STRIDES = (16, 4, 1)
"""FCL is asked for every so many poses of a move first: most moves that collide do so at many of them."""


@dataclass(frozen=True, eq=False)
class CollisionChecker:
    """Checks of one cutter in one scene; the FCL objects are built when first needed.

    Between passes the tool keeps `air` mm from the material.
    """

    scene: Scene
    cutter: Cutter
    air: float = 0.0

    @cached_property
    def fcl(self) -> FclModel:
        """The FCL objects that poses on moves are checked with."""
        return build_fcl_model(self.scene, self.cutter, SWEEP_MARGIN)

    def free_by_distance(self, centres: Float[ndarray, "n 3"], axes: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
        """Whether poses at rest with these ball centres are proven free by distances alone."""
        return self._classify_at_rest(centres, axes, UNDECIDED) == FREE

    def free(self, centres: Float[ndarray, "n 3"], axes: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
        """Whether poses at rest with these ball centres are free, by distances or, where those do not decide
        (in hollows hardly wider than the ball), by FCL."""
        tips = self.cutter.tips_of(centres, axes)
        state = self._classify_at_rest(centres, axes, COLLIDING)
        return self._decided(state, tips, axes, np.arange(len(tips)), cutting=True)

    def free_in_air(
        self, centres: Float[ndarray, "n 3"], axes: Float[ndarray, "n 3"], margin: float
    ) -> Bool[ndarray, " n"]:
        """Whether the tool is proven to keep `air` + `margin` (mm) from the material in poses with these ball
        centres."""
        poses = Poses.at_rest(self.cutter.tips_of(centres, axes), axes, margin)
        return classify_poses(self.scene, self.cutter, poses, air=self.air, settled=UNDECIDED) == FREE

    def free_in_motion(
        self,
        tips: Float[ndarray, "n 3"],
        axes: Float[ndarray, "n 3"],
        joined: Bool[ndarray, " n"],
        known_free: Bool[ndarray, " n"],
    ) -> Bool[ndarray, " n"]:
        """Whether each pose and its halves of the moves to its neighbours are `known_free` or proven free by
        distances; `joined` as in `moves_free`."""
        free = known_free.copy()
        asked = np.flatnonzero(~known_free)
        poses = Poses.in_motion(tips, axes, joined).take(asked)
        free[asked] = classify_poses(self.scene, self.cutter, poses, settled=UNDECIDED) == FREE
        return free

    def moves_free(
        self,
        tips: Float[ndarray, "n 3"],
        axes: Float[ndarray, "n 3"],
        joined: Bool[ndarray, " n"],
        known_free: Bool[ndarray, " n"] | None = None,
        *,
        cutting: bool = True,
    ) -> Bool[ndarray, " n"]:
        """Whether the move from pose i to i + 1 is free, where `joined[i]`; False elsewhere. Poses that are
        `known_free` were found free in motion before.

        `cutting`: the cutter may touch the level; else the whole tool keeps `air` mm from the material.
        """
        state = np.full(len(tips), FREE)
        asked = np.arange(len(tips)) if known_free is None else np.flatnonzero(~known_free)
        poses = Poses.in_motion(tips, axes, joined).take(asked)
        state[asked] = classify_poses(self.scene, self.cutter, poses, air=self._air(cutting), settled=UNDECIDED)
        free = joined & (state == FREE) & (np.r_[state[1:], COLLIDING] == FREE)
        doubtful = np.flatnonzero(joined & ~free)
        if len(doubtful):
            # Whether moves are free in steps: proven by distances, or by FCL at the poses that those leave undecided.
            turn = angles_between(axes[doubtful], axes[doubtful + 1])
            shift = np.linalg.norm(tips[doubtful + 1] - tips[doubtful], axis=1)
            displacement = shift + turn * reach_to_gauge_line(self.cutter)
            steps = np.maximum(MIN_STEPS, np.ceil(displacement / SWEEP_MARGIN)).astype(int)
            sampled_tips, turned = interpolate_poses(
                tips[doubtful], tips[doubtful + 1], axes[doubtful], axes[doubtful + 1], steps
            )

            starts = np.r_[0, np.cumsum(steps + 1)]
            along = np.ones(len(sampled_tips), dtype=bool)
            along[starts[1:] - 1] = False
            between = Poses.in_motion(sampled_tips, turned, along)
            decided = classify_poses(self.scene, self.cutter, between, air=self._air(cutting), settled=UNDECIDED)
            free[doubtful] = self._decided(decided, sampled_tips, turned, starts[:-1], cutting=cutting)
        return free

    def _classify_at_rest(
        self, centres: Float[ndarray, "n 3"], axes: Float[ndarray, "n 3"], settled: int
    ) -> Int[ndarray, " n"]:
        """State of poses with REST_MARGIN; `settled` as in `classify_poses`."""
        poses = Poses.at_rest(self.cutter.tips_of(centres, axes), axes, REST_MARGIN)
        return classify_poses(self.scene, self.cutter, poses, settled=settled)

    def _air(self, cutting: bool) -> float | None:
        return None if cutting else self.air

    def _decided(
        self,
        state: Int[ndarray, " n"],
        tips: Float[ndarray, "n 3"],
        axes: Float[ndarray, "n 3"],
        starts: Int[ndarray, " m"],
        *,
        cutting: bool,
    ) -> Bool[ndarray, " m"]:
        """Whether all poses of each move are free, those that are UNDECIDED with the tool thicker by SWEEP_MARGIN: by
        distances, or else by FCL, which knows no clearance between passes and is asked for the undecided sections of
        the tool only. `starts` are the moves' first poses; none is asked for once one of its move collides."""
        state = state.copy()
        counts = np.diff(np.r_[starts, len(state)])
        move, place = numbered(counts)

        def undecided() -> Int[ndarray, " u"]:
            worst = np.maximum.reduceat(state, starts) if len(starts) else state
            return np.flatnonzero((state == UNDECIDED) & (worst[move] == UNDECIDED))

        asked = undecided()
        margin = SWEEP_MARGIN + self.scene.material_deviation
        sections = np.full((len(state), len(self.cutter.profile)), UNDECIDED)
        sections[asked] = classify_thick_tool(
            self.scene, self.cutter, margin, tips[asked], axes[asked], air=self._air(cutting)
        )
        state[asked] = sections[asked].max(axis=1)
        for stride in STRIDES if cutting else ():
            asked = undecided()
            asked = asked[place[asked] % stride == 0]
            if not len(asked):
                continue
            names = self.fcl.colliding_sections(tips[asked], axes[asked], sections[asked] == UNDECIDED)
            state[asked] = [COLLIDING if name else FREE for name in names]
        return np.bincount(move, state != FREE, len(starts)) == 0


CHORD = 0.002
"""Chord tolerance of the level that the ball touches, mm."""


def level_scene(levels: Sequence[Level], index: int, stock: Stock, job: Job, bodies: MachineBodies) -> Scene:
    """The scene in which level `index` is cut; material stands as high as the level before, scallops and what it left
    uncut are not in it. ValueError where no path follows that level."""
    surfaces = morph_surfaces(levels)
    if not 0 <= index < len(surfaces):
        raise ValueError(f"level {index}: give 0 to {len(surfaces) - 1}")
    part = MeshDistance(surfaces[0].tessellate(CHORD))
    level = part if not index else MeshDistance(surfaces[index].tessellate(CHORD))
    return Scene(
        level=level.mesh,
        material=levels[index + 1].mesh,
        stock=enclosing_capsule(stock),
        post=post_below(part.mesh, job.holding),
        material_deviation=DEVIATION,
        known_level_distance=level,
        part_distance=part if index else None,
        clamping=clamping_of(job.holding, bodies.table),
        tangent_slack=TANGENT_SLACK if index else flute_slack(job.path.gouge_tolerance),
    )


PIN = 2.0
"""Radius (mm) of the thinnest tool and part that bodies of a machine must leave room for."""
PIN_FROM, PIN_TO = 1.0, 50.0
"""Their ends, mm: in front of the spindle nose, and over the program's zero."""


@dataclass(frozen=True, eq=False)
class Solid:
    """A closed mesh, mm, that is called by its `name`."""

    name: str
    mesh: TriangleMesh

    @cached_property
    def fcl(self) -> FclObject:
        """The mesh as a collision object."""
        return fcl_object(self.mesh)

    @cached_property
    def corners(self) -> Float[ndarray, "8 3"]:
        """The corners of its bounding box, mm."""
        return block_mesh(self.mesh.bounds).vertices

    def distance(self, turned: Float[ndarray, "3 3"], at: Float[ndarray, "3"], other: "Solid") -> float:
        """The distance (mm) of this solid, turned and moved there, from another; 0 where one meets or holds the
        other."""
        self.fcl.setTransform(fcl.Transform(turned, at))
        distance = max(float(fcl.distance(self.fcl, other.fcl, fcl.DistanceRequest(), fcl.DistanceResult())), 0.0)
        own, its = self.mesh.vertices[:1] @ turned.T + at, (other.mesh.vertices[:1] - at) @ turned
        return 0.0 if other._holds(own) or self._holds(its) else distance

    def _holds(self, point: Float[ndarray, "1 3"]) -> bool:
        """Whether a point lies inside; pieces of the mesh may overlap."""
        low, high = self.mesh.bounds
        within = bool(((point >= low) & (point <= high)).all())
        return within and bool(abs(winding_numbers(self.mesh, point)[0]) > 0.5)


def link_solids(machine: Machine) -> dict[str, list[Solid]]:
    """The bodies of a machine by their links; MachineError as in `body_meshes`."""
    solids: dict[str, list[Solid]] = {}
    for body, mesh in body_meshes(machine).items():
        solids.setdefault(body.link, []).append(Solid(body.name, mesh))
    return solids


def body_texts(machine: Machine) -> list[str]:
    """What moves with what, and where, all axes at zero, a line a body; MachineError as in `check_bodies`."""
    check_bodies(machine)
    texts = []
    for link, solids in link_solids(machine).items():
        for solid in solids:
            low, high = solid.mesh.bounds.round(1).tolist()
            room = ", ".join(f"{letter} {a:g} to {b:g}" for letter, a, b in zip("XYZ", low, high, strict=True))
            from_where = " from the spindle nose" if link in carried_links(machine) else ""
            carrier = "stands still" if link == BED else f"moves with {link}"
            texts.append(f"{solid.name}: {carrier}, {room} mm{from_where}, all axes at zero")
    return texts


def carried_links(machine: Machine) -> list[str]:
    """The links on the tool's side, from the linear axes to what the spindle is in."""
    return ["XYZ", *(axis.letter for axis in machine.tool_axes if axis.letter)]


def check_bodies(machine: Machine) -> None:
    """MachineError as in `body_meshes`, and where with all axes at zero a body is in the place of the tool in front of
    the spindle nose, or of the part over the program's zero."""
    heights, radius = np.array([PIN_FROM, PIN_TO]), np.full(2, PIN)
    part = Solid("the part over the program's zero", revolve(radius, heights, (PIN_FROM, PIN_TO), SIDES))
    tool = Solid("the tool in front of the spindle nose", revolve(radius, -heights[::-1], (-PIN_TO, -PIN_FROM), SIDES))
    for link, solids in link_solids(machine).items():
        turned, at = link_poses(machine, link, np.zeros((1, 5)))
        for solid in solids:
            if link in carried_links(machine):
                met, distance = tool, solid.distance(np.eye(3), np.zeros(3), tool)
            else:
                met, distance = part, solid.distance(turned[0], at[0], part)
            if distance == 0:
                remedy = f"correct its place in the STL (all axes at zero, mm), its units, or link = {link!r}"
                raise MachineError(
                    f"{machine.name}: the body {solid.name!r} overlaps {met.name}: {remedy}", body=solid.name
                )
