"""The paths of the parting groove (`planning/stump.py`), and whether a cutter gets all round it, asked before planning.

Before planning the part is known, and of the stock what the finishing ball leaves in the corner at the post
(`foretold_scene`). The paths of the groove are made in that scene as they are behind the last level; where they cannot
be, changes of the job are tried in the same way, and the first that helps is the remedy.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from bonecam.errors import BonecamError, OrientationError
from bonecam.job import HoldingJob, Job, field_error
from bonecam.machine.limits import MachineLimits
from bonecam.material.in_process_stock import DEVIATION
from bonecam.mesh.solids import revolve, segments_around, solid_union
from bonecam.planning.oriented_path import orient
from bonecam.planning.post_length import STAND_OFFS, least_groove, stand_on_post, with_stand_off
from bonecam.planning.scene import Scene
from bonecam.planning.stump import groove_below, groove_core, parting_contacts, parting_cutters
from bonecam.setup.capsule import Capsule, enclosing_capsule
from bonecam.setup.placement import Setup
from bonecam.tool.path import ToolPath
from bonecam.workholding.clamping import clamping_of
from bonecam.workholding.post import Column

NO_GROOVE = "no cutter gets all round the parting groove"
RING = 0.1
"""Rings of what is left at the post are so far apart, mm: half of what its mesh may deviate."""
LONGER = (1.25, 1.5)
"""Overhangs that are tried, as multiples of the job's."""
THICKER = 0.75
"""A thicker bridge that is tried, as a share of the post's diameter."""


def parting_paths(scene: Scene, job: Job, limits: MachineLimits) -> list[ToolPath]:
    """The paths of the parting groove below the finished part, the level of `scene`, whose material is what stands
    then; none where the job wants none. OrientationError where no cutter gets all round."""
    if not job.holding.parting:
        return []
    paths = _all_round(scene, job, limits)
    if paths:
        return paths
    for stand_off in (each for each in STAND_OFFS if each > job.holding.stand_off):
        if _all_round(scene, job.with_values(holding={"parting_stand_off": stand_off}), limits):
            remedy = f"give holding.parting_stand_off = {stand_off:g}, with which one does"
            break
    else:
        remedy = "with a larger holding.parting_stand_off neither: leave out holding.parting"
    raise OrientationError(f"parting: {NO_GROOVE} beside what stands there behind the last level: {remedy}")


def _round_stub(stock: Capsule, stub: Column | None) -> Capsule:
    """A capsule round stock and stub: links on the groove keep out of both, and the stub is wider than the lower end
    of the stock beside it."""
    if stub is None:
        return stock
    radius = max(stock.radius, stub.radius + float(np.hypot(*stock.start[:2])))
    low = np.array([*stock.start[:2], min(stub.top, float(stock.start[2]))])
    return Capsule(low, np.asarray(stock.end), radius)


def _all_round(scene: Scene, job: Job, limits: MachineLimits) -> list[ToolPath]:
    """The paths of the first cutter that gets all round; none where none does."""
    scene = replace(scene, stock=_round_stub(scene.stock, scene.clamping.stub))
    for cutter in parting_cutters(job, limits.bodies):
        groove = groove_below(float(scene.level.bounds[0, 2]), scene.post, job.holding, cutter, scene.material)
        paths = []
        for step in parting_contacts(groove, cutter, job):
            around = replace(scene, core=groove_core(step, scene.post))
            try:
                paths.append(orient(step, around, limits, job.path, job.nc, explained=False))
            except OrientationError:
                break
            if len(paths[-1].uncut):
                break
        else:
            return paths
    return []


def foretold_scene(setup: Setup, job: Job, limits: MachineLimits) -> Scene:
    """The finished part on its post, with what the finishing ball leaves of the stock in the corner at the post."""
    stock = enclosing_capsule(setup.stock)
    corner = setup.post.radius + job.finishing.radius
    bottom = float(stock.start[2]) - stock.radius
    heights = np.arange(bottom + RING, setup.post.top, RING)
    below = np.minimum(heights - float(stock.start[2]), 0.0)
    aside = float(np.hypot(*stock.start[:2]))
    radii = np.minimum(np.sqrt(stock.radius**2 - below**2) + aside, corner)
    part = setup.part.mesh
    left = revolve(radii, heights, (bottom, float(heights[-1]) + RING), segments_around(corner, RING))
    return Scene(
        level=part,
        material=solid_union([part, left]),
        stock=stock,
        post=setup.post,
        material_deviation=DEVIATION,
        clamping=clamping_of(job.holding, limits.bodies.table),
    )


def check_parting(setup: Setup, job: Job, limits: MachineLimits, stated: HoldingJob | None = None) -> None:
    """JobError where the parting groove of a job would come too near to what stands on the table, or no cutter gets all
    round it, with the first change of the job that was tried and helps; `stated` is what the job itself says of its
    holding."""
    if not job.holding.parting:
        return
    trouble = _trouble(setup, job, limits)
    if not trouble:
        return
    stated = stated or job.holding
    tried = []
    for change, changed in _changes(job, stated):
        tried.append(change)
        try:
            if with_stand_off(setup, changed, limits)[1] == np.inf:
                continue  # however high it stands
            other, found = stand_on_post(setup, changed, limits)
            if not _trouble(other, found, limits):
                neck = found.holding.length - found.holding.support_height
                helps = f"give {change}, with which one does on a neck of {neck:g} mm"
                break
        except BonecamError:
            continue
    else:
        helps = f"neither with {', nor with '.join(tried)}: leave out holding.parting"
    field = "parting_stand_off" if stated.parting_stand_off else "parting"
    raise field_error("holding", field, getattr(stated, field), f"{trouble}: {helps}")


def _trouble(setup: Setup, job: Job, limits: MachineLimits) -> str:
    """What is wrong with the groove of a job; empty where a cutter gets all round it."""
    kept = least_groove(clamping_of(job.holding, limits.bodies.table))
    lowest = float(setup.part.mesh.bounds[0, 2])
    grooves = [groove_below(lowest, setup.post, job.holding, cutter) for cutter in parting_cutters(job, limits.bodies)]
    bottom = max(groove.bottom for groove in grooves)
    if bottom < kept:
        return f"the groove ends at z {bottom:.2f}, all is kept off what is below z {kept:.2f}"
    return "" if _all_round(foretold_scene(setup, job, limits), job, limits) else NO_GROOVE


def _changes(job: Job, stated: HoldingJob) -> Iterator[tuple[str, Job]]:
    """Changes of the job in words, and the job with them and with all open that was not `stated`."""
    free = {name: 0.0 for name in ("length", "parting_stand_off") if not getattr(stated, name)}
    job = job.with_values(holding=free)
    given = [name for name in ("parting_stand_off", "length") if name not in free]
    for name in given:
        yield f"holding.{name} = 0", job.with_values(holding={name: 0.0})
    opened = job.with_values(holding=dict.fromkeys(given, 0.0))
    all_open = [f"holding.{name} = 0" for name in given]
    if len(given) > 1:
        yield " and ".join(all_open), opened
    bridge = round(THICKER * job.holding.diameter, 1)
    if job.holding.bridge < bridge:
        yield f"holding.parting_core = {bridge:g}", job.with_values(holding={"parting_core": bridge})
    for more in LONGER:
        for cutter in ("roughing", "finishing"):
            overhang = round(more * job.tool(cutter).overhang, 1)
            what = " and ".join([f"{cutter}.overhang = {overhang:g}", *all_open])
            yield what, opened.with_values(**{cutter: {"overhang": overhang}})
