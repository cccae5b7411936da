"""The neck between stub and part, found by stiffness: the thinnest that bends, yields and swings little enough.

Of necks of some diameters each has the shortest length with which all is reached. As a beam, clamped at the top of
the chuck, with the finished part on it, a neck holds where

    the force of a finishing pass moves 95 % of the part's area along its normal by 15 um at most,
    the peak of a roughing pass at the middle of the part keeps it below a third of its yield strength, and
    the lowest frequency is three times that of the teeth at least.

The thinnest that holds is taken, since what stays uncut round it grows with it; where none does, the stiffest.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import unit
from bonecam.errors import BonecamError, JobError
from bonecam.job import Job, field_error
from bonecam.job.holding.tailstock_section import NO_TAILSTOCK, PIN
from bonecam.job.materials.mechanical import StiffnessTable, cutting_force
from bonecam.job.materials.preset import read_material
from bonecam.machine.limits import MachineLimits
from bonecam.mechanics.strip import job_strip_force
from bonecam.mesh.facets.vertex_normals import vertex_normals
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.holding.finished_beam import finished_beam, normal_compliance
from bonecam.planning.holding.post_length import (
    STOCK_CHORD,
    find_post_length,
    level_lifts,
    parting_lift,
    sampled_lifts,
    shortest_post,
)
from bonecam.planning.passes.contacts import at_post
from bonecam.setup.placement import Setup
from bonecam.workholding.bar import settled_stub
from bonecam.workholding.clamping import clamping_of
from bonecam.workholding.post import NECKS, Post, post_below
from bonecam.workholding.tailstock import settled_bracket, settled_height

FINISHING_SHARE = 0.33
"""Force of a finishing pass while a tooth passes, as a share of `strip_force`: 95 % of the moves of the phalanx stay
below (5.6 N), and of two bones with scallops of 0.1 mm (15 and 17 N)."""
PEAK_SHARE = 0.9
"""Peak of a roughing pass, likewise: 60 N at a depth of 0.5 mm, 120 and 126 N at 1 mm."""
LARGEST_SHIFT = 0.015
"""The finishing pass may move the part by so much, mm. Of 20 um that 95 % of a finished surface may be off the cutter
takes 5 to 9."""
YIELD_SHARE = 1 / 3
TOOTH_MULTIPLE = 3.0
FEWER_CONTACTS = 400
"""So many contacts are sampled for each neck: the length of the one that is taken is found with all."""
PLACES = np.array([[4, 1, 1], [1, 4, 1], [1, 1, 4], [2, 2, 2]]) / 6
"""Places of a face, as shares of its corners, that stand for a quarter of its area each."""
SHOWN = 3
"""Necks that are reported."""


@dataclass(frozen=True)
class Neck:
    """A neck, with a `tailstock` or none: `diameter` and `length` (mm), height `top` of the stock's lower end over
    the table (mm), area of the part that stays uncut at it (mm2), compliance at the part's top (um/N), what a
    finishing pass moves 95 % of the area (um, at most), stress at the peak of a roughing pass (MPa), lowest
    frequency (Hz), and whether that `holds`."""

    diameter: float
    length: float
    top: float
    left_mm2: float
    um_per_n: float
    shift_um: float
    stress_mpa: float
    first_hz: float
    holds: bool
    tailstock: str = NO_TAILSTOCK

    @property
    def report(self) -> dict[str, Any]:
        """The neck in the report."""
        names = {"diameter": "diameter_mm", "length": "length_mm"}
        rounded = {
            names.get(key, key): round(value, 2)
            for key, value in asdict(self).items()
            if key not in ("top", "tailstock")
        }
        return {**rounded, "holds": self.holds, "tailstock": self.tailstock}


def find_standing(setup: Setup, job: Job, limits: MachineLimits) -> tuple[Setup, Job, tuple[Neck, ...]]:
    """Setup and job with the stub, neck, length and height of a tailstock that the job leaves open; and the best of
    the necks that were tried, the one that is taken first, if any were."""
    job = replace(job, holding=settled_stub(job.holding, setup.stock.diameter))
    necks: tuple[Neck, ...] = ()
    if not job.holding.diameter:
        setup, job, necks = find_neck(setup, job, limits)
    if not job.holding.length:
        setup, job = find_post_length(setup, job, limits)
    places = setup.stock.mesh(STOCK_CHORD).vertices
    job = replace(job, holding=settled_height(job.holding, setup.post.pin, places))
    if not necks:
        return setup, job, ()
    # with all contacts the neck that is taken may be longer than when it was tried
    taken = _neck(setup, job, limits)
    return setup, job, (taken, *necks[1:], *_pinned(taken, setup, job, limits))


def _pinned(taken: Neck, setup: Setup, job: Job, limits: MachineLimits) -> tuple[Neck, ...]:
    """The neck that is taken with a pin at the free end, where it gives way without and the table has room for it."""
    if taken.holds or job.holding.has_tailstock:
        return ()
    part = setup.part.mesh
    try:
        holding = settled_bracket(replace(job.holding, tailstock=PIN), part, limits.bodies.table)
        pinned = replace(setup, post=post_below(part, holding))
    except JobError:
        return ()
    return (_neck(pinned, replace(job, holding=holding), limits),)


def find_neck(setup: Setup, job: Job, limits: MachineLimits) -> tuple[Setup, Job, tuple[Neck, ...]]:
    """Setup and job with the neck that is found, its length still open unless the job gives it, and the best necks of
    those tried, that one first. JobError where no neck is thinner than stub and stock or meets the part."""
    width = float(np.ptp(setup.stock.bounds[:, :2], axis=0).min())
    thickest = min(width, job.holding.stub_diameter or width)
    asked, trouble = [], None
    for diameter in (neck for neck in NECKS if neck < thickest):
        holding = replace(job.holding, diameter=diameter)
        try:
            post = post_below(setup.part.mesh, holding)
            asked.append((replace(setup, post=post), replace(job, holding=holding)))
        except BonecamError as error:
            trouble = error
    # what gives way at its least length does so at any: its reach is asked last, if at all
    hopeful = [_holds_shortest(*one, limits) for one in asked]
    order = sorted(range(len(asked)), key=lambda k: (not hopeful[k], k if hopeful[k] else -k))
    tried: list[Neck] = []
    for one in (asked[k] for k in order):
        if len(tried) >= SHOWN and any(neck.holds for neck in tried):
            break
        try:
            tried.append(_neck(*one, limits))
        except BonecamError as error:
            trouble = error
    if not tried and trouble is not None:
        raise trouble
    if not tried:
        bound = f"the stock is {width:.2f} mm wide, necks from {NECKS[0]:g} mm are tried: give one, or a larger stock"
        raise field_error("holding", "diameter", 0.0, bound)
    ranked = ranking(tried)
    holding = replace(job.holding, diameter=ranked[0].diameter)
    post = post_below(setup.part.mesh, holding)
    return replace(setup, post=post), replace(job, holding=holding), tuple(ranked[:SHOWN])


def _holds_shortest(setup: Setup, job: Job, limits: MachineLimits) -> bool:
    """Whether the neck of a job's diameter holds the part at the least length that it may have."""
    holding = job.holding
    least = holding.length or shortest_post(np.zeros(0), 0.0, clamping_of(holding, limits.bodies.table))
    return _neck(setup, replace(job, holding=replace(holding, length=least)), limits).holds


def ranking(necks: Sequence[Neck]) -> list[Neck]:
    """Necks that hold, the thinnest first, then the others, the stiffest first."""
    return sorted(necks, key=lambda neck: (not neck.holds, neck.diameter if neck.holds else neck.shift_um))


def neck_report(necks: Sequence[Neck]) -> dict[str, Any]:
    """`necks` of the report's section `post`, where a neck was found."""
    return {"necks": [neck.report for neck in necks]} if necks else {}


def _neck(setup: Setup, job: Job, limits: MachineLimits) -> Neck:
    """The neck of a job's diameter, as long as is needed, and how it holds the part of a setup."""
    holding = job.holding
    clamping = clamping_of(holding, limits.bodies.table)
    height = float(setup.stock.bounds[0, 2])
    top = holding.length
    if not top:
        lifts = np.r_[
            sampled_lifts(setup, job, limits, FEWER_CONTACTS),
            level_lifts(setup, job, limits.bodies),
            parting_lift(setup, job, limits),
        ]
        top = shortest_post(lifts, height, clamping)
    standing = setup.lift(top - height)
    beam = finished_beam(standing.part.mesh, standing.post, holding, _stiffness(job))
    strong = _stiffness(job).yield_strength
    rough, fine = _strip_forces(job)

    part = standing.part.mesh
    middle = part.bounds.mean(axis=0)[None]
    tip = np.array([[0.0, 0.0, float(part.bounds[1, 2])]])
    stress = float(beam.moment_stress(PEAK_SHARE * rough * np.array([[1.0, 0.0, 0.0]]), middle)[0])
    shift = FINISHING_SHARE * fine * normal_compliance(beam, part)
    first = beam.first_frequency(_stiffness(job).density)
    teeth = job.mechanics.flutes * max(job.tool(name).spindle for name in job.cutter_names) / 60
    holds = shift <= LARGEST_SHIFT and stress <= strong * YIELD_SHARE and first >= TOOTH_MULTIPLE * teeth
    return Neck(
        diameter=holding.diameter,
        length=top - holding.support_height,
        top=top,
        left_mm2=_left(part, standing.post, job.tool("finishing").radius),
        um_per_n=1000 * float(np.linalg.norm(beam.compliance(tip)[0, :2, :2], 2)),
        shift_um=1000 * shift,
        stress_mpa=stress,
        first_hz=first,
        holds=holds,
        tailstock=holding.tailstock,
    )


def _left(part: TriangleMesh, post: Post, radius: float) -> float:
    """Area of the part (mm2) that a ball of `radius` leaves at the post."""
    normals: Float[ndarray, "v 3"] = vertex_normals(part)
    held = np.zeros(len(part.faces))
    for share in PLACES:
        places = np.einsum("k,fkd->fd", share, part.vertices[part.faces])
        held += at_post(places, unit(np.einsum("k,fkd->fd", share, normals[part.faces])), post, radius)
    return float((np.linalg.norm(part.face_vectors, axis=1) / 2 * held).sum() / len(PLACES))


def _stiffness(job: Job) -> StiffnessTable:
    """How stiff and strong the material of a job is; JobError where its file does not tell."""
    found = read_material(job.material.name).stiffness
    if found is None:
        what = f"[material] name = {job.material.name!r}: its file has no table [stiffness], which finds the neck"
        raise JobError(
            f"{what}: give elasticity, density and yield_strength there, or holding.diameter",
            section="material",
            field="name",
        )
    return found


def _strip_forces(job: Job) -> tuple[float, float]:
    """Force (N) on an edge at the middle of the deepest strip of the roughing and of the finishing cutter."""
    material = read_material(job.material.name)
    force = cutting_force(material.force, _stiffness(job).yield_strength)
    return job_strip_force(force, job, "roughing"), job_strip_force(force, job, "finishing")
