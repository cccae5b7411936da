"""Collision checks of poses and moves: proven by distances where that decides, else by FCL at close poses.

What FCL would find of its tool, told by distances where those decide: fifty times as fast.

A section of the tool is a cylinder of radius r from `bottom` to `top`; of a cone, the cylinder that holds it is
proven free, and the one inside it collides. With d the distance from the axis point at height u to the nearest
obstacle:

    collision   the ball of radius min(r, u - bottom, top - u) about the point lies in the cylinder, and the
                obstacle comes nearer than that
    free        the sphere of radius d is empty; it holds the disc at every height within sqrt(d^2 - r^2) of u

In contrast to `sphere_tracing.py`, a sphere may begin up to 4 radii above the height that is proven so far:
of a wide disc close above a level no sphere about its own middle holds the rim.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import angles_between, numbered
from bonecam.planning.collision.fcl_model import FclModel, build_fcl_model
from bonecam.planning.collision.interpolation import interpolate_poses
from bonecam.planning.collision.scene import Scene, Surroundings
from bonecam.planning.collision.sphere_tracing import COLLIDING, FREE, UNDECIDED, Poses, classify_poses
from bonecam.planning.collision.tool_mesh import CIRCUMSCRIBED, reach_to_gauge_line, sweep_margin
from bonecam.tool.cutter import Cutter, ToolSection

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
    centres = cutter.centres_of(tips, axes)
    ball, *above = cutter.profile
    around = _with_prisms(scene.around(ball.name, cutter.envelope_radius, air))
    thin = cutter.radius - scene.tangent_slack
    sections = [
        ThickSection(ball.start, ball.end, thin, thin, around),
        *(_thick(scene, cutter, section, margin, air) for section in above),
    ]
    states = np.full((len(tips), len(sections)), UNDECIDED)
    for k in reversed(range(len(sections))):
        open_ = np.flatnonzero((states != COLLIDING).all(axis=1))
        states[open_, k] = _classify_section(tips[open_], axes[open_], sections[k])
    ball_free = _ball_free(around, cutter, centres)
    states[:, 0] = np.where(ball_free, states[:, 0], np.maximum(states[:, 0], UNDECIDED))
    return states


def _thick(scene: Scene, cutter: Cutter, section: ToolSection, margin: float, air: float | None) -> ThickSection:
    """A section above the cutter, thicker by its margin."""
    by = sweep_margin(cutter, section, margin)
    inner = min(section.radius, section.end_radius) + by
    outer = section.widest + by * float(np.hypot(1.0, section.taper))
    around = _with_prisms(scene.around(section.name, cutter.envelope_radius, air))
    return ThickSection(section.start - by, section.end + by, inner, outer, around)


def _with_prisms(around: Surroundings) -> Surroundings:
    """Surroundings whose columns hold the prisms that stand for them."""
    columns = [replace(column, radius=column.radius * CIRCUMSCRIBED) for column in around.columns]
    return replace(around, columns=tuple(columns))


def _ball_free(around: Surroundings, cutter: Cutter, centres: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
    """Whether the ball, thinner by the scene's `tangent_slack`, is free at each centre."""
    thin = cutter.envelope_radius - around.scene.tangent_slack
    distance = around.distance_bound(centres, np.full(len(centres), cutter.envelope_radius))
    clamping = around.scene.clamping
    above = centres[:, 2] > cutter.envelope_radius + clamping.clearance
    return (distance > thin) & (above | (not clamping.closed))


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
        raised, hit = _raise(tips[going], axes[going], proven[going], section)
        state[going[hit]] = COLLIDING
        state[going[~hit & (raised >= section.top)]] = FREE
        rising = ~hit & (raised < section.top) & (raised > proven[going] + MIN_RISE)
        proven[going] = raised
        going = going[rising]
    return state


def _raise(
    tips: Float[ndarray, "n 3"], axes: Float[ndarray, "n 3"], proven: Float[ndarray, " n"], section: ThickSection
) -> tuple[Float[ndarray, " n"], Bool[ndarray, " n"]]:
    """The proven height (mm) of each tool raised by the first sphere of LOOK_AHEAD that begins below it, and
    whether one before that told a collision."""
    raised = proven.copy()
    hit = np.zeros(len(proven), dtype=bool)
    for ahead in LOOK_AHEAD:
        open_ = np.flatnonzero(~hit & (raised <= proven + MIN_RISE))
        if not len(open_):
            break
        low = proven[open_]
        u = np.minimum(low + ahead * section.outer, section.top)
        half, hit[open_] = _sphere(tips[open_] + u[:, None] * axes[open_], u, low, section)
        raised[open_] = np.where(u - half <= low, np.maximum(raised[open_], u + half), raised[open_])
    return raised, hit


def _sphere(
    points: Float[ndarray, "n 3"], u: Float[ndarray, " n"], low: Float[ndarray, " n"], section: ThickSection
) -> tuple[Float[ndarray, " n"], Bool[ndarray, " n"]]:
    """How far above and below height `u` (mm) discs of the section lie in the empty sphere about the axis
    point there (-1 where none does), and whether an obstacle enters the section near it; distances are asked
    as far as a sphere that holds all discs above `low` reaches."""
    outer = section.outer * CIRCUMSCRIBED
    wanted = np.hypot(outer, np.maximum(u - low, section.top - u)) / SURE_SHARE
    distance = section.around.distance_bound(points, wanted)
    room = np.minimum(section.inner, np.minimum(u - section.bottom, section.top - u))
    collides = distance + section.around.deviation < SURE_SHARE * room
    spare = (SURE_SHARE * distance) ** 2 - outer**2
    return np.where((distance > 0) & (spare > 0), np.sqrt(np.maximum(spare, 0.0)), -1.0), collides


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
            free[doubtful] = self._subdivided_free(tips, axes, doubtful, cutting)
        return free

    def _classify_at_rest(
        self, centres: Float[ndarray, "n 3"], axes: Float[ndarray, "n 3"], settled: int
    ) -> Int[ndarray, " n"]:
        """State of poses with REST_MARGIN; `settled` as in `classify_poses`."""
        poses = Poses.at_rest(self.cutter.tips_of(centres, axes), axes, REST_MARGIN)
        return classify_poses(self.scene, self.cutter, poses, settled=settled)

    def _subdivided_free(
        self, tips: Float[ndarray, "n 3"], axes: Float[ndarray, "n 3"], moves: Int[ndarray, " m"], cutting: bool
    ) -> Bool[ndarray, " m"]:
        """Whether moves are free in steps: proven by distances, or by FCL at the poses that those leave
        undecided."""
        turn = angles_between(axes[moves], axes[moves + 1])
        shift = np.linalg.norm(tips[moves + 1] - tips[moves], axis=1)
        displacement = shift + turn * reach_to_gauge_line(self.cutter)
        steps = np.maximum(MIN_STEPS, np.ceil(displacement / SWEEP_MARGIN)).astype(int)
        sampled_tips, turned = interpolate_poses(tips[moves], tips[moves + 1], axes[moves], axes[moves + 1], steps)

        starts = np.r_[0, np.cumsum(steps + 1)]
        joined = np.ones(len(sampled_tips), dtype=bool)
        joined[starts[1:] - 1] = False
        poses = Poses.in_motion(sampled_tips, turned, joined)
        state = classify_poses(self.scene, self.cutter, poses, air=self._air(cutting), settled=UNDECIDED)
        return self._decided(state, sampled_tips, turned, starts[:-1], cutting=cutting)

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
