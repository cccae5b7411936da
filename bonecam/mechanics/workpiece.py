"""What is cut, as far as force and bending go: its material, and what holds it."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from bonecam.errors import JobError
from bonecam.job import HoldingJob, Job, MechanicsJob
from bonecam.job.materials.mechanical import CuttingForce, StiffnessTable, cutting_force
from bonecam.job.materials.preset import read_material
from bonecam.kernels.removal.rays import RaySet
from bonecam.material.rays import RayGrid
from bonecam.mechanics.beam import Beam, Support
from bonecam.mechanics.sections import column_sections, join, mesh_sections, ray_sections, shoulder
from bonecam.mechanics.strip import lighter_cuts
from bonecam.mechanics.tailstock import tailstock_support
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.workholding.clamping import Clamping
from bonecam.workholding.column import Column
from bonecam.workholding.post import Post
from bonecam.workholding.shell import held_below


@dataclass(frozen=True, eq=False)
class Standing:
    """What stands while a program runs: the `sets` of rays of a `grid`, up to the height `top` at most, in a stock of
    this `width`, mm."""

    sets: Sequence[RaySet]
    grid: RayGrid
    top: float
    width: float = np.inf


@dataclass(frozen=True, eq=False)
class Workpiece:
    """A material with its `stiffness` and the `force` that cuts it, on a `post`, that on the `stub` of the bar if there
    is one, held rigidly below the height `clamped`, mm; and the `limits` of a job. Above the post stands the `body`,
    or, if there is none, all that rays tell of. Without a post this is held itself, as in the shell of a second
    clamping. `lighter` are finishing cuts in words, with the share of the force that they take. A `support` holds the
    free end, if there is one, and `holding` is the job's, where a tailstock may be offered."""

    material: str
    stiffness: StiffnessTable
    force: CuttingForce
    post: Post | None
    clamped: float
    stub: Column | None = None
    limits: MechanicsJob = field(default_factory=MechanicsJob)
    body: TriangleMesh | None = None
    lighter: tuple[tuple[str, float], ...] = ()
    support: Support | None = None
    holding: HoldingJob | None = None

    def beam(self, standing: Standing) -> Beam:
        """What stands as a beam, with the shoulders of the post: at its top against what is a diameter above that, and
        at its foot against the stub."""
        sets, grid = standing.sets, standing.grid
        if self.post is None:
            return Beam(ray_sections(sets, grid, self.clamped, standing.top), self.stiffness.elasticity)
        diameter = 2 * self.post.radius
        foot = self.stub.top if self.stub else self.clamped
        if self.body is None:
            upper = ray_sections(sets, grid, foot, standing.top)
            neck = upper.between(foot, self.post.top)
            above = upper.between(self.post.top, standing.top)
        else:
            neck = column_sections(self.post.radius, foot, self.post.top)
            above = mesh_sections(self.body, self.post.top)
        wider = 2 * np.sqrt(float(np.interp(self.post.top + diameter, above.z, above.area)) / np.pi)
        pieces = [neck, shoulder(diameter, self.post.top, max(wider, diameter)), above]
        if self.stub:
            lower = ray_sections(sets, grid, self.clamped, foot)
            pieces = [lower, shoulder(diameter, foot, 2 * self.stub.radius), *pieces]
        return Beam(join(pieces), self.stiffness.elasticity, support=self.support)


def workpiece_of(job: Job, post: Post, clamping: Clamping) -> Workpiece:
    """The workpiece of a job on its post in a clamping; JobError where nothing is known of its stiffness."""
    stiffness, force = mechanics_of_job(job)
    clamped = max((column.top for column in clamping.columns), default=0.0)
    return Workpiece(
        material=job.material.name,
        stiffness=stiffness,
        force=force,
        post=post,
        clamped=max(clamped, 0.0),
        stub=clamping.stub,
        limits=job.mechanics,
        lighter=lighter_cuts(force, job),
        support=tailstock_support(job.holding, post.pin, stiffness.elasticity),
        holding=job.holding,
    )


def stump_workpiece(job: Job, part: TriangleMesh, shell: TriangleMesh) -> Workpiece:
    """The workpiece of a second clamping: a turned part whose shell holds it; JobError as in `workpiece_of`."""
    stiffness, force = mechanics_of_job(job)
    return Workpiece(
        material=job.material.name,
        stiffness=stiffness,
        force=force,
        post=None,
        clamped=held_below(part, shell),
        limits=job.mechanics,
        lighter=lighter_cuts(force, job),
    )


def mechanics_of_job(job: Job) -> tuple[StiffnessTable, CuttingForce]:
    """How stiff the material of a job is and what force cuts it; JobError where its file does not say how stiff."""
    material = read_material(job.material.name)
    if material.stiffness is None:
        raise JobError(
            f"[material] name = {job.material.name!r}: its file has no table [stiffness], so bending is not known: "
            "give elasticity, density and yield_strength there, or --no-mechanics",
            section="material",
            field="name",
        )
    return material.stiffness, cutting_force(material.force, material.stiffness.yield_strength)
