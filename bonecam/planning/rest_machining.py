"""Rest paths: what stands too deep for a level's own passes is taken before them, in steps that the ball bears.

A larger ball leaves fillets in hollows and round the post, where the ball of a level would enter the material
deeper than allowed. A rest path goes over these places with its ball raised until it enters by no more than a step,
and leaves half of what the level's own cut may take; so does the next one over what is still too deep behind it. A
step may be deeper than the level's cut, which alone decides the error that is kept. Of the patterns that may be
taken, the paths follow the one that takes less time: in a fillet round a pole rings, in a groove lines along it.

Short passes are not worth turning the table for: they are cut from as few directions as reach them, chosen greedily
(set cover) among the machine's candidates, each pass as near to its smooth axes as the others' share allows.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import angles_between, unit
from bonecam.job import PathJob
from bonecam.machine.limits import MachineLimits
from bonecam.material.dexels import move_depths
from bonecam.material.in_process_stock import InProcessStock
from bonecam.planning.axes.lead import COSINE_ROUNDING, directions_within, has_room
from bonecam.planning.axes.tool_axes import WantedAxes
from bonecam.planning.collision import CollisionChecker
from bonecam.planning.contacts import (
    MAX_LIFT_RADII,
    UNCERTAIN,
    CandidateContacts,
    DepthLimits,
    beside,
    engaged_segments_of,
    entered_runs,
    filled,
    gouge_free_lifts,
    in_turn,
    split_runs,
)
from bonecam.tool.path import ContactPath

SHORT_GAP = 6.0
"""A gap of a rest pass that is shorter is not worth a retract, mm."""
BESIDE = 3
"""A rest pass begins and ends so many contacts beside what is too deep."""
MAX_ROUNDS = 20
"""Times that a ball is moved out of the material, at most."""
OVERSHOOT = 1.2
"""A ball is moved by its excess depth times this factor, to get out of narrow places in fewer rounds."""
TURN_COST = 0.5
"""Share of a pass's length that a direction loses for each radian that it is off the pass's smooth axes."""
ENTRY = 0.6 / 60
"""Time from the end of one rest pass to the begin of the next, minutes: links whose turns take 0.5 s, and retracts."""


@dataclass(frozen=True, eq=False)
class RestStep:
    """One rest path on the lines of one pattern: its runs of contacts (by index), how deep the ball would enter at
    each contact of the pattern if it were not raised (mm), and what its centre is raised by (mm)."""

    candidates: CandidateContacts
    runs: list[Int[ndarray, " _"]]
    depth: Float[ndarray, " n"]
    raised: Float[ndarray, "n 3"]

    def minutes(self, turn_speed: float) -> float:
        """What a machine takes for the passes at least, and to get from one to the next: each move takes as long as its
        way at the feed, or as the turn of the axis of the azimuth, which follows 2 pi s on closed surfaces, at
        `turn_speed` (rad/min)."""
        candidates = self.candidates
        centres = candidates.centres + self.raised
        around = candidates.parameters[:, 0]
        turn = 2 * np.pi * candidates.level.surface.closed_in_s / turn_speed
        passes = 0.0
        for run in self.runs:
            ways = np.linalg.norm(np.diff(centres[run], axis=0), axis=1) / candidates.cutter.feed
            turns = np.abs((np.diff(around[run]) + 0.5) % 1.0 - 0.5)
            passes += float(np.maximum(ways, turns * turn).sum())
        return passes + ENTRY * len(self.runs)


def too_deep(candidates: CandidateContacts, material: InProcessStock, allowed: DepthLimits) -> bool:
    """Whether the ball would enter the material deeper than allowed on a contact that it reaches."""
    return bool((candidates.depths(material)[candidates.usable] > allowed.deepest).any())


@dataclass(eq=False)
class RestMachining:
    """The rest paths of a level, whose contacts in several patterns are given, one step at a time: each from the
    material that the steps before it have left. `turn_speed` (rad/min) is that of the axis that changes the azimuth."""

    patterns: Sequence[CandidateContacts]
    allowed: DepthLimits
    turn_speed: float = np.inf
    taken: int = 0

    def __post_init__(self) -> None:
        self.depths = [np.full(len(each.centres), np.inf) for each in self.patterns]

    def contacts(self, material: InProcessStock) -> ContactPath | None:
        """The contacts of the next step; None where nothing is too deep, or what is has come no nearer since the step
        before: its ball does not get there."""
        before, self.depths = self.depths, [each.depths(material) for each in self.patterns]
        steps = [
            _step(candidates, material, self.allowed, depth, depth < last - UNCERTAIN)
            for candidates, depth, last in zip(self.patterns, self.depths, before, strict=True)
        ]
        steps = [step for step in steps if step.runs]
        if not steps:
            return None
        step = min(steps, key=lambda step: step.minutes(self.turn_speed))
        self.taken += 1
        # The step, lifted where the raised ball would enter what must remain, and cut apart where it does not fit.
        candidates = step.candidates
        radius = step.candidates.cutter.radius
        index = np.concatenate(step.runs)
        ends = np.cumsum([len(run) for run in step.runs])
        joined = np.ones(len(index), dtype=bool)
        joined[ends - 1] = False
        normals = candidates.normals[index]
        lifts = gouge_free_lifts(
            candidates.centres[index] + step.raised[index] - radius * normals,
            normals,
            radius=radius,
            tolerance=candidates.gouge_tolerance,
            obstacles=candidates.obstacles,
            joined=joined,
            max_lift=MAX_LIFT_RADII * candidates.cutter.radius,
        )
        raised = step.raised.copy()
        raised[index] += np.nan_to_num(lifts)[:, None] * normals
        fits = np.isfinite(lifts)
        apart = np.unique(np.r_[ends[:-1], np.flatnonzero(~fits)])
        pieces = [piece[fits[piece]] for piece in np.split(np.arange(len(index)), apart)]
        step = RestStep(candidates, [index[piece] for piece in pieces if len(piece)], step.depth, raised)
        lines = step.candidates.lines
        runs = entered_runs(lines, step.runs, step.depth, step.raised, self.allowed.of_step.limit)
        segments = engaged_segments_of(in_turn(lines, runs))
        return replace(step.candidates.path_of(segments), rest=self.taken)


def after_steps(path: ContactPath, material: InProcessStock, allowed: DepthLimits) -> ContactPath:
    """The contacts of a rest path but those at which the ball would still be too deep. A pass
    ends there, and where the straight way to its next contact is too deep: over a ridge that balls are raised out of
    to both sides. None where all of the path is in air."""
    radius = path.cutter.radius
    depth, _ = material.depths(path.centres, radius)
    if not (depth > UNCERTAIN).any():
        return path.take(np.zeros(0, dtype=np.int64))
    kept = np.flatnonzero(depth <= allowed.deepest)
    goes_on = (np.diff(kept) == 1) & (np.diff(path.pass_index[kept]) == 0)
    first, last = kept[:-1][goes_on], kept[1:][goes_on]
    between = move_depths(material.depths, path.centres[first], path.centres[last], radius)
    goes_on[goes_on] = between <= allowed.deepest
    return replace(path.take(kept), pass_index=np.r_[0, np.cumsum(~goes_on)][: len(kept)])


def held_axes(
    path: ContactPath, wanted: WantedAxes, checker: CollisionChecker, limits: MachineLimits, job: PathJob
) -> tuple[ContactPath, WantedAxes]:
    """The path and its wanted axes, each pass held in one of as few directions as reach whole passes free of collision,
    and the passes in the order in which the machine gets from one to the next soonest. Passes that none reaches keep
    their axes, and all do on a machine that has few."""
    if limits.narrow or not len(path.contacts):
        return path, wanted
    directions = directions_within(limits)
    directions = directions[limits.allow(directions)]
    starts = np.flatnonzero(np.r_[True, np.diff(path.pass_index) != 0])
    counts = np.diff(np.r_[starts, len(path.contacts)])
    number = np.repeat(np.arange(len(starts)), counts)
    rows = np.split(np.arange(len(path.contacts)), starts[1:])
    steps = np.r_[0.0, np.linalg.norm(np.diff(path.centres, axis=0), axis=1)]
    steps[starts] = 0.0
    cosines = path.normals @ directions.T
    highest = np.cos(np.radians(job.least_lead_deg)) + COSINE_ROUNDING
    leaning = (cosines <= highest) & (cosines >= np.cos(np.radians(job.max_tilt_deg)) - COSINE_ROUNDING)
    reached = np.logical_and.reduceat(leaning, starts, axis=0)
    off = np.array([angles_between(unit(wanted.axes[each].sum(axis=0)[None]), directions) for each in rows])
    worth = np.maximum(np.add.reduceat(steps, starts)[:, None] * (1 - TURN_COST * off), 0.0) * reached

    axes, proven = wanted.axes.copy(), np.zeros(len(directions), dtype=bool)
    while (worth > 0).any():
        best = int(worth.sum(axis=0).argmax())
        contacts = np.flatnonzero(worth[number, best] > 0)
        if proven[best]:
            axes[contacts] = directions[best]
            worth[number[contacts]] = 0.0
            continue
        proven[best] = True
        balls, tried = path.centres[contacts], np.tile(directions[best], (len(contacts), 1))
        free = has_room(tried, balls, checker.cutter, checker.scene.clamping)
        free[free] = checker.free_by_distance(balls[free], tried[free])
        worth[number[contacts[~free]], best] = 0.0

    # from each pass to the one that is reached soonest
    order, left = [0], np.arange(1, len(starts))
    while len(left):
        end, first = rows[order[-1]][-1], starts[left]
        away = np.linalg.norm(path.centres[first] - path.centres[end], axis=1) / path.cutter.feed
        turn = angles_between(axes[first], np.tile(axes[end], (len(left), 1))) / limits.turn_speed
        soonest = int((away + turn).argmin())
        order.append(int(left[soonest]))
        left = np.delete(left, soonest)
    turned = np.concatenate([rows[k] for k in order])
    passes = np.repeat(np.arange(len(order)), counts[order])
    certified = wanted.certified & (axes == wanted.axes).all(axis=1)
    cones = wanted.cones.at(turned) if wanted.cones else None
    return replace(path.take(turned), pass_index=passes), WantedAxes(axes[turned], certified[turned], cones)


def _step(
    candidates: CandidateContacts,
    material: InProcessStock,
    allowed: DepthLimits,
    depth: Float[ndarray, " n"],
    asked: Bool[ndarray, " n"],
) -> RestStep:
    """The step on the lines of one pattern, whose balls would enter by this `depth`, to what is `asked` for: it leaves
    half of what the level's own cut may take."""
    lines, usable = candidates.lines, candidates.usable
    deep = usable & asked & (depth > allowed.deepest)
    step = allowed.of_step.limit
    here = filled(lines, beside(lines, deep, BESIDE) & usable, usable, SHORT_GAP)
    runs = [run for run in split_runs(lines, here) if deep[run].any()]
    cut = np.clip(depth - allowed.limit / 2, 0.0, step)
    for run in runs:
        # the run comes from air to what is deep, and leaves so
        index = np.flatnonzero(deep[run])
        before = index[0]
        behind = len(run) - 1 - index[-1]
        rising = np.arange(len(run)) / before if before else np.ones(len(run))
        falling = np.arange(len(run))[::-1] / behind if behind else np.ones(len(run))
        cut[run] = np.minimum(cut[run], step * np.minimum(np.minimum(rising, falling), 1.0))
    index = np.concatenate([np.zeros(0, dtype=np.int64), *runs])
    raised = np.zeros((len(depth), 3))
    # What each ball has to be moved by to enter the material by `cut` (mm) only: by what is too deep, away from the
    # nearest place, and again, as it may then be too deep in another wall.
    centres = candidates.centres[index]
    wanted = cut[index]
    shift = np.zeros((len(centres), 3))
    left = np.arange(len(centres))
    for _ in range(MAX_ROUNDS):
        sunk, away = material.depths(centres[left] + shift[left], candidates.cutter.radius)
        more = sunk - wanted[left]
        moved = more > UNCERTAIN / 2
        left = left[moved]
        if not len(left):
            break
        shift[left] += OVERSHOOT * more[moved, None] * away[moved]
    raised[index] = shift
    return RestStep(candidates, runs, depth, raised)
