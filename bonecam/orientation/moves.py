"""Moves between poses: tip and axis interpolated, proven by distance or judged by FCL at close poses."""

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.orientation.clear import FREE, HIT, Poses, judge_by_distance
from bonecam.orientation.collision import Judge
from bonecam.orientation.limits import angles_between, unit
from bonecam.orientation.scene import Scene
from bonecam.toolpath.cutter import Cutter

SWEEP_MARGIN = 0.2
"""Shank and holder are thickened by this much while moves are judged by FCL; no tool point moves further between poses judged."""


class Checker:
    """Proofs of one cutter in one scene; FCL models are built when first needed."""

    def __init__(self, scene: Scene, cutter: Cutter) -> None:
        self.scene, self.cutter = scene, cutter
        self._judge: Judge | None = None

    @property
    def judge(self) -> Judge:
        """The FCL judge of poses on moves."""
        if self._judge is None:
            self._judge = Judge(self.scene, self.cutter, SWEEP_MARGIN)
        return self._judge

    def free(self, centres: Float[ndarray, "n 3"], axes: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
        """Whether still poses with these ball centres are proven free by distance alone."""
        poses = Poses.still(centres - self.cutter.radius * axes, axes)
        return judge_by_distance(self.scene, self.cutter, poses) == FREE

    def free_or_judged(self, centres: Float[ndarray, "n 3"], axes: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
        """As `free`, with FCL deciding where distances leave it open."""
        tips = centres - self.cutter.radius * axes
        state = judge_by_distance(self.scene, self.cutter, Poses.still(tips, axes))
        for i in np.flatnonzero((state != FREE) & (state != HIT)):
            state[i] = HIT if self.judge.hits(tips[i], axes[i]) else FREE
        return state == FREE

    def free_moves(
        self, tips: Float[ndarray, "n 3"], axes: Float[ndarray, "n 3"], joined: Bool[ndarray, " n"], *, cutting: bool = True
    ) -> Bool[ndarray, " n"]:
        """Whether the move from i to i + 1 is free, where `joined[i]`; False elsewhere."""
        state = judge_by_distance(self.scene, self.cutter, Poses.moving(tips, axes, joined), cutting=cutting)
        proven = joined & (state == FREE) & (np.r_[state[1:], HIT] == FREE)
        for i in np.flatnonzero(joined & ~proven):
            proven[i] = self._judged(tips[i : i + 2], axes[i : i + 2], cutting)
        return proven

    def _judged(self, tips: ndarray, axes: ndarray, cutting: bool) -> bool:
        turn = float(angles_between(axes[:1], axes[1:])[0])
        reach = float(np.linalg.norm(tips[1] - tips[0])) + turn * np.hypot(self.cutter.length, self.cutter.holder_diameter / 2)
        steps = max(1, int(np.ceil(reach / SWEEP_MARGIN)))
        places, turns = interpolated(tips[0], tips[1], axes[0], axes[1], steps)
        poses = Poses.moving(places, turns, np.r_[np.ones(steps, dtype=bool), False])
        state = judge_by_distance(self.scene, self.cutter, poses, cutting=cutting)
        if (state == HIT).any():
            return False
        return not any(self.judge.hits(places[k], turns[k], cutting=cutting) for k in np.flatnonzero(state != FREE))


def interpolated(
    first: Float[ndarray, "3"], last: Float[ndarray, "3"], first_axis: Float[ndarray, "3"], last_axis: Float[ndarray, "3"], steps: int
) -> tuple[Float[ndarray, "k 3"], Float[ndarray, "k 3"]]:
    """steps + 1 poses: tips on the straight line, axes on the great circle at even angles."""
    f = np.linspace(0, 1, steps + 1)[:, None]
    angle = float(angles_between(first_axis[None], last_axis[None])[0])
    if angle < 1e-9:
        axes = (1 - f) * first_axis + f * last_axis
    else:
        axes = (np.sin((1 - f) * angle) * first_axis + np.sin(f * angle) * last_axis) / np.sin(angle)
    return (1 - f) * first + f * last, unit(axes)
