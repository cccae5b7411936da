"""Moves between poses: tip and axis interpolated, proven by distance or judged by FCL at close poses."""

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.orientation.clear import FREE, HIT, UNSURE, Poses, judge_by_distance
from bonecam.orientation.collision import Judge
from bonecam.orientation.limits import angles_between, unit
from bonecam.orientation.scene import Scene
from bonecam.toolpath.cutter import Cutter

AIR, LEAST_STEPS = 0.1, 3
SWEEP_MARGIN = 0.2
"""Shank and holder are thickened by this much while moves are judged by FCL; no tool point moves further
between poses judged."""


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
        """Whether still poses with these ball centres are proven free by distance alone, with AIR to spare
        for the moves between."""
        poses = Poses.still(centres - self.cutter.radius * axes, axes, AIR)
        return judge_by_distance(self.scene, self.cutter, poses) == FREE

    def clear(self, centres: Float[ndarray, "n 3"], axes: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
        """Whether still poses are free, by distance or, where that proves nothing, by FCL: in hollows hardly
        wider than the ball."""
        tips = centres - self.cutter.radius * axes
        state = judge_by_distance(self.scene, self.cutter, Poses.still(tips, axes, AIR))
        for i in np.flatnonzero(state == UNSURE):
            state[i] = HIT if self.judge.hits(tips[i], axes[i]) else FREE
        return np.asarray(state == FREE)

    def steady(
        self, tips: Float[ndarray, "n 3"], axes: Float[ndarray, "n 3"], joined: Bool[ndarray, " n"]
    ) -> Bool[ndarray, " n"]:
        """Whether each pose and its half of the moves to its neighbours is proven free by distance; `joined`
        as in `free_moves`."""
        return judge_by_distance(self.scene, self.cutter, Poses.moving(tips, axes, joined)) == FREE

    def free_moves(
        self,
        tips: Float[ndarray, "n 3"],
        axes: Float[ndarray, "n 3"],
        joined: Bool[ndarray, " n"],
        known: Bool[ndarray, " n"] | None = None,
        *,
        cutting: bool = True,
    ) -> Bool[ndarray, " n"]:
        """Whether the move from i to i + 1 is free, where `joined[i]`; False elsewhere. `known` poses were
        found steady before."""
        state = np.full(len(tips), FREE)
        asked = np.arange(len(tips)) if known is None else np.flatnonzero(~known)
        poses = Poses.moving(tips, axes, joined).take(asked)
        state[asked] = judge_by_distance(self.scene, self.cutter, poses, cutting=cutting)
        proven = joined & (state == FREE) & (np.r_[state[1:], HIT] == FREE)
        doubtful = np.flatnonzero(joined & ~proven)
        if len(doubtful):
            proven[doubtful] = self._judged(tips, axes, doubtful, cutting)
        return proven

    def _judged(
        self, tips: ndarray, axes: ndarray, moves: Int[ndarray, " m"], cutting: bool
    ) -> Bool[ndarray, " m"]:
        """Each move in steps: proven by distance, or else judged by FCL at each of them."""
        turn = angles_between(axes[moves], axes[moves + 1])
        reach = np.linalg.norm(tips[moves + 1] - tips[moves], axis=1) + turn * np.hypot(
            self.cutter.length, self.cutter.holder_diameter / 2
        )
        steps = np.maximum(LEAST_STEPS, np.ceil(reach / SWEEP_MARGIN)).astype(int)
        places, turns = interpolated(tips[moves], tips[moves + 1], axes[moves], axes[moves + 1], steps)
        starts = np.r_[0, np.cumsum(steps + 1)]
        inside = np.ones(len(places), dtype=bool)
        inside[starts[1:] - 1] = False
        state = judge_by_distance(
            self.scene, self.cutter, Poses.moving(places, turns, inside), cutting=cutting
        )
        worst = np.maximum.reduceat(state, starts[:-1])
        for k in np.flatnonzero(worst == UNSURE):
            unsure = starts[k] + np.flatnonzero(state[starts[k] : starts[k + 1]] == UNSURE)
            if any(self.judge.hits(places[j], turns[j], cutting=cutting) for j in unsure):
                worst[k] = HIT
        return worst != HIT


def interpolated(
    first: Float[ndarray, "m 3"],
    last: Float[ndarray, "m 3"],
    first_axes: Float[ndarray, "m 3"],
    last_axes: Float[ndarray, "m 3"],
    steps: int | Int[ndarray, " m"],
) -> tuple[Float[ndarray, "k 3"], Float[ndarray, "k 3"]]:
    """steps + 1 poses of each move, one move behind the other: tips on the straight line, axes on the great
    circle at even angles."""
    counts = np.broadcast_to(np.asarray(steps) + 1, len(first))
    move = np.repeat(np.arange(len(first)), counts)
    f = ((np.arange(len(move)) - np.repeat(np.cumsum(counts) - counts, counts)) / (counts[move] - 1))[:, None]
    angle = angles_between(first_axes, last_axes)[move][:, None]
    sine = np.sin(angle)
    bent = angle >= 1e-9
    a = np.where(bent, np.sin((1 - f) * angle) / np.where(bent, sine, 1.0), 1 - f)
    b = np.where(bent, np.sin(f * angle) / np.where(bent, sine, 1.0), f)
    return (1 - f) * first[move] + f * last[move], unit(a * first_axes[move] + b * last_axes[move])
