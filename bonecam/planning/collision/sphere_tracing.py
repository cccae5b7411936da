"""Proving tools free of collision by distances alone: spheres about points of the tool axis, one behind the
other (sphere tracing).

A sphere of radius d about the axis point at height u, d being the distance of that point to the nearest
obstacle, is empty. It holds the tool's disc of radius r at every height within sqrt(d^2 - r^2) of u; the next
sphere begins there. The first lies outside every obstacle (signed distance), so that a tool inside an
obstacle is seen too. Moves are proven with their poses: every pose on a move lies within half of the move
from one of its ends, so a margin that grows along the axis by half of what the neighbouring moves displace
the tool at that height proves them.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import angles_between
from bonecam.planning.collision.scene import Scene, Surroundings
from bonecam.tool.cutter import Cutter, ToolSection
from bonecam.workholding.clamping import Clamping

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
SURE_SHARE = 0.9
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
        return cls(tips, axes, _largest_beside(i, shift, len(tips)), _largest_beside(i, turn, len(tips)))

    def take(self, which: Int[ndarray, " k"]) -> "Poses":
        """The poses of the given rows."""
        return Poses(self.tips[which], self.axes[which], self.shift[which], self.turn[which])


def _largest_beside(moves: Int[ndarray, " m"], values: Float[ndarray, " m"], count: int) -> Float[ndarray, " n"]:
    """The largest value of the moves that begin or end at each pose (0 without any); move i begins at pose
    `moves[i]` and ends at the next."""
    largest = np.zeros(count)
    np.maximum.at(largest, moves, values)
    np.maximum.at(largest, moves + 1, values)
    return largest


def classify_poses(
    scene: Scene, cutter: Cutter, poses: Poses, *, air: float | None = None, settled: int = COLLIDING
) -> Int[ndarray, " n"]:
    """FREE (proven, moves included), UNDECIDED or COLLIDING for every pose.

    While cutting (`air` None) the cutter is held against the level, less the scene's `tangent_slack`; else the whole
    tool keeps `air` mm from the material, which the rest of it always stays out of. A pose is left as soon as it is
    `settled`: UNDECIDED where only proofs count. The sections are tried from the spindle down: the wide ones
    decide soonest.
    """
    state = _table_state(scene.clamping, cutter, poses)
    for section in cutter.profile[::-1]:
        open_ = np.flatnonzero(state < settled)
        around = scene.around(section.name, cutter.envelope_radius, air)
        traced = _trace(around, poses.take(open_), section, cutter)
        state[open_] = np.maximum(state[open_], traced)
    return state


def _table_state(clamping: Clamping, cutter: Cutter, poses: Poses) -> Int[ndarray, " n"]:
    """FREE where the table is open, or the lowest rims of the tool's sections keep the clearance above it; else
    COLLIDING.

    On a straight move a rim sinks below its ends by no more than (u + r) turn^2, turn being half of the
    move's angle.
    """
    lowest = np.full(len(poses.tips), np.inf)
    if not clamping.closed:
        return np.full(len(lowest), FREE)
    across = np.hypot(poses.axes[:, 0], poses.axes[:, 1])
    for section in cutter.profile:
        for u, radius in ((section.start, section.radius), (section.end, section.end_radius)):
            rim = poses.tips[:, 2] + u * poses.axes[:, 2] - radius * across
            lowest = np.minimum(lowest, rim - (u + radius) * poses.turn**2)
    return np.where(lowest >= clamping.clearance, FREE, COLLIDING)


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
        u = _first_heights(around, poses, section)
        state[u >= section.end] = FREE
        active = np.flatnonzero(u < section.end)
        u = u[active]
    for sphere in range(MAX_SPHERES):
        if not len(active):
            break
        radius = section.radius + taper * (u - section.start)
        here = poses.take(active)
        margin, slope = _margins(here, u, radius, cutter.centre_height if tangent else None)
        needed = radius - slack + margin
        points = here.tips + u[:, None] * here.axes
        if section.name == "cutter" and not sphere:
            needed = needed + cutter.envelope_radius - cutter.radius
        # every sphere but the first begins inside the empty one before
        distance = around.distance_bound(points, needed, outside=sphere > 0)
        step = _provable_step(distance, needed, slope * np.hypot(1.0, taper) + taper)
        u = u + step
        state[active[u >= section.end]] = FREE
        from_ends = np.minimum(u - step - section.start, section.end - u + step)
        surely_inside = np.maximum(np.minimum(SURE_SHARE * narrowest, from_ends), 0.0)
        state[active[distance < surely_inside]] = COLLIDING
        going = (u < section.end) & (step > MIN_STEP) & (distance > needed)
        active, u = active[going], u[going]
    return state


def _first_heights(around: Surroundings, poses: Poses, section: ToolSection) -> Float[ndarray, " n"]:
    """How far up (mm) a section about as wide as it is far from the tip is proven by one sphere above its start: about
    the start itself a sphere as wide as its disc would reach the tip, or the part beside it."""
    ahead = min(section.start + section.widest, section.end)
    reach = np.hypot(section.end, section.widest)
    needed = section.widest + poses.shift + poses.turn * reach
    distance = around.distance_bound(poses.tips + ahead * poses.axes, np.hypot(needed, ahead - section.start))
    half = np.sqrt(np.maximum(distance**2 - needed**2, 0.0)) * np.sign(np.maximum(distance, 0.0))
    return np.where((half > 0) & (ahead - half <= section.start), np.minimum(ahead + half, section.end), section.start)


def _margins(
    poses: Poses, u: Float[ndarray, " n"], radius: Float[ndarray, " n"], centre: float | None
) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"]]:
    """Margin (mm) that the moves of each pose need at height u, and how fast it grows with u; bounded by
    NEAR_SLOPE above the `centre` (mm from the tip) of a ball that touches the level."""
    margin = poses.shift + poses.turn * np.hypot(u, radius)
    if centre is None:
        return margin, poses.turn
    near = NEAR_SLOPE * (u - centre)
    return np.minimum(margin, near), np.where(near < margin, NEAR_SLOPE, poses.turn)


def _provable_step(
    distance: Float[ndarray, " n"], needed: Float[ndarray, " n"], slope: Float[ndarray, " n"]
) -> Float[ndarray, " n"]:
    """The height w at which a disc that grows by `slope` (shrinks, where negative) still fits into the sphere:
    w^2 + (needed + slope w)^2 = distance^2; 0 where none does."""
    spare = np.maximum(distance**2 - needed**2, 0.0)
    root = np.sqrt((needed * slope) ** 2 + (1 + slope**2) * spare)
    return STEP_SHARE * (root - needed * slope) / (1 + slope**2)
