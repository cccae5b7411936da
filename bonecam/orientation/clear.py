"""Proving tools clear by distances alone: spheres about points of the tool's axis, one after the other.

A sphere of radius d (the distance of its centre u to the nearest obstacle) holds the tool's disc of radius r
at every height within sqrt(d^2 - r^2) of u; the next sphere starts there. The first lies outside every
obstacle (signed distance), so containment cannot go unseen. A margin that grows along the axis, half of what
the neighbouring moves displace the tool at that height, proves those half moves too: every pose on a move
lies within half of it from one of its ends.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.orientation.limits import angles_between
from bonecam.orientation.scene import TABLE_CLEARANCE, Scene
from bonecam.setup.holding import Post
from bonecam.toolpath.cutter import Cutter

SLACK = 0.01
"""The cutter is shrunk by this much, mm: a tangent contact is no collision."""
ROUNDS, SHORTEST = 40, 0.02
NEAR_SLOPE = 0.25
"""Near the ball the margin grows no faster than this with the height above its centre: moves there run along
the surface."""
FREE, UNSURE, HIT = 0, 1, 2


@dataclass(frozen=True, eq=False)
class Poses:
    """Tool positions; `shift` (mm) and `turn` (radians) are half of the largest neighbouring move: the margin
    at u is shift + turn u."""

    tips: Float[ndarray, "n 3"]
    axes: Float[ndarray, "n 3"]
    shift: Float[ndarray, " n"]
    turn: Float[ndarray, " n"]

    @classmethod
    def still(cls, tips: Float[ndarray, "n 3"], axes: Float[ndarray, "n 3"], margin: float = 0.0) -> "Poses":
        """Poses that stand alone, with an even margin."""
        return cls(tips, axes, np.full(len(tips), margin), np.zeros(len(tips)))

    @classmethod
    def moving(
        cls,
        tips: Float[ndarray, "n 3"],
        axes: Float[ndarray, "n 3"],
        joined: Bool[ndarray, " n"],
        margin: float = 0.0,
    ) -> "Poses":
        """Poses of moves: `joined[i]` where the tool moves from i to i + 1."""
        shift, turn = np.full(len(tips), margin), np.zeros(len(tips))
        i = np.flatnonzero(joined)
        for values, half in (
            (shift, np.linalg.norm(tips[i + 1] - tips[i], axis=1) / 2),
            (turn, angles_between(axes[i + 1], axes[i]) / 2),
        ):
            base = values.copy()
            np.maximum.at(values, i, base[i] + half)
            np.maximum.at(values, i + 1, base[i + 1] + half)
        return cls(tips, axes, shift, turn)

    def take(self, which: Int[ndarray, " k"]) -> "Poses":
        """Some of the poses."""
        return Poses(self.tips[which], self.axes[which], self.shift[which], self.turn[which])


def judge_by_distance(
    scene: Scene, cutter: Cutter, poses: Poses, *, cutting: bool = True
) -> Int[ndarray, " n"]:
    """FREE (proven, moves included), UNSURE or HIT for every pose.

    `cutting`: the cutter is held against the level, slightly shrunk; else against the material like shank and
    holder.
    """
    state = _table_state(cutter, poses)
    for name, start, end, radius in cutter.sections:
        open_ = np.flatnonzero(state != HIT)
        touching = cutting and name == "cutter"
        post = scene.post if name == "cutter" else scene.thick_post(cutter.radius)
        found = _march(scene, poses.take(open_), start, end, radius, touching, post, cutter.radius)
        state[open_] = np.maximum(state[open_], found)
    return state


def _table_state(cutter: Cutter, poses: Poses) -> ndarray:
    """FREE where the lowest rims of shank and holder stay above the table, else HIT.

    On a straight move a rim sinks below its ends by no more than (u + r) turn^2, turn being half of the
    move's angle.
    """
    lowest = np.full(len(poses.tips), np.inf)
    across = np.hypot(poses.axes[:, 0], poses.axes[:, 1])
    for _, start, end, radius in cutter.sections:
        for u in (start, end):
            rim = poses.tips[:, 2] + u * poses.axes[:, 2] - radius * across
            lowest = np.minimum(lowest, rim - (u + radius) * poses.turn**2)
    return np.where(lowest >= TABLE_CLEARANCE, FREE, HIT)


def _march(
    scene: Scene,
    poses: Poses,
    start: float,
    end: float,
    radius: float,
    touching: bool,
    post: Post,
    ball: float,
) -> Int[ndarray, " n"]:
    """Spheres from `start` to `end` along every axis at once."""
    state = np.full(len(poses.tips), UNSURE)
    active = np.arange(len(poses.tips))
    u = np.full(len(active), start)
    core = radius - SLACK if touching else radius
    for sphere in range(ROUNDS):
        if not len(active):
            break
        shift, turn = poses.shift[active], poses.turn[active]
        margin, slope = shift + turn * np.hypot(u, radius), turn
        if touching:
            near = NEAR_SLOPE * (u - ball)
            margin, slope = np.minimum(margin, near), np.where(near < margin, NEAR_SLOPE, turn)
        points = poses.tips[active] + u[:, None] * poses.axes[active]
        # every sphere but the first begins inside the one before, which holds nothing
        distance = scene.room(
            points, core + margin, "level" if touching else "material", post, outside=sphere > 0
        )
        reach = _reach(distance, core + margin, slope)
        u = u + reach
        state[active[u >= end]] = FREE
        certain = np.minimum(0.9 * core, np.minimum(u - reach - start, end - u + reach))
        state[active[distance < np.maximum(certain, 0.0)]] = HIT
        going = (u < end) & (reach > SHORTEST) & (distance > core + margin)
        active, u = active[going], u[going]
    return state


def _reach(distance: ndarray, needed: ndarray, slope: ndarray) -> ndarray:
    """The height w at which a disc that grows by `slope` still fits: w^2 + (needed + slope w)^2 = distance^2;
    0 where none does."""
    spare = np.maximum(distance**2 - needed**2, 0.0)
    return 0.999 * (np.sqrt((needed * slope) ** 2 + (1 + slope**2) * spare) - needed * slope) / (1 + slope**2)
