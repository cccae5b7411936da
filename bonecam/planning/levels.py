"""Contacts of a path that would cut deeper than allowed, told by the rays that the proof measures with.

The depth at a contact (`InProcessStock.depths`) is that of the ball there, among places of a height field. What a path
removes in all, its flutes and the moves between its contacts included, is measured as the simulation of the posted text
measures it: how far the nearest air was from places of the new surface (`material/dexels.py`), as near to one
another as there, on the rays of the planner, which are farther apart.

The tool paths of all levels of a morph in machining order: from the level next to the stock down to the
part.

Each level needs the material that the level before it left, so the levels follow one another; what does not
depend on that material (the contacts of the next level) is made in a second thread meanwhile, and what does not depend
on the axes (the contacts of rest paths) while those are found.
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool
from numpy import ndarray
from scipy.spatial import KDTree

from bonecam.arrays import dots
from bonecam.errors import OrientationError
from bonecam.job import Job, PathJob
from bonecam.levels.measure import Level, MachinedLevel, machined_levels
from bonecam.machine.limits import MachineLimits
from bonecam.material.dexels import cut_depths, uncut_rays
from bonecam.material.in_process_stock import DEVIATION, InProcessStock, remove_material, uncut_material
from bonecam.mesh.distance import MeshDistance
from bonecam.planning.axes.field import SmoothAxes, level_axes
from bonecam.planning.axes.lead import check_lead
from bonecam.planning.axes.tool_axes import added_axes
from bonecam.planning.blank import bar_of, blank_paths
from bonecam.planning.collision import CollisionChecker
from bonecam.planning.contacts import (
    UNCERTAIN,
    CandidateContacts,
    DepthLimits,
    candidate_contacts,
    contact_path,
    flute_slack,
)
from bonecam.planning.estimate import cutter_of, depth_limits
from bonecam.planning.links import without_returns
from bonecam.planning.oriented_path import orient
from bonecam.planning.parting import parting_paths
from bonecam.planning.rest_machining import RestMachining, after_steps, held_axes, too_deep
from bonecam.planning.scene import Scene, distance_to_part, held_level
from bonecam.progress import Progress, report, silent
from bonecam.setup.capsule import Capsule, enclosing_capsule
from bonecam.setup.stock import Stock
from bonecam.setup.stocks.cylinder import Cylinder
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import ContactPath, MoveKind, ToolPath
from bonecam.workholding.clamping import Clamping, clamping_of
from bonecam.workholding.post import Post, post_below

SLACK = 0.02
"""A place may be so much (mm) deeper than is allowed at a contact. The proof allows 0.04 (half of the distance of its
rays, of which a contact's depth takes UNCERTAIN), and finds places up to 0.016 deeper than the planner's rays do."""
MOST_PLACES = 500
"""So many of the places that are too deep are asked for what cut them at once, the deepest."""
MAX_ROUNDS = 3
"""Times that a path is made anew without the contacts at which it was too deep, at most."""
SAME = 1e-6
"""A ball of the path and a contact's are one, mm."""


Cut = tuple[ToolPath, InProcessStock]
"""A path, and what stands behind it."""


def cut_within_depth(
    contacts: ContactPath,
    material: InProcessStock,
    level: MachinedLevel,
    allowed: DepthLimits,
    oriented: Callable[[ContactPath], ToolPath],
) -> Cut:
    """The path that is `oriented` over the contacts of a level and what it leaves of the material, made anew without
    those at which it cuts too deep."""
    for _ in range(MAX_ROUNDS):
        path = oriented(contacts)
        after = remove_material(material, level, path)
        kept = within_depth(contacts, path, material, after, allowed)
        if kept.all():
            break
        contacts = leave_out(contacts, kept)
    return path, after


def within_depth(
    contacts: ContactPath, path: ToolPath, before: InProcessStock, after: InProcessStock, allowed: DepthLimits
) -> Bool[ndarray, " n"]:
    """Which of the contacts may stay, where `path`, made of them, leads from the material `before` to that `after` it:
    all but those at which the cutter touches a place that it cuts too deep."""
    kept = np.ones(len(contacts.centres), dtype=bool)
    left = after.rays.cutters
    grid = after.rays.cutters.grid
    cuts = cut_depths(left.sets, before.rays.cutters.sets, grid)
    deep = np.flatnonzero(cuts.depths > allowed.deepest + SLACK)
    if not len(deep):
        return kept
    deep = deep[np.argsort(-cuts.depths[deep])][:MOST_PLACES]
    cutting = np.flatnonzero(path.kinds == MoveKind.CUT)

    # Whether ball or flutes come within `room` (mm) of one of the places in each of these rows
    points = cuts.places[deep]
    balls, axes = path.balls[cutting], path.axes[cutting]
    touching = np.zeros(len(cutting), dtype=bool)
    for place in points:
        height = np.clip(dots(place - balls, axes), 0.0, path.cutter.reach)
        away = np.linalg.norm(place - balls - height[:, None] * axes, axis=1)
        touching |= away < path.cutter.radius + grid.cell

    away, nearest = KDTree(contacts.centres).query(path.balls[cutting[touching]])
    kept[np.asarray(nearest)[np.asarray(away) < SAME]] = False
    return kept


def leave_out(contacts: ContactPath, kept: Bool[ndarray, " n"]) -> ContactPath:
    """The contacts that are `kept`, their passes ended where one is left out; the others are `covered`."""
    index = np.flatnonzero(kept)
    goes_on = (np.diff(index) == 1) & (np.diff(contacts.pass_index[index]) == 0)
    return replace(
        contacts.take(index),
        pass_index=np.r_[0, np.cumsum(~goes_on)][: len(index)],
        uncut=np.vstack([contacts.uncut, contacts.contacts[~kept]]),
        reasons=(*contacts.reasons, *("covered",) * int((~kept).sum())),
    )


@dataclass(frozen=True, eq=False)
class LevelContacts:
    """The distance to the tessellation of a level, how deep (mm) flutes may go into that, and the contacts of the level
    before any is left out."""

    distance: MeshDistance
    flute_slack: float
    candidates: CandidateContacts


def plan_paths(
    levels: Sequence[Level], stock: Stock, job: Job, limits: MachineLimits, progress: Progress = silent
) -> tuple[ToolPath, ...]:
    """The path of every level in machining order; `limits` are the machine's.

    `levels` begin at the part and end at the stock. Raises JobError where a cutter cannot be used at the
    job's lead angle, ToolPathError or OrientationError (with the level's number) where a level has no path.
    """
    machined = machined_levels(levels)
    cutters = {level.index: cutter_of(level.index, job, limits.bodies) for level in machined}
    for cutter in cutters.values():
        check_lead(cutter, job.path.lead_deg)

    part = distance_to_part(levels, job.path.gouge_tolerance)
    fixture = post_below(part.mesh, job.holding), clamping_of(job.holding, limits.bodies.table)
    planning = _Planning(job, limits, part, *fixture, enclosing_capsule(stock))
    paths = blank_paths(stock, fixture[0], fixture[1], job, limits)
    material = uncut_material(levels, stock)
    bar = bar_of(stock, job.holding)
    if bar is not None:  # with its cusps, which links meet
        rays = uncut_rays(Cylinder(bar.radius, float(stock.bounds[0, 2]), bar.top))
        for path in paths:
            rays = rays.after(path)
        material = replace(material, rays=rays)
    smooth = None
    for level_contacts in _one_ahead(lambda level: planning.contacts(level, cutters[level.index]), machined[::-1]):
        index = level_contacts.candidates.level.index
        report(progress, (len(levels) - 2 - index) / (len(levels) - 1), f"path of level {index}")
        allowed = depth_limits(levels, index, cutters, job)
        level_paths, material, smooth = planning.paths(level_contacts, allowed, material, smooth)
        paths += level_paths
    if job.path.fine_cutter:
        report(progress, 1.0, "path of the fine cutter")
        fine = Cutter.from_job(3, "fine", job.tool("fine"), limits.bodies.nose)
        check_lead(fine, job.path.lead_deg)
        outer = levels[min(2, len(levels) - 1)].limit
        level_contacts = planning.contacts(machined[0], fine)
        step = fine.rest_depth(job.levels.finishing_depth, outer)
        # where the finishing ball has left more than twice its scallop
        scallop = paths[-1].cutter.scallop
        allowed = DepthLimits(job.levels.finishing_depth, scallop, 2 * max(scallop, UNCERTAIN), step)
        fine_paths = planning.paths(level_contacts, allowed, material, smooth, fine=True)[0]
        if any((path.kinds == MoveKind.CUT).any() for path in fine_paths):
            # further rest paths; what is too narrow for the finishing ball is then told of the finer one alone
            *before, last = paths
            kept = np.flatnonzero([reason not in ("gouge", "post") for reason in last.reasons])
            last = replace(last, uncut=last.uncut[kept], reasons=tuple(last.reasons[k] for k in kept))
            done = sum(path.level == last.level for path in before)
            paths = [*before, last]
            paths += [replace(path, rest=done + k, trimmed=0.0) for k, path in enumerate(fine_paths, 1)]
    scene = planning.scene_of(part, flute_slack(job.path.gouge_tolerance), material)
    return *paths, *parting_paths(scene, job, limits)


@dataclass(frozen=True, eq=False)
class _Planning:
    """What the paths of all levels share; `capsule` encloses the stock."""

    job: Job
    limits: MachineLimits
    part: MeshDistance
    post: Post
    clamping: Clamping
    capsule: Capsule

    def contacts(self, level: MachinedLevel, cutter: Cutter) -> LevelContacts:
        """The contacts of a level; its balls stay out of the level and of the part."""
        distance, slack = held_level(level, self.part, self.job.path.gouge_tolerance)
        return LevelContacts(distance, slack, self._candidates(level, distance, cutter, self.job.path))

    def scene_of(self, level: MeshDistance, slack: float, material: InProcessStock) -> Scene:
        """What stands round the tool on a level, into which flutes may go by `slack` mm; beside it the part is measured
        against where it is another."""
        return Scene(
            level=level.mesh,
            material=material.mesh,
            stock=self.capsule,
            post=self.post,
            material_deviation=DEVIATION,
            known_level_distance=level,
            part_distance=None if level is self.part else self.part,
            clamping=self.clamping,
            tangent_slack=slack,
        )

    def paths(
        self,
        level_contacts: LevelContacts,
        allowed: DepthLimits,
        material: InProcessStock,
        before: SmoothAxes | None,
        fine: bool = False,
    ) -> tuple[list[ToolPath], InProcessStock, SmoothAxes | None]:
        """The rest paths of a level and its own one, what stands after them, and the smooth axes of these; `before` are
        those of the level before. Of a `fine` cutter also its own path is one of rests."""
        level = level_contacts.candidates.level
        scene = self.scene_of(level_contacts.distance, level_contacts.flute_slack, material)
        checker = CollisionChecker(scene, level_contacts.candidates.cutter)
        contacts = contact_path(level_contacts.candidates, material, allowed)
        with ThreadPoolExecutor(1) as thread:
            patterns = None
            if too_deep(level_contacts.candidates, material, allowed):
                patterns = thread.submit(self._rest_patterns, level_contacts, allowed.scallop)
            smooth = level_axes(contacts, level, scene, self.limits, self.job.path, before=before)

        def cut(contacts: ContactPath, material: InProcessStock, before: ToolPath | None, own: bool = False) -> Cut:
            def oriented(contacts: ContactPath) -> ToolPath:
                job = self.job
                wanted = smooth.wanted_for(contacts) if smooth is not None else None
                if wanted is not None and (fine or contacts.rest):
                    contacts, wanted = held_axes(contacts, wanted, checker, self.limits, job.path)
                fixed = added_axes(contacts, level.surface, scene, self.limits, job.path)
                return orient(
                    contacts,
                    scene,
                    self.limits,
                    job.path,
                    job.nc,
                    wanted=wanted,
                    fixed=fixed,
                    material=material,
                    explained=own and fixed is None,
                    before=before,
                )

            return cut_within_depth(contacts, material, level, allowed if own else allowed.of_step, oriented)

        rest: list[ToolPath] = []
        if patterns is not None:
            material, rest = _take_rest(patterns.result(), material, allowed, cut, self.limits.turn_speed)
            contacts = contact_path(level_contacts.candidates, material, allowed, allowed.deepest)
        path, after = cut(contacts, material, rest[-1] if rest else None, True)
        return without_returns([*rest, path]), after, smooth

    def _candidates(
        self, level: MachinedLevel, distance: MeshDistance, cutter: Cutter, job: PathJob
    ) -> CandidateContacts:
        """The contacts of a level whatever the material."""
        obstacles = [distance, self.part] if level.index else [self.part]
        speed = self.limits.turn_speed
        kept_off = self.clamping.kept_columns("cutter")
        return candidate_contacts(level, obstacles, cutter, self.post, job, turn_speed=speed, kept_off=kept_off)

    def _rest_patterns(self, level_contacts: LevelContacts, scallop: float) -> list[CandidateContacts]:
        """The contacts of a level as it is cut and on rings. Its own path follows: the passes may leave the `scallop`
        (mm) that this expects of what is cut before, or that of the roughing cutter if that is less."""
        cutter = level_contacts.candidates.cutter
        wide = max(cutter.scallop, min(scallop, self.job.roughing.scallop))
        cutter = replace(cutter, scallop=wide)
        rings = replace(self.job.path, pattern="round")
        return [
            self._candidates(level_contacts.candidates.level, level_contacts.distance, cutter, job)
            for job in (self.job.path, rings)
        ]


def _take_rest(
    patterns: Sequence[CandidateContacts],
    material: InProcessStock,
    allowed: DepthLimits,
    cut: Callable[[ContactPath, InProcessStock, ToolPath | None], Cut],
    turn_speed: float,
) -> tuple[InProcessStock, list[ToolPath]]:
    """The rest paths of a level, whose contacts are given in several patterns, and the material after them."""
    paths: list[ToolPath] = []
    steps = RestMachining(patterns, allowed, turn_speed)
    while (step := steps.contacts(material)) is not None:
        contacts = after_steps(step, material, allowed.of_step)
        if not len(contacts.contacts):
            break
        try:
            path, material = cut(contacts, material, paths[-1] if paths else None)
        except OrientationError:
            # none of these places can be reached: the level's own path leaves them out too, and tells so
            continue
        if not (path.kinds == MoveKind.CUT).any():
            continue  # all of it would be too deep, which the next step takes in part
        paths.append(replace(path, uncut=np.zeros((0, 3)), reasons=()))
    return material, paths


def _one_ahead(
    make: Callable[[MachinedLevel], LevelContacts], levels: Sequence[MachinedLevel]
) -> Iterator[LevelContacts]:
    """`make(level)` of each level in order; a second thread makes the next one while the caller uses this
    one."""
    with ThreadPoolExecutor(1) as thread:
        coming = thread.submit(make, levels[0])
        for level in levels[1:]:
            contacts = coming.result()
            coming = thread.submit(make, level)
            yield contacts
        yield coming.result()
