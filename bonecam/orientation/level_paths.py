"""The tool paths of all levels of a morph in machining order: from the level next to the stock down to the
part.

Each level needs the material that the level before it left, so the levels follow one another; what does not
depend on that material (the contacts of the next level) is made in a second thread meanwhile.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from bonecam.errors import OrientationError
from bonecam.job import Job, PathJob
from bonecam.levels.measure.level import Level, MachinedLevel, machined_levels, morph_surfaces
from bonecam.mesh.distance import MeshDistance
from bonecam.orientation.axes.lead import check_lead
from bonecam.orientation.collision.scene import Scene
from bonecam.orientation.cones.admissible_cones import admissible_cones
from bonecam.orientation.field.axis_field import FieldDomain
from bonecam.orientation.field.smooth_axes import SmoothAxes, smooth_axes
from bonecam.orientation.limits import AxisLimits
from bonecam.orientation.oriented_path import orient
from bonecam.progress import Progress, report, silent
from bonecam.setup.capsule import enclosing_capsule
from bonecam.setup.fixture.clamping import clamping_of
from bonecam.setup.fixture.table import MachineBodies
from bonecam.setup.holding import Post, post_below
from bonecam.setup.stock import Stock
from bonecam.toolpath.contacts import CandidateContacts, candidate_contacts, contact_path
from bonecam.toolpath.cutters.cutter import Cutter
from bonecam.toolpath.engagement.material import DEVIATION, Material, remove_material, uncut_material
from bonecam.toolpath.engagement.stretches import Allowed
from bonecam.toolpath.gouge import MESH_SHARE, planned_tolerance
from bonecam.toolpath.path import ContactPath, ToolPath
from bonecam.toolpath.rest import rest_contacts, too_deep

PART_CHORD = 0.002
"""Largest chord tolerance (mm) of the tessellated part that balls are kept out of: MESH_SHARE of the gouge
tolerance by default."""
LEVEL_CHORD = 0.01
"""Chord tolerance (mm) of the other tessellated levels: a ball that enters one of them leaves the part
alone."""

SMOOTH_SHARE = 0.15
"""Scallops of the last roughing cut are no higher than this share of the depth of a finishing cut."""


@dataclass(frozen=True, eq=False)
class LevelContacts:
    """A level, the distance to its tessellation, and its contacts before any is left out."""

    level: MachinedLevel
    distance: MeshDistance
    candidates: CandidateContacts


def plan_paths(
    levels: Sequence[Level],
    stock: Stock,
    job: Job,
    limits: AxisLimits,
    bodies: MachineBodies,
    progress: Progress = silent,
) -> tuple[ToolPath, ...]:
    """The path of every level in machining order; `limits` are those of the machine's tool axis, its `bodies` are
    kept clear of.

    `levels` begin at the part and end at the stock. Raises JobError where a cutter cannot be used at the
    job's lead angle, ToolPathError or OrientationError (with the level's number) where a level has no path.
    """
    cutters = {level.index: _cutter_of(level.index, job, bodies) for level in machined_levels(levels)}
    for cutter in cutters.values():
        check_lead(cutter, job.path.lead_deg)

    part = _distance_to_part(levels, job.path)
    post = post_below(part.mesh, job.holding)

    def contacts_of(level: MachinedLevel) -> LevelContacts:
        return _contacts_of(level, part, cutters[level.index], post, job.path, limits.turn_speed)

    clamping = clamping_of(job.holding, bodies.table)
    capsule = enclosing_capsule(stock)
    material = uncut_material(levels, stock)
    paths: list[ToolPath] = []
    smooth: SmoothAxes | None = None
    for found in _one_ahead(contacts_of, machined_levels(levels)[::-1]):
        level = found.level
        report(progress, (len(levels) - 2 - level.index) / (len(levels) - 1), f"path of level {level.index}")
        around = (post, DEVIATION, found.distance, part if level.index else None, clamping)
        scene = Scene(found.distance.mesh, material.mesh, capsule, *around)
        allowed = _allowed(levels, level.index, cutters, job)
        contacts = contact_path(found.candidates, material, allowed)
        smooth = _smooth(contacts, level, scene, limits, job.path, smooth)
        oriented = partial(_oriented, scene=scene, limits=limits, job=job, smooth=smooth)
        rings = partial(_rings, found, part, post, job)
        material, rest = _take_rest(found, material, allowed, oriented, rings)
        path = oriented(contact_path(found.candidates, material, allowed) if rest else contacts, material)
        material = remove_material(material, level, path)
        paths += [*rest, path]
    return tuple(paths)


def _oriented(
    contacts: ContactPath,
    material: Material,
    scene: Scene,
    limits: AxisLimits,
    job: Job,
    smooth: SmoothAxes | None,
) -> ToolPath:
    """The tool path of contacts, its axes taken from the smooth ones where there are any."""
    wanted = smooth.wanted_for(contacts) if smooth is not None else None
    return orient(contacts, scene, limits, job.path, job.nc, wanted, material=material)


def _rings(found: LevelContacts, part: MeshDistance, post: Post, job: Job) -> CandidateContacts:
    """The contacts of a level on rings."""
    obstacles = [found.distance, part] if found.level.index else [part]
    rings = replace(job.path, pattern="round")
    return candidate_contacts(found.level, obstacles, found.candidates.cutter, post, rings)


def _take_rest(
    found: LevelContacts,
    material: Material,
    allowed: Allowed,
    oriented: Callable[[ContactPath, Material], ToolPath],
    rings: Callable[[], CandidateContacts],
) -> tuple[Material, list[ToolPath]]:
    """The rest paths of a level, and the material after them."""
    paths: list[ToolPath] = []
    if not too_deep(found.candidates, material, allowed):
        return material, paths
    for contacts in rest_contacts([found.candidates, rings()], material, allowed):
        try:
            path = oriented(contacts, material)
        except OrientationError:
            # none of these places can be reached: the level's own path leaves them out too, and tells so
            continue
        material = remove_material(material, found.level, path)
        paths.append(replace(path, uncut=np.zeros((0, 3)), reasons=()))
    return material, paths


def _cutter_of(level: int, job: Job, bodies: MachineBodies) -> Cutter:
    """The cutter of a level. The last roughing cut leaves a smoother surface, for the first finishing one."""
    if job.is_finishing(level):
        return Cutter.from_job(2, "finishing", job.tool("finishing"), bodies.nose)
    cutter = Cutter.from_job(1, "roughing", job.tool("roughing"), bodies.nose)
    if level and job.is_finishing(level - 1):
        return replace(cutter, scallop=min(cutter.scallop, SMOOTH_SHARE * job.levels.finishing_depth))
    return cutter


def _distance_to_part(levels: Sequence[Level], job: PathJob) -> MeshDistance:
    """Distances to the part, tessellated as finely as the gouge tolerance asks for."""
    chord = min(PART_CHORD, MESH_SHARE * planned_tolerance(job.gouge_tolerance))
    return MeshDistance(morph_surfaces(levels)[0].tessellate(chord))


def _smooth(
    contacts: ContactPath,
    level: MachinedLevel,
    scene: Scene,
    limits: AxisLimits,
    job: PathJob,
    before: SmoothAxes | None,
) -> SmoothAxes | None:
    """Smooth axes of a level in cones of free ones, from the field of the level `before`; None where the job wants
    none."""
    if job.orientation != "cones" or not len(contacts.contacts):
        return before
    cones = admissible_cones(contacts, scene, limits, job)
    start = before.field if before else None
    return smooth_axes(cones, FieldDomain.of(level.surface), limits, job, "membrane", start)


def _allowed(levels: Sequence[Level], level: int, cutters: Mapping[int, Cutter], job: Job) -> Allowed:
    """The depths of the cut that leaves a level. Too thin a cut is left only to a roughing one."""
    before = cutters.get(level + 1)
    to_roughing = level > 0 and not job.is_finishing(level) and not job.is_finishing(level - 1)
    return Allowed(
        levels[level + 1].limit,
        before.scallop if before else 0.0,
        job.path.least_depth if to_roughing else 0.0,
    )


def _contacts_of(
    level: MachinedLevel, part: MeshDistance, cutter: Cutter, post: Post, job: PathJob, turn_speed: float
) -> LevelContacts:
    """The contacts of a level; its balls stay out of the level and of the part."""
    distance = MeshDistance(level.surface.tessellate(LEVEL_CHORD)) if level.index else part
    obstacles = [distance, part] if level.index else [part]
    found = candidate_contacts(level, obstacles, cutter, post, job, turn_speed=turn_speed)
    return LevelContacts(level, distance, found)


def _one_ahead(
    make: Callable[[MachinedLevel], LevelContacts], levels: Sequence[MachinedLevel]
) -> Iterator[LevelContacts]:
    """`make(level)` of each level in order; a second thread makes the next one while the caller uses this
    one."""
    with ThreadPoolExecutor(1) as thread:
        coming = thread.submit(make, levels[0])
        for level in levels[1:]:
            made = coming.result()
            coming = thread.submit(make, level)
            yield made
        yield coming.result()
