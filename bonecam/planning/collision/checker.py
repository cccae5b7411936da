"""Collision checks of poses and moves: proven by distances where that decides, else by FCL at close poses."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import angles_between, numbered
from bonecam.planning.collision.fcl_model import FclModel, build_fcl_model
from bonecam.planning.collision.interpolation import interpolate_poses
from bonecam.planning.collision.scene import Scene
from bonecam.planning.collision.sphere_tracing import COLLIDING, FREE, UNDECIDED, Poses, classify_poses
from bonecam.planning.collision.thick_tool import classify_thick_tool
from bonecam.planning.collision.tool_mesh import reach_to_gauge_line
from bonecam.tool.cutter import Cutter

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

    def free_by_distance(
        self, centres: Float[ndarray, "n 3"], axes: Float[ndarray, "n 3"]
    ) -> Bool[ndarray, " n"]:
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
        state[asked] = classify_poses(
            self.scene, self.cutter, poses, air=self._air(cutting), settled=UNDECIDED
        )
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
        self,
        tips: Float[ndarray, "n 3"],
        axes: Float[ndarray, "n 3"],
        moves: Int[ndarray, " m"],
        cutting: bool,
    ) -> Bool[ndarray, " m"]:
        """Whether moves are free in steps: proven by distances, or by FCL at the poses that those leave
        undecided."""
        turn = angles_between(axes[moves], axes[moves + 1])
        shift = np.linalg.norm(tips[moves + 1] - tips[moves], axis=1)
        displacement = shift + turn * reach_to_gauge_line(self.cutter)
        steps = np.maximum(MIN_STEPS, np.ceil(displacement / SWEEP_MARGIN)).astype(int)
        sampled_tips, turned = interpolate_poses(
            tips[moves], tips[moves + 1], axes[moves], axes[moves + 1], steps
        )

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
