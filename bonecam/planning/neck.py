"""The finished part or its stock as a beam, before anything is cut: on neck and stub, and under a tailstock.

Depths of the cuts that a job leaves open: the fewest that ball, neck and part bear.

The cut onto the part takes `levels.finishing_depth`. Each one outside it takes as much as these allow:

    the ball sinks in by half of its radius at most, where its edge meets material over 60 degrees;
    the peak of the force at the middle of the part keeps the neck below a third of its yield strength;
    the peak bends part and cutter by no more than what the cuts inside it still take off: so none cuts into the part.

So cuts are deep where much stands under them, and thin at the end. Before a roughing cut the roughing cutter leaves
scallops of `levels.scallop_share` (0: SCALLOP_SHARE) of its depth, or `roughing.scallop` where that is more. A
neck is found with its depths: a weak one has shallower cuts.

What a neck leaves uncut, how the part on it bends, yields and swings, and how long the cuts take that it bears.

As a beam, clamped at the top of the chuck, with the finished part on it, a neck holds where

    the error that 95 % of the finished surface keep is foretold to be LARGEST_SHIFT at most,
    the peak of a roughing pass at the middle of the part keeps it below a third of its yield strength, and
    with part or stock on it its lowest frequency is FREQUENCY_MULTIPLE times that of the teeth at least.

Depths of the cuts that a job leaves open are those that this neck bears.

The error that a finished surface keeps, foretold before there are paths.

At a place with the compliance C along its normal, cut by a cutter of compliance c, the error is s F (C + c) t: F is the
force along the normal on an edge in the middle of a finishing strip (`mechanics.strip`), and t how that varies with
tilt, feed and engagement, which has the exponential distribution: on parts that are much stiffer than their cutter half
of the surface keep 0.23 to 0.30 of the error that 95 % keep, 99 % keep 1.4 to 1.6 times that (exponential: 0.23 and
1.54). So the share of the area that keeps more than x is the mean of exp(-x / (s F (C + c))) over the area. What
pushes along the surface moves it little: with the coefficients of titanium, whose edges push along the normal, the
size of the force would foretell half of what is kept.

The neck between stub and part, found by stiffness together with the depths of the cuts that it bears.

Of necks of some diameters each has the shortest length with which all is reached, and, where a job leaves them open,
the fewest and deepest cuts that it bears. Of those that hold the thinnest is taken with which
machining takes no more than MOST_MINUTES of the time of the quickest, since what stays uncut round a neck grows with
it; where none holds, the stiffest.

What would make a neck hold that gives way, and what the report tells of the necks that were tried.

Tried are a pin at the free end, shallower finishing cuts with lower scallops, stiffer finishing cutters of the same
ball, slower spindles where part and stock swing too near to the teeth; pin, cuts and spindles together where nothing
alone is enough.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.optimize import brentq

from bonecam.arrays import unit
from bonecam.errors import BonecamError, JobError
from bonecam.job import HoldingJob, Job, field_error
from bonecam.job.holding_section import NO_TAILSTOCK
from bonecam.job.materials.preset import StiffnessTable, cutting_force, read_material
from bonecam.job.tool_list import known_cutters
from bonecam.levels.closed_morph import method_of
from bonecam.machine.limits import MachineLimits
from bonecam.mechanics.beam import Beam, Sections, column_sections, join, mesh_sections, shoulder, tailstock_support
from bonecam.mechanics.edges import cutter_compliance, job_strip_force, job_strip_forces, lighter_jobs
from bonecam.mechanics.loads import mechanics_of_job
from bonecam.mesh.facets import vertex_normals
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.contacts import at_post
from bonecam.planning.estimate import LayersToCut
from bonecam.planning.post_length import (
    STOCK_CHORD,
    least_neck,
    level_lifts,
    sampled_lifts,
    shortest_post,
    stand_on_post,
    with_groove,
)
from bonecam.setup.placement import Setup
from bonecam.tool.cutter import Cutter
from bonecam.workholding.clamping import clamping_of
from bonecam.workholding.post import NECKS, Post, post_below, settled_bracket, settled_height, settled_stub, with_pin

SHARE = 95.0
"""Compliance is told of this share of the area, in percent."""


def finished_beam(body: TriangleMesh, post: Post, holding: HoldingJob, stiffness: StiffnessTable) -> Beam:
    """The finished part, or whatever `body` is made of it, on its neck and stub as a beam that the chuck, or else the
    table, holds rigidly, and a tailstock at its free end."""
    diameter = 2 * post.radius
    foot = max(holding.chuck_height, holding.riser_height)
    pieces: list[Sections] = []
    if holding.stub_length:
        pieces.append(column_sections(holding.stub_diameter / 2, foot, holding.support_height))
        pieces.append(shoulder(diameter, holding.support_height, holding.stub_diameter))
    above = mesh_sections(body, post.top)
    wide = 2 * float(np.sqrt(np.interp(post.top + diameter, above.z, above.area) / np.pi))
    pieces.append(column_sections(post.radius, holding.support_height, post.top))
    pieces += [shoulder(diameter, post.top, max(wide, diameter)), above]
    support = tailstock_support(holding, post.pin, stiffness.elasticity)
    return Beam(join(pieces), stiffness.elasticity, support=support)


def normal_compliance(beam: Beam, part: TriangleMesh) -> float:
    """Compliance (mm/N) along the normal that SHARE of the part's area does not exceed."""
    compliances, areas = normal_compliances(beam, part)
    order = np.argsort(compliances)
    below = np.cumsum(areas[order]) / areas.sum()
    return float(compliances[order][np.searchsorted(below, SHARE / 100)])


def normal_compliances(beam: Beam, part: TriangleMesh) -> tuple[Float[ndarray, " f"], Float[ndarray, " f"]]:
    """Compliance along the normal (mm/N) and twice the area (mm2) of each face of the part."""
    middles = part.vertices[part.faces].mean(axis=1)
    vectors = part.face_vectors
    areas = np.linalg.norm(vectors, axis=1)
    normals = vectors / np.maximum(areas, np.finfo(float).tiny)[:, None]
    return np.einsum("ni,nij,nj->n", normals, beam.compliance(middles), normals), areas


PEAK_SHARE = 0.9
"""Peak force of a roughing pass, as a share of `strip_force`: 60 N at a depth of 0.5 mm, 120 and 126 N at 1 mm."""
YIELD_SHARE = 1 / 3
"""Of the yield strength, which the stress at that peak may reach."""
BALL_SHARE = 0.5
"""A roughing ball sinks in by this share of its radius at most."""
SCALLOP_SHARE = 0.2
"""`levels.scallop_share` of depths that are found where a job states none: programs are a tenth shorter than with 0.1,
with the same error, and their deepest cuts go through a scallop of 0.12 mm where that went through one of 0.07."""
R10 = (1.0, 1.25, 1.6, 2.0, 2.5, 3.15, 4.0, 5.0, 6.3, 8.0)
"""The preferred numbers of a decade (ISO 3): depths that are tried, mm, and their decimal multiples."""


def leaves_depths_open(job: Job, *, neck_found: bool) -> bool:
    """Whether depths are to be found: where the job asks for it, or, on levels whose limits hold and not in the
    published pattern, states none and it is known how its neck holds, found or stated (`neck_found`)."""
    if job.levels.found or not (neck_found and job.levels.automatic):
        return job.levels.found
    path, method = job.path, method_of(job.levels.method)
    return path.strategy == "morph" and path.pattern != "published" and math.isfinite(method.accepted)


def with_found_depths(setup: Setup, job: Job, limits: MachineLimits) -> Job:
    """The job with the depths of its cuts that its holding bears; JobError where nothing is known of the stiffness of
    its material."""
    stiffness, force = mechanics_of_job(job)
    part = setup.part.mesh
    beam = finished_beam(part, setup.post, job.holding, stiffness)
    stress = float(beam.moment_stress(np.array([[1.0, 0.0, 0.0]]), part.bounds.mean(axis=0)[None])[0])
    cutter = Cutter.from_job(1, "roughing", job.tool("roughing"), limits.bodies.nose)
    give = normal_compliance(beam, part) + cutter_compliance(cutter)
    strongest = YIELD_SHARE * stiffness.yield_strength

    finishing = job.levels.finishing_depth
    tried = preferred_depths(finishing, BALL_SHARE * cutter.radius)
    peaks = {depth: PEAK_SHARE * job_strip_force(force, _with_depths(job, [depth]), "roughing") for depth in tried}

    def bears(depth: float, under: float) -> bool:
        """Whether a roughing cut may take a depth (mm) where `under` mm more stand on the part."""
        return peaks[depth] * give <= under and peaks[depth] * stress <= strongest

    return _with_depths(job, found_depths(finishing, tried, setup.stock.diameter, bears))


def depths_report(job: Job) -> dict[str, Any]:
    """`depths_found` in the report's section `post`: the depths (mm) of the cuts of a job that were found."""
    return {"depths_found": list(job.levels.listed)}


def _with_depths(job: Job, depths: Sequence[float]) -> Job:
    """The job with these depths (mm) of its cuts, and the scallops that go with them."""
    stated = " ".join(f"{depth:g}" for depth in depths)
    share = job.levels.scallop_share or SCALLOP_SHARE
    return job.with_values(levels={"depths": stated, "scallop_share": share})


def preferred_depths(above: float, most: float) -> list[float]:
    """The depths (mm) that are tried, rising: beyond `above`, `most` at most, itself included."""
    decades = range(math.floor(math.log10(above)), math.ceil(math.log10(most)) + 1)
    depths = [round(10.0**decade * step, 6) for decade in decades for step in R10]
    return [depth for depth in depths if above < depth < most] + [most] * (most > above)


def found_depths(
    finishing: float, tried: Sequence[float], enough: float, bears: Callable[[float, float], bool]
) -> tuple[float, ...]:
    """The depths (mm) from the part outwards, the last for all others: `finishing`, then each time the largest of those
    `tried`, which rise, that is no shallower than the one before and that the holding `bears` (depth, what stands
    under it), or as much as before; until the largest of all is reached, or `enough`."""
    depths = [finishing]
    while sum(depths) < enough and tried and depths[-1] < tried[-1]:
        borne = [depth for depth in tried if depth > depths[-1] and bears(depth, sum(depths))]
        depths.append(max(borne, default=depths[-1]))
    while len(depths) > 1 and depths[-2] == depths[-1]:
        depths.pop()
    return tuple(depths)


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


def wanted_of(job: Job) -> dict[str, float]:
    """What a neck that holds has, with material and cutters of a job: `shift_um` and `stress_mpa` at most, `first_hz`
    at least."""
    tools = [job.tool(name) for name in job.cutter_names]
    teeth = max(tool.flutes * tool.spindle for tool in tools) / 60
    return {
        "shift_um": 1000 * LARGEST_SHIFT,
        "stress_mpa": YIELD_SHARE * stiffness_of(job).yield_strength,
        "first_hz": FREQUENCY_MULTIPLE * teeth,
    }


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
    force = cutting_force(read_material(job.material.name).force, stiffness.yield_strength)
    _, fine, _ = job_strip_forces(force, job, "finishing")
    rough = job_strip_force(force, job, "roughing")

    middle = part.bounds.mean(axis=0)[None]
    tip = np.array([[0.0, 0.0, float(part.bounds[1, 2])]])
    stress = float(beam.moment_stress(PEAK_SHARE * rough * np.array([[1.0, 0.0, 0.0]]), middle)[0])
    cutter = Cutter.from_job(2, "finishing", job.tool("finishing"), limits.bodies.nose)
    shift, worst = foretold_errors(beam, part, cutter_compliance(cutter), float(fine), (0.95, 0.99))
    first = min(each.first_frequency(stiffness.density) for each in (beam, uncut))
    wanted = wanted_of(job)
    holds = 1000 * shift <= wanted["shift_um"] and stress <= wanted["stress_mpa"] and first >= wanted["first_hz"]
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
        holds=holds,
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


MOST_MINUTES = 1.2
"""A thinner neck may take so many times the machining time of the quickest that holds."""
WIDER = (12.0, 16.0, 20.0)
WIDE_SHARE = 0.45
"""Necks (mm) that are tried beside NECKS where they are at most this share of the stock's width: on a thinner one a
block of 50 mm swings at a third of the frequency of the teeth."""
FEWER_CONTACTS = 400
"""So many contacts are sampled for each neck: the length of the one that is taken is found with all."""
SHOWN = 3
"""Necks that are reported."""


def find_standing(setup: Setup, job: Job, limits: MachineLimits) -> tuple[Setup, Job, tuple[Neck, ...]]:
    """Setup and job with the stub, neck, length and height of a tailstock that the job leaves open; and the best of
    the necks that were tried, the one that is taken first: that of the job alone where it states one. None where
    nothing is known of how stiff its material is."""
    job = replace(job, holding=settled_stub(job.holding, setup.stock.diameter))
    necks: tuple[Neck, ...] = ()
    layers = LayersToCut.between(setup.part.mesh, setup.stock.mesh(STOCK_CHORD))
    if not job.holding.diameter:
        # Setup and job with the first of the best necks that holds at its length, and the best necks, that one first:
        # with all contacts a neck may be longer than when it was tried, and give way. Where all do, the stiffest.
        tried = find_necks(setup, job, limits, layers)
        stood: list[tuple[Setup, Job, Neck]] = []
        for neck in [one for one in tried if one.holds] or tried[:1]:
            holding = replace(job.holding, diameter=neck.diameter)
            on_neck = replace(setup, post=post_below(setup.part.mesh, holding)), replace(job, holding=holding)
            on_neck = stand_on_post(*on_neck, limits)
            stood.append((*on_neck, _neck(*on_neck, limits, layers)))
            if stood[-1][-1].holds:
                break
        stood.sort(key=lambda one: (not one[-1].holds, one[-1].shift_um))
        again = {neck.diameter for *_, neck in stood}
        others = ranking([neck for *_, neck in stood[1:]] + [one for one in tried if one.diameter not in again])
        setup, job, taken = stood[0]
        necks = (taken, *others[: SHOWN - 1])
    else:
        setup, job = stand_on_post(setup, job, limits)
        if read_material(job.material.name).stiffness is not None:
            necks = (neck_figures(setup, job, limits, layers),)
    vertices = setup.stock.mesh(STOCK_CHORD).vertices
    job = replace(job, holding=settled_height(job.holding, setup.post.pin, vertices))
    return setup, job, necks


def find_necks(setup: Setup, job: Job, limits: MachineLimits, layers: LayersToCut) -> list[Neck]:
    """The necks that were tried, ranked; `layers` are what is to be cut. JobError where no neck is thinner than stub
    and stock or meets the part."""
    width = float(np.ptp(setup.stock.bounds[:, :2], axis=0).min())
    asked = []
    trouble = None
    for diameter in neck_diameters(width, job):
        holding = replace(job.holding, diameter=diameter)
        try:
            post = post_below(setup.part.mesh, holding)
            asked.append((replace(setup, post=post), replace(job, holding=holding)))
        except BonecamError as error:
            trouble = error
    # what gives way at its least length does so at any: its reach is asked last, if at all; two have to hold, as the
    # thicker tells whether cuts on the thinner take long
    hopeful = [shortest_neck(*one, limits, layers).holds for one in asked]
    order = sorted(range(len(asked)), key=lambda k: (not hopeful[k], k if hopeful[k] else -k))
    tried: list[Neck] = []
    for one in (asked[k] for k in order):
        if len(tried) >= SHOWN and sum(neck.holds for neck in tried) > 1:
            break
        try:
            tried.append(_neck(*one, limits, layers))
        except BonecamError as error:
            trouble = error
    if not tried and trouble is not None:
        raise trouble
    if not tried:
        bound = f"the stock is {width:.2f} mm wide, necks from {NECKS[0]:g} mm are tried: give one, or a larger stock"
        raise field_error("holding", "diameter", 0.0, bound)
    return ranking(tried)


def neck_diameters(width: float, job: Job) -> list[float]:
    """The diameters (mm) of the necks that are tried below a stock of a `width`, mm: that of the job if it has one."""
    if job.holding.diameter:
        return [job.holding.diameter]
    thickest = min(width, job.holding.stub_diameter or width)
    wider = (neck for neck in WIDER if neck <= WIDE_SHARE * width)
    return [neck for neck in (*NECKS, *wider) if neck < thickest]


def shortest_neck(setup: Setup, job: Job, limits: MachineLimits, layers: LayersToCut) -> Neck:
    """The neck of a job's diameter, of the least length that it may have, and how it holds the part of a setup."""
    holding = job.holding
    clamping = clamping_of(holding, limits.bodies.table)
    least = holding.length or shortest_post(np.zeros(0), 0.0, clamping, least_neck(job))
    return _neck(setup, replace(job, holding=replace(holding, length=least)), limits, layers)


def ranking(necks: Sequence[Neck]) -> list[Neck]:
    """Necks that hold, the thinnest first, but those last with which machining takes more than MOST_MINUTES times that
    of the quickest; then the others, the stiffest first."""
    minutes = [neck.machining_min for neck in necks if neck.holds and neck.machining_min is not None]
    most = MOST_MINUTES * min(minutes, default=np.inf)

    def order(neck: Neck) -> tuple[bool, bool, float]:
        if not neck.holds:
            return True, False, neck.shift_um
        return False, neck.machining_min is not None and neck.machining_min > most, neck.diameter

    return sorted(necks, key=order)


def _neck(setup: Setup, job: Job, limits: MachineLimits, layers: LayersToCut) -> Neck:
    """The neck of a job's diameter, as long as is needed, and how it holds the part of a setup."""
    height = float(setup.stock.bounds[0, 2])
    top = job.holding.length
    if not top:
        lifts = np.r_[sampled_lifts(setup, job, limits, FEWER_CONTACTS), level_lifts(setup, job, limits.bodies)]
        job, top = with_groove(setup, job, limits, lifts)
    standing = replace(job, holding=replace(job.holding, length=top))
    return neck_figures(setup.lift(top - height), standing, limits, layers)


STEP = 100.0
"""Spindle speeds that are told are multiples of this, 1/min."""


@dataclass(frozen=True)
class NeckRemedy:
    """A change of the job in words, and the neck that is taken, with it."""

    change: str
    neck: Neck


def neck_remedies(setup: Setup, job: Job, limits: MachineLimits, taken: Neck) -> tuple[NeckRemedy, ...]:
    """The changes with which the neck of a job holds that is `taken` and gives way; where none alone is enough, the
    first few together that are, or what comes nearest. None where the neck holds."""
    if taken.holds:
        return ()
    layers = LayersToCut.between(setup.part.mesh, setup.stock.mesh(STOCK_CHORD))

    def figures(change: str, one: Setup, changed: Job) -> NeckRemedy:
        return NeckRemedy(change, neck_figures(one, changed, limits, layers))

    pinned = _pinned(setup, job, limits)
    tried = [figures(*pinned)] if pinned else []
    for change, lighter in lighter_jobs(job):
        tried.append(figures(change, setup, lighter))
        if tried[-1].neck.holds:
            break
    for change, stiffer in _stiffer(job, limits):
        tried.append(figures(change, setup, stiffer))
        if tried[-1].neck.holds:
            break
    tried += [figures(change, setup, slower) for change, slower in _slower(job, taken)]
    enough = tuple(one for one in tried if one.neck.holds)
    if enough:
        return enough
    standings = [("", setup, job), *([pinned] if pinned else [])]
    for before, one, asked in standings:
        for change, lighter in lighter_jobs(asked):
            both = figures(f"{before} and {change}" if before else change, one, lighter)
            slow = [figures(f"{both.change} and {what}", one, slower) for what, slower in _slower(lighter, both.neck)]
            for remedy in (both, *slow):
                if remedy.neck.holds:
                    return (remedy,)
                tried.append(remedy)
    return tuple(sorted(tried, key=lambda one: one.neck.shift_um)[:1])


def _stiffer(job: Job, limits: MachineLimits) -> Iterator[tuple[str, Job]]:
    """The job with finishing cutters that are known by name, of its ball and stiffer than its own, and these in words,
    the stiffest last. Their scallop, speed and feed stay those of the job."""

    def compliance(one: Job) -> float:
        return cutter_compliance(Cutter.from_job(2, "finishing", one.tool("finishing"), limits.bodies.nose))

    found = list[tuple[float, str, Job]]()
    for listed in known_cutters(job.nc.tools):
        if (listed.tool.shape, listed.tool.radius) == ("ball", job.finishing.radius):
            other = replace(job, finishing=listed.in_section(job.finishing))
            found.append((compliance(other), f'finishing.preset = "{listed.name}"', other))
    own = compliance(job)
    for gives, change, other in sorted(found, key=lambda one: -one[0]):
        if gives < own:
            yield change, other


def _slower(job: Job, taken: Neck) -> Iterator[tuple[str, Job]]:
    """The job whose teeth pass as slowly as a neck asks, and its spindles in words; none where they do."""
    if taken.first_hz >= wanted_of(job)["first_hz"]:
        return
    edges = 60 * taken.first_hz / FREQUENCY_MULTIPLE  # a minute
    tools = {name: job.tool(name) for name in job.cutter_names}
    slower = {
        name: {"spindle": float(np.floor(edges / tool.flutes / STEP)) * STEP}
        for name, tool in tools.items()
        if tool.flutes * tool.spindle > edges
    }
    try:
        yield (
            " and ".join(f"{name}.spindle = {value['spindle']:g}" for name, value in slower.items()),
            job.with_values(**slower),
        )
    except JobError:  # slower than a spindle turns
        return


def _pinned(setup: Setup, job: Job, limits: MachineLimits) -> tuple[str, Setup, Job] | None:
    """A pin at the free end in words, and setup and job with it; None where a tailstock is there, or the table has no
    room for it."""
    given = with_pin(job.holding)
    if given is None:
        return None
    change, holding = given
    part = setup.part.mesh
    try:
        holding = settled_bracket(holding, part, limits.bodies.table)
        return change, replace(setup, post=post_below(part, holding)), replace(job, holding=holding)
    except JobError:
        return None


def neck_report(necks: Sequence[Neck], remedies: Sequence[NeckRemedy], job: Job, *, stated: bool) -> dict[str, Any]:
    """`necks` of the report's section `post`, and whether the one that is taken was `stated`; where it gives way what
    is wanted of it and with what it `holds_with`. Nothing where no neck was judged."""
    if not necks:
        return {}
    told: dict[str, Any] = {"neck_stated": stated, "necks": [neck.report for neck in necks]}
    if necks[0].holds:
        return told
    helps = [{"change": one.change, **one.neck.report} for one in remedies]
    return told | {"neck_wanted": wanted_of(job), "holds_with": helps}
