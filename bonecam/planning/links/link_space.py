"""What links between passes are planned in: obstacles, limits, clearance surface and feeds, and the proof
that polylines of poses are free."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import unit
from bonecam.machine.limits import MachineLimits
from bonecam.material.dexels import CELL
from bonecam.material.in_process_stock import InProcessStock
from bonecam.material.move_depths import move_depths
from bonecam.planning.collision.checker import CollisionChecker
from bonecam.planning.collision.interpolation import interpolate_poses
from bonecam.planning.layers.height_mesh import HeightMesh
from bonecam.planning.links.clearance_surface import ClearanceSurface
from bonecam.planning.links.moves import Feeds, Pose
from bonecam.planning.passes.engaged_segments import UNCERTAIN
from bonecam.planning.passes.gouge_lifts import moves_gouge_free

CHECK_STEPS = 4
"""Steps that a straight move is divided into for its proof."""

SPARE = 0.5
"""The clearance surface is farther from the stock than the clearance by this much, mm: straight rapids of 3 mm
between its points dip 0.15 mm below it, and the proof of a step needs half of its length."""

UP = np.array([0.0, 0.0, 1.0])

IN_AIR = UNCERTAIN
"""A ball that is no deeper in the material is in air, mm: as accurately as the depth is known."""

CUT_ALLOWED = 0.01
"""What lies between two cuts, a link and the arcs at its ends, removes no more together, mm^3: half of what the
simulation of the posted program allows."""

ARC_ALLOWED = CUT_ALLOWED / 4
"""An arc removes no more of that, mm^3: the rest is left to what lies between two arcs."""

RAPID_SPARE = CELL
"""Rapids keep so far from the material, mm, as its rays tell it: they meet all that is wider than their distance."""

Polyline = tuple[Float[ndarray, "_ 3"], Float[ndarray, "_ 3"]]
"""Ball centres and axes of straight moves."""


@dataclass(frozen=True, eq=False)
class LinkSpace:
    """`clearance` (mm) is kept between tool and material in rapids; `gouge_tolerance` (mm) by a ball that moves
    along the level. `material` is what stands before the level is cut; None: it is not known. `lead_radius` (mm): cuts
    begin and end on arcs of at most this radius; 0: straight."""

    checker: CollisionChecker
    limits: MachineLimits
    feeds: Feeds
    clearance: float
    gouge_tolerance: float
    material: InProcessStock | HeightMesh | None = None
    lead_radius: float = 0.0

    @property
    def ball_radius(self) -> float:
        """Radius of the ball that holds the end of the cutter, mm."""
        return self.checker.cutter.envelope_radius

    @cached_property
    def surface(self) -> ClearanceSurface:
        """The surface that ball centres traverse on."""
        return ClearanceSurface(self.checker.scene.stock, self.clearance + SPARE + self.ball_radius)

    @cached_property
    def safe_pose(self) -> Pose:
        """Ball centre and axis of the point above the stock where a level begins and ends."""
        beside = self.checker.scene.clamping.beside
        # what holds the free end stands in the way from above: come from the side away from its column
        wanted = np.array([-beside[0].x, -beside[0].y, 0.0]) if beside else UP
        axis = self.limits.nearest(unit(wanted[None]))[0]
        if (axis != UP).any():
            # beside the upper end, where a tool that lies comes and goes along its axis
            reach = self.surface.radius + self.clearance
            return np.asarray(self.surface.stock.end) + reach * axis, axis
        top = np.array([self.surface.top])
        height = np.array([self.clearance])
        centre, _ = self.surface.frames(np.zeros(1), top, height)
        return centre[0], axis

    def ball_free(self, starts: Float[ndarray, "m 3"], ends: Float[ndarray, "m 3"]) -> Bool[ndarray, " m"]:
        """Whether the ball keeps the gouge tolerance on straight moves of its centre: the collision checks
        hold a thinner one against the level."""
        free = np.ones(len(starts), dtype=bool)
        for obstacle in self.checker.scene.remaining:
            free[free] = moves_gouge_free(starts[free], ends[free], self.ball_radius, self.gouge_tolerance, obstacle)
        return free

    def in_air(self, centres: Float[ndarray, "k p 3"]) -> Bool[ndarray, " k"]:
        """Whether the ball removes nothing at all of the p centres of each link."""
        if self.material is None or not len(centres):
            return np.ones(len(centres), dtype=bool)
        depth, _ = self.material.depths(centres.reshape(-1, 3), self.ball_radius)
        return np.asarray((depth <= IN_AIR).reshape(centres.shape[:2]).all(axis=1))

    def known_in_air(self, centres: Float[ndarray, "k 3"]) -> Bool[ndarray, " k"]:
        """Whether the ball is in air at each centre; nowhere where the material is not known."""
        return self.in_air(centres[:, None]) & (self.material is not None)

    def no_deeper_between(self, starts: Float[ndarray, "m 3"], ends: Float[ndarray, "m 3"]) -> Bool[ndarray, " m"]:
        """Whether the ball goes no deeper on each straight move of its centre than at the deepest of all their ends."""
        if self.material is None or not len(starts):
            return np.ones(len(starts), dtype=bool)
        depths = self.material.depths
        radius = self.ball_radius
        deepest = max(float(depths(centres, radius)[0].max()) for centres in (starts, ends))
        return move_depths(depths, starts, ends, radius) <= max(deepest, 0.0) + IN_AIR

    def left_in_air(
        self, contacts: Float[ndarray, "k 3"], centres: Float[ndarray, "k p 3"], deepest: float = IN_AIR
    ) -> Bool[ndarray, " k"]:
        """Whether the ball goes no deeper than `deepest` (mm) at the p centres that follow each contact, but into what
        it has removed there."""
        if self.material is None or not len(centres):
            return np.ones(len(centres), dtype=bool)
        points = centres.reshape(-1, 3)
        behind = np.repeat(contacts, centres.shape[1], axis=0)
        entered = self.material.entered_anew(points, behind, self.ball_radius, deepest)
        return np.asarray(~entered.reshape(centres.shape[:2]).any(axis=1))

    def cuts_little(
        self, lines: Sequence[Polyline], contacts: Sequence[Polyline], arcs: Int[ndarray, " k"] | None = None
    ) -> Bool[ndarray, " k"]:
        """Whether neither the ball alone nor ball and flutes remove more than CUT_ALLOWED on straight moves through the
        poses of each line, but for what they have removed at the contacts of that line; `arcs`, so many, that lie
        between the same two cuts take their share of it."""
        allowed = CUT_ALLOWED - ARC_ALLOWED * (np.zeros(len(lines)) if arcs is None else arcs)
        return self._cut_little(lines, contacts, allowed)

    def arcs_cut_little(self, lines: Sequence[Polyline], contacts: Sequence[Polyline]) -> Bool[ndarray, " k"]:
        """As `cuts_little`, whether they remove no more than ARC_ALLOWED on each line."""
        return self._cut_little(lines, contacts, np.full(len(lines), ARC_ALLOWED))

    def _cut_little(
        self, lines: Sequence[Polyline], contacts: Sequence[Polyline], allowed: Float[ndarray, " k"]
    ) -> Bool[ndarray, " k"]:
        """Whether no more than is `allowed` (mm^3) goes on each line."""
        if self.material is None or self.material.rays is None:
            return np.ones(len(lines), dtype=bool)
        return self.material.rays.cut_little(lines, contacts, self.checker.cutter, allowed)

    def rapids_cut_nothing(self, lines: Sequence[Polyline]) -> Bool[ndarray, " k"]:
        """Whether a ball that is thicker by RAPID_SPARE removes nothing on straight moves through the poses of each
        line."""
        if self.material is None or self.material.rays is None:
            return np.ones(len(lines), dtype=bool)
        nowhere = [(np.zeros((0, 3)), np.zeros((0, 3)))] * len(lines)
        removed = self.material.rays.balls.removed_by(lines, nowhere, self.ball_radius + RAPID_SPARE)
        return removed == 0

    def polylines_free(self, polylines: Sequence[Polyline], *, cutting: bool) -> Bool[ndarray, " k"]:
        """Whether all moves of each polyline are proven free; `cutting` as in
        `CollisionChecker.moves_free`."""
        if not polylines:
            return np.zeros(0, dtype=bool)
        starts = np.vstack([centres[:-1] for centres, _ in polylines])
        ends = np.vstack([centres[1:] for centres, _ in polylines])
        first = np.vstack([axes[:-1] for _, axes in polylines])
        last = np.vstack([axes[1:] for _, axes in polylines])
        start_tips = self.checker.cutter.tips_of(starts, first)
        end_tips = self.checker.cutter.tips_of(ends, last)
        tips, axes = interpolate_poses(start_tips, end_tips, first, last, CHECK_STEPS)

        joined = np.tile(np.r_[np.ones(CHECK_STEPS, dtype=bool), False], len(first))
        steps_free = self.checker.moves_free(tips, axes, joined, cutting=cutting) | ~joined
        free = steps_free.reshape(len(first), -1).all(axis=1)
        if cutting:
            free[free] = self.ball_free(starts[free], ends[free])
        polyline = np.repeat(np.arange(len(polylines)), [len(centres) - 1 for centres, _ in polylines])
        return np.bincount(polyline, ~free, len(polylines)) == 0
