"""The removal of the program that a job was posted as."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from bonecam.errors import VerifyError, knowing
from bonecam.job import Job
from bonecam.levels.measure.level import Level, morph_surfaces
from bonecam.machine.machine import Machine
from bonecam.mechanics.workpiece import stump_workpiece, workpiece_of
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.nc.dialect import Dialect
from bonecam.nc.posting.rotary.machine_limits import machine_limits
from bonecam.nc.reading.read import read_program
from bonecam.planning.layers.layer_limits import layer_limits
from bonecam.planning.passes.contacts import at_post
from bonecam.progress import Progress, silent
from bonecam.setup.stock import Stock
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import PARTING
from bonecam.verify.gouge import Gouge
from bonecam.verify.removal.clearances.table import shell_clearance
from bonecam.verify.removal.given import GivenSurface, measure_given
from bonecam.verify.removal.groups import groups_of
from bonecam.verify.removal.left import beside_limits
from bonecam.verify.removal.result import Removal
from bonecam.verify.removal.simulate import simulate_further, simulate_removal
from bonecam.verify.removal.sweeping import Accuracy, SimulatedStock
from bonecam.verify.removal.verdicts import check_removal
from bonecam.workholding.clamping import clamping_of
from bonecam.workholding.post import Post, post_below

ACCURACY = Accuracy(cell=0.1, coarser=True)
"""Of the simulation in `convert`. Against cells of 0.05 mm the phalanx's depths change by 0.01 mm, its clearances by
0.003 mm, leftovers and gouges not at all, in half of the time."""


def cutters_of(job: Job, machine: Machine) -> list[Cutter]:
    """The cutters of a job in the machine's spindle."""
    return [
        Cutter.from_job(number, name, job.tool(name), machine.bodies.nose)
        for number, name in enumerate(job.cutter_names, 1)
    ]


def depth_limits(job: Job, levels: Sequence[Level]) -> dict[int, float]:
    """The largest depth (mm) of the cut on each level, or on each layer of a strategy in layers, and of PARTING."""
    parting = {PARTING: job.levels.layer_depth}
    if job.path.strategy == "morph":
        return parting | {index: levels[index + 1].limit for index in range(len(levels) - 1)}
    return parting | layer_limits(job)


def level_scallops(job: Job, levels: int) -> dict[int, float]:
    """The scallop (mm) that the path of each of so many levels may leave; none of layers, which leave those of their
    cutters."""
    return {index: job.scallop(index) for index in range(levels)} if job.path.strategy == "morph" else {}


def followed_surfaces(job: Job, meshes: Mapping[int, TriangleMesh]) -> dict[int, TriangleMesh]:
    """The mesh of each level that a path follows; of layers, which follow no level, that of the part. `meshes` are
    those of all levels by number."""
    if job.path.strategy == "morph":
        return {index: mesh for index, mesh in meshes.items() if index < max(meshes)}
    return dict.fromkeys(layer_limits(job), meshes[0])


def removal_of_job(
    text: str,
    machine: Machine,
    dialect: Dialect,
    job: Job,
    stock: Stock,
    levels: Sequence[Level],
    progress: Progress = silent,
    given: GivenSurface | None = None,
    *,
    mechanics: bool = True,
) -> Removal:
    """What the posted `text` of a job removes from its stock; `levels` are those it cuts, `given` is the part as it was
    given. Without `mechanics` force and bending are left out. Errors as in `simulate_removal`; what a program may not
    do is told, not refused.
    """
    post = post_below(levels[0].mesh, job.holding)
    clamping = clamping_of(job.holding, machine.table)
    removal = simulate_removal(
        text,
        machine,
        dialect=dialect,
        stock=stock,
        post=post,
        cutters=cutters_of(job, machine),
        clamping=clamping,
        part=morph_surfaces(levels)[0],
        limits=depth_limits(job, levels),
        scallops=level_scallops(job, len(levels)),
        surfaces=followed_surfaces(job, {level.index: level.mesh for level in levels}),
        accuracy=ACCURACY,
        workpiece=workpiece_of(job, post, clamping) if mechanics else None,
        progress=progress,
    )
    removal = with_limits(removal, machine, job)
    return removal if given is None else beside_given(removal, given, post, job)


def with_limits(removal: Removal, machine: Machine, job: Job) -> Removal:
    """The removal with what it leaves where no tool axis of the machine is within path.max_tilt_deg of the normal."""
    probes = removal.remaining.normal_probes
    assert probes is not None
    assert removal.left is not None
    tilt = float(np.radians(job.path.max_tilt_deg))
    return replace(removal, left=beside_limits(removal.left, probes, machine_limits(machine), tilt))


def prove_removal(
    text: str,
    machine: Machine,
    dialect: Dialect,
    job: Job,
    stock: Stock,
    levels: Sequence[Level],
    progress: Progress = silent,
    given: GivenSurface | None = None,
    *,
    mechanics: bool = True,
) -> Removal:
    """What `removal_of_job` tells; errors as in `check_removal` too, where that is not what a program may do."""
    removal = removal_of_job(
        text,
        machine,
        dialect=dialect,
        job=job,
        stock=stock,
        levels=levels,
        progress=progress,
        given=given,
        mechanics=mechanics,
    )
    with knowing(removal.sections):
        check_removal_of_job(removal, job)
    return removal


def beside_given(
    removal: Removal, given: GivenSurface, post: Post | None, job: Job, ball: Gouge | None = None
) -> Removal:
    """The removal with what it leaves beside the part as it was `given`, which stands on this `post`; `ball` is where
    one goes deepest into that, if it was measured."""
    normal_probes = removal.remaining.normal_probes
    assert normal_probes is not None
    held = np.zeros(len(normal_probes.points), dtype=bool)
    if post is not None:
        held = at_post(normal_probes.points, normal_probes.normals, post, job.smallest_ball)
    return replace(removal, given=measure_given(normal_probes, held, given, ball))


def simulate_stump(
    text: str,
    machine: Machine,
    dialect: Dialect,
    job: Job,
    material: SimulatedStock,
    part: TriangleMesh,
    shell: TriangleMesh,
    progress: Progress = silent,
    *,
    mechanics: bool = True,
) -> Removal:
    """What the `text` of a second clamping removes from the `material` that the first program left, which it changes,
    what stands on the turned `part`, and how near it comes to the `shell`; the job's [holding] is that of the shell.

    Errors as in `simulate_removal`; force and bending are left out without `mechanics`.
    """
    motions = read_program(text, machine, dialect)

    # The largest depth (mm) of the cut on each layer of a second clamping's program: that of the cutter, as its
    # `text` and its `motions` tell
    depths = {"roughing": job.levels.layer_depth, "finishing": job.levels.finishing_depth}
    limit_of = {number: depths[name] for number, name in enumerate(job.cutter_names, 1) if name in depths}
    groups = groups_of(text, motions, dialect)
    limits = {group.level: limit_of[group.tool] for group in groups if group.level is not None}

    cutters = cutters_of(job, machine)
    removal = simulate_further(
        text,
        machine,
        dialect=dialect,
        material=material,
        post=None,
        cutters=cutters,
        clamping=clamping_of(job.holding, machine.table),
        limits=limits,
        surfaces=dict.fromkeys(limits, part),
        workpiece=stump_workpiece(job, part, shell) if mechanics else None,
        progress=progress,
    )
    return replace(removal, shell=shell_clearance(motions, cutters, shell))


def check_removal_of_job(removal: Removal, job: Job, deviation: float = 0.0, *, assumed: bool = False) -> None:
    """VerifyError as in `check_removal`, with the tolerance and the bridge of a job, and where the text does not part
    though the job wants it. Slices and sections of the part promise no depth: what they leave between them is told.
    A second clamping keeps the depths of its cutters, and parts nothing. What bends more than the job allows is refused
    too, if that was asked. Where the part is the solid under a surface, that lies up to a `deviation` (mm) over it;
    `assumed` as in `Mechanics.check`."""
    if removal.shell is not None:
        check_removal(removal, job.path.gouge_tolerance)
    else:
        if job.holding.parting and removal.bridge is None:
            raise VerifyError(
                "[holding] parting = true: no section of the program parts the post: give the whole program, or "
                "parting = false"
            )
        limited = job.path.strategy == "morph"
        check_removal(removal, job.path.gouge_tolerance + deviation, job.holding.bridge, limited=limited)
    if removal.mechanics is not None:
        removal.mechanics.check(assumed=assumed)
