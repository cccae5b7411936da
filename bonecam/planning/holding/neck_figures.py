"""What a neck leaves uncut, how the part on it bends, yields and swings, and how long the cuts take that it bears.

As a beam, clamped at the top of the chuck, with the finished part on it, a neck holds where

    the error that 95 % of the finished surface keep is foretold to be LARGEST_SHIFT at most,
    the peak of a roughing pass at the middle of the part keeps it below a third of its yield strength, and
    with part or stock on it its lowest frequency is FREQUENCY_MULTIPLE times that of the teeth at least.

Depths of the cuts that a job leaves open are those that this neck bears (`found_depths.py`).

The error that a finished surface keeps, foretold before there are paths.

At a place with the compliance C along its normal, cut by a cutter of compliance c, the error is s F (C + c) t: F is the
force along the normal on an edge in the middle of a finishing strip (`mechanics.strip`), and t how that varies with
tilt, feed and engagement, which has the exponential distribution: on parts that are much stiffer than their cutter half
of the surface keep 0.23 to 0.30 of the error that 95 % keep, 99 % keep 1.4 to 1.6 times that (exponential: 0.23 and
1.54). So the share of the area that keeps more than x is the mean of exp(-x / (s F (C + c))) over the area. What
pushes along the surface moves it little: with the coefficients of titanium, whose edges push along the normal, the
size of the force would foretell half of what is kept.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.optimize import brentq

from bonecam.arrays import unit
from bonecam.errors import JobError
from bonecam.job import Job
from bonecam.job.holding.tailstock_section import NO_TAILSTOCK
from bonecam.job.materials.mechanical import StiffnessTable, cutting_force
from bonecam.job.materials.preset import read_material
from bonecam.machine.limits import MachineLimits
from bonecam.mechanics.beam import Beam
from bonecam.mechanics.cutter import cutter_compliance
from bonecam.mechanics.strip import job_strip_force, job_strip_forces
from bonecam.mesh.facets.vertex_normals import vertex_normals
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.estimate import LayersToCut
from bonecam.planning.holding.finished_beam import finished_beam, normal_compliances
from bonecam.planning.holding.found_depths import PEAK_SHARE, YIELD_SHARE, leaves_depths_open, with_found_depths
from bonecam.planning.holding.post_length import STOCK_CHORD
from bonecam.planning.passes.contacts import at_post
from bonecam.setup.placement import Setup
from bonecam.tool.cutter import Cutter
from bonecam.workholding.post import Post

FORCE_SHARE = 0.225
"""s: on 26 bones of aluminium with scallops of 0.1 mm 95 % of the surface keep 0.72 to 1.4 times what this foretells,
in the mean as much, and 99 % 0.65 to 1.24 times; on one of titanium 1.1 times, on one of PEEK 99 % 1.35 times."""


def foretold_errors(beam: Beam, part: TriangleMesh, tool: float, force: float, shares: Sequence[float]) -> list[float]:
    """The errors (mm) that these shares of the area of a `part` on its `beam` stay below; `tool` is the compliance of
    the cutter (mm/N), `force` that along the normal on an edge in the middle of a finishing strip, N."""
    compliances, areas = normal_compliances(beam, part)
    gives = FORCE_SHARE * force * (np.maximum(compliances, 0.0) + tool)
    weights = areas / areas.sum()

    def beyond(error: float, share: float) -> float:
        return float(weights @ np.exp(-error / gives)) - (1 - share)

    # where all gave way as the softest place does, the error would be that at which the mean is the share itself
    softest = float(gives.max())
    return [float(brentq(beyond, 0.0, -softest * np.log1p(-share), args=(share,))) for share in shares]


LARGEST_SHIFT = 0.016
"""The error that is foretold of 95 % of the surface may be so large, mm: that of a program is then 0.02 at most."""
FREQUENCY_MULTIPLE = 1.5
"""Further from the teeth resonance adds less than 0.8 of the displacement."""
PLACES = np.array([[4, 1, 1], [1, 4, 1], [1, 1, 4], [2, 2, 2]]) / 6
"""Places of a face, as shares of its corners, that stand for a quarter of its area each."""


@dataclass(frozen=True)
class Neck:
    """A neck, with a `tailstock` or none: `diameter` and `length` (mm), height `top` of the stock's lower end over
    the table (mm), area of the part that stays uncut at it (mm2), compliance at the part's top (um/N), the error
    that is foretold of 95 % of the area (`shift_um`) and of 99 % (`shift_p99_um`), stress at the peak of a roughing
    pass (MPa), lowest frequency (Hz), and whether that `holds`; where depths are found, the machining time (min) of
    those that it bears."""

    diameter: float
    length: float
    top: float
    left_mm2: float
    um_per_n: float
    shift_um: float
    stress_mpa: float
    first_hz: float
    shift_p99_um: float
    holds: bool
    tailstock: str = NO_TAILSTOCK
    machining_min: float | None = None

    @property
    def report(self) -> dict[str, Any]:
        """The neck in the report."""
        names = {"diameter": "diameter_mm", "length": "length_mm"}
        rounded = {
            names.get(key, key): round(value, 2)
            for key, value in asdict(self).items()
            if key not in ("top", "tailstock") and value is not None
        }
        return {**rounded, "holds": self.holds, "tailstock": self.tailstock}


@dataclass(frozen=True)
class Wanted:
    """What a neck that holds has: `shift_um` and `stress_mpa` at most, `first_hz` at least."""

    shift_um: float
    stress_mpa: float
    first_hz: float


def wanted_of(job: Job) -> Wanted:
    """What a neck that holds has, with material and cutters of a job."""
    tools = [job.tool(name) for name in job.cutter_names]
    teeth = max(tool.flutes * tool.spindle for tool in tools) / 60
    return Wanted(
        shift_um=1000 * LARGEST_SHIFT,
        stress_mpa=YIELD_SHARE * stiffness_of(job).yield_strength,
        first_hz=FREQUENCY_MULTIPLE * teeth,
    )


def neck_figures(standing: Setup, job: Job, limits: MachineLimits, layers: LayersToCut) -> Neck:
    """How the neck of a job holds the part of a setup that stands on it; `layers` are what is to be cut."""
    holding = job.holding
    part = standing.part.mesh
    stiffness = stiffness_of(job)
    beam = finished_beam(part, standing.post, holding, stiffness)
    uncut = finished_beam(standing.stock.mesh(STOCK_CHORD), standing.post, holding, stiffness)
    minutes = None
    if leaves_depths_open(job, neck_found=True):
        job = with_found_depths(standing, job, limits)
        minutes = layers.minutes(job)

    # The force (N) on an edge at the middle of the deepest strip of the roughing cutter, and that along the normal of
    # the finishing cutter's
    material = read_material(job.material.name)
    force = cutting_force(material.force, stiffness_of(job).yield_strength)
    _, normal, _ = job_strip_forces(force, job, "finishing")
    rough = job_strip_force(force, job, "roughing")
    fine = float(normal)

    middle = part.bounds.mean(axis=0)[None]
    tip = np.array([[0.0, 0.0, float(part.bounds[1, 2])]])
    stress = float(beam.moment_stress(PEAK_SHARE * rough * np.array([[1.0, 0.0, 0.0]]), middle)[0])
    cutter = Cutter.from_job(2, "finishing", job.tool("finishing"), limits.bodies.nose)
    shift, worst = foretold_errors(beam, part, cutter_compliance(cutter), fine, (0.95, 0.99))
    first = min(each.first_frequency(stiffness.density) for each in (beam, uncut))
    wanted = wanted_of(job)
    return Neck(
        diameter=holding.diameter,
        length=holding.length - holding.support_height,
        top=holding.length,
        left_mm2=_left(part, standing.post, job.tool("finishing").radius),
        um_per_n=1000 * float(np.linalg.norm(beam.compliance(tip)[0, :2, :2], 2)),
        shift_um=1000 * shift,
        stress_mpa=stress,
        first_hz=first,
        shift_p99_um=1000 * worst,
        holds=1000 * shift <= wanted.shift_um and stress <= wanted.stress_mpa and first >= wanted.first_hz,
        tailstock=holding.tailstock,
        machining_min=minutes,
    )


def _left(part: TriangleMesh, post: Post, radius: float) -> float:
    """Area of the part (mm2) that a ball of `radius` leaves at the post."""
    normals: Float[ndarray, "v 3"] = vertex_normals(part)
    held = np.zeros(len(part.faces))
    for share in PLACES:
        points = np.einsum("k,fkd->fd", share, part.vertices[part.faces])
        held += at_post(points, unit(np.einsum("k,fkd->fd", share, normals[part.faces])), post, radius)
    return float((np.linalg.norm(part.face_vectors, axis=1) / 2 * held).sum() / len(PLACES))


def stiffness_of(job: Job) -> StiffnessTable:
    """How stiff and strong the material of a job is; JobError where its file does not tell."""
    stiffness = read_material(job.material.name).stiffness
    if stiffness is None:
        what = f"[material] name = {job.material.name!r}: its file has no table [stiffness], which finds the neck"
        raise JobError(
            f"{what}: give elasticity, density and yield_strength there, or holding.diameter",
            section="material",
            field="name",
        )
    return stiffness
