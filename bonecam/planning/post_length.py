"""The shortest post with which every contact can be reached, found before the levels are made.

Contacts are sampled on the part (finishing cutter) and on the stock (roughing cutter), between which all levels
lie. Of a contact, each direction of a fixed set that is within the machine's limits and the largest tilt needs a post
of a length that is known in closed form: its lowest rim has to keep the clearance over the table, and what is over a
chuck has to keep it from that. The first direction by that length along which the tool is free of material and
post is the contact's; the longest of these lengths is the post's. Levels in between, and links, may still need more.

How much higher a part must stand for a tool to keep clear of the table and of what holds it, in closed form.

What would shorten a post: other parameters, and the post's length with each; and what a shorter post costs.

The lengths are those that `post_length.py` finds for the job with one parameter changed. Where the post is cut
shorter instead, the contacts that need more of it stay uncut: all of them lie round the post.

The post below a surface that is machined alone: the piece of the solids that it carries, and how thick it is.

What a tailstock keeps the tool from: its bracket stands beside the part, in the way of holder and spindle.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from bonecam.arrays import unit
from bonecam.errors import OrientationError
from bonecam.job import HoldingJob, Job, field_error
from bonecam.job.holding_section import MILLED, NO_TAILSTOCK, STAND_OFF
from bonecam.kernels.distances import highest_over
from bonecam.machine.bodies import MachineBodies
from bonecam.machine.limits import MachineLimits
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.solids import half_edges
from bonecam.mesh.triangle_mesh import TriangleMesh, keep_faces
from bonecam.planning.axes.lead import LEAVING, ROOM, directions_within
from bonecam.planning.collision import CollisionChecker
from bonecam.planning.scene import Scene
from bonecam.planning.stump import groove_below, groove_core, parting_contacts, parting_cutters
from bonecam.setup.capsule import enclosing_capsule
from bonecam.setup.placement import Setup
from bonecam.surface.tspline import TSpline
from bonecam.tool.cutter import Cutter
from bonecam.workholding.clamping import LEAST_NECK, Clamping, clamping_of
from bonecam.workholding.post import bracket, in_collet, refuse_tailstock, thickest_below

SLICE = 4.0
"""Length of the slices in which a tool is held over a chuck, mm."""


def needed_lifts(
    centres: Float[ndarray, "n 3"], directions: Float[ndarray, "d 3"], cutter: Cutter, clamping: Clamping
) -> Float[ndarray, "n d"]:
    """How much higher (mm) each ball centre must be for a tool in each direction to keep the clearance above the
    table's plane, and above columns (chuck, what stands on the table) where it is over them, while it leaves the
    contact along its axis too (LEAVING).

    The tool is taken in slices no longer than SLICE: each is over a column if its widest disc is.
    """
    across = np.hypot(directions[:, 0], directions[:, 1])
    sunk = LEAVING * np.maximum(-directions[:, 2], 0.0)
    discs = []
    for section in cutter.profile:
        count = int(np.ceil((section.end - section.start) / SLICE)) + 1
        for u in np.linspace(section.start, section.end, count):
            discs.append((float(u) - cutter.radius, section.widest, section.name))
    rims = [radius * across - height * directions[:, 2] for height, radius, _ in discs]
    above_table = clamping.clearance + ROOM + (sunk + np.max(rims, axis=0))
    offsets, squares, above = [], [], []
    for column in clamping.solids:
        for height, radius, name in discs:
            room = clamping.room(column, name) + ROOM
            offsets.append(height)
            squares.append((column.radius + room + radius) ** 2)
            above.append(room + column.top + radius * across + sunk - height * directions[:, 2])
    if not above:
        return above_table - centres[:, 2:]
    heights = np.array(above).T
    order = np.argsort(-heights, axis=1)
    falling = np.take_along_axis(heights, order, axis=1)
    discs_over = np.array(offsets)[order], np.array(squares)[order], falling
    return highest_over(centres, directions, *discs_over, above_table) - centres[:, 2:]


SPACING = 0.5
"""One contact is sampled in every cube of this side, mm; of larger parts in larger ones."""
MOST_CONTACTS = 5000
"""About so many contacts are sampled on a mesh at most: their directions take 30 MB."""
STOCK_CHORD = 0.05
"""Chord tolerance of the stock's mesh, mm."""
FEW_CONTACTS = 300
"""So many tell that none is reached."""
BETWEEN_DIRECTIONS = 2.0
"""A post this much shorter than every sampled contact needs may do for another one, mm: contacts are sampled, and
directions 8 degrees apart."""
BATCH = 8
"""Directions that are tested for a contact at once."""
LONGEST = 500.0
"""Longest post of a job, mm."""
ROUND = 24
"""Contacts round the parting groove that are sampled."""
STAND_OFFS = (STAND_OFF, 1.5, 2.0, 3.0, 4.0, 6.0)
"""Stand-offs of the parting groove that are tried where the job leaves it open, mm."""
LEVEL_TURNS = 24
"""Level directions that a level tool is tried in."""
GOUGE = 0.02
"""A ball that would enter the surface by more (mm) is no contact."""


@dataclass(frozen=True, eq=False)
class SampledContacts:
    """Ball centres and normals of contacts, and the checks of their cutter, to which only material and post are
    known."""

    checker: CollisionChecker
    centres: Float[ndarray, "n 3"]
    normals: Float[ndarray, "n 3"]


def find_post_length(setup: Setup, job: Job, limits: MachineLimits) -> tuple[Setup, Job]:
    """Setup and job with the shortest post, in whole mm, with which all sampled contacts are reached; `limits` are
    the machine's."""
    height = float(setup.stock.bounds[0, 2])
    lifts = np.r_[sampled_lifts(setup, job, limits), level_lifts(setup, job, limits.bodies)]
    job, length = with_groove(setup, job, limits, lifts)
    return setup.lift(length - height), replace(job, holding=replace(job.holding, length=length))


def stand_on_post(setup: Setup, job: Job, limits: MachineLimits) -> tuple[Setup, Job]:
    """Setup and job with the length of the post and the stand-off of the parting groove that the job leaves open."""
    if not job.holding.length:
        return find_post_length(setup, job, limits)
    return setup, with_stand_off(setup, job, limits)[0]


def check_reached(setup: Setup, job: Job, limits: MachineLimits) -> None:
    """OrientationError where a post of given length is so short that no sampled contact on the part, or none on the
    stock, can be reached."""
    clamping = clamping_of(job.holding, limits.bodies.table)
    for sampled in _sampled(setup, job, limits.bodies, FEW_CONTACTS):
        lifts = least_lifts(sampled, clamping, job, limits)
        least = float(lifts.min(initial=np.inf))
        if len(lifts) and least > BETWEEN_DIRECTIONS:
            length = job.holding.length
            cutter = sampled.checker.cutter.name
            what = f"[holding] length = {length:g}: no contact of the {cutter} cutter has a free tool axis"
            remedy = "take a longer overhang or a slimmer holder"
            if np.isfinite(least):
                needed = f"the first one {np.ceil(length + least):g} mm, most of them more"
                remedy = f"give length = 0, which finds the shortest that reaches all ({needed}), or a longer overhang"
            raise OrientationError(f"{what}: {remedy}", length=length)


def parting_lift(setup: Setup, job: Job, limits: MachineLimits) -> float:
    """How much higher (mm; lower where negative) the part would have to stand for a cutter to get all round in the
    parting groove; infinite where none does, however high, and -infinite where no groove is wanted."""
    if not job.holding.parting:
        return -np.inf
    clamping = clamping_of(job.holding, limits.bodies.table)
    mesh, depth = setup.part.mesh, job.levels.finishing_depth
    lifts = []
    for cutter in parting_cutters(job, limits.bodies):
        groove = groove_below(float(mesh.bounds[0, 2]), setup.post, job.holding, cutter)
        *_, contacts = parting_contacts(groove, cutter, job)
        scene = replace(_scene_of(mesh, setup, job, depth), core=groove_core(contacts, setup.post))
        some = np.linspace(0, len(contacts.normals) - 1, ROUND).astype(np.int64)
        sampled = SampledContacts(CollisionChecker(scene, cutter), contacts.centres[some], contacts.normals[some])
        lifts.append(max(least_lifts(sampled, clamping, job, limits).max(), least_groove(clamping) - groove.bottom))
    return float(min(lifts))


def least_groove(clamping: Clamping) -> float:
    """The least height (mm) of the bottom of a parting groove over what the cutter is kept off."""
    below = clamping.below
    return max((column.top for column in below.kept_columns("cutter")), default=below.clearance)


def with_stand_off(setup: Setup, job: Job, limits: MachineLimits, spare: float = 0.0) -> tuple[Job, float]:
    """The job with the stand-off of its parting groove, and the `parting_lift` with it. Where the job leaves it open it
    is the least of STAND_OFFS for which the part has to be lifted by `spare` mm at most, or else by the least."""
    if not job.holding.parting or job.holding.parting_stand_off:
        return job, parting_lift(setup, job, limits)
    tried: list[tuple[Job, float]] = []
    for stand_off in STAND_OFFS:
        with_it = job.with_values(holding={"parting_stand_off": stand_off})
        tried.append((with_it, parting_lift(setup, with_it, limits)))
        if tried[-1][1] <= spare:
            break
    return min(tried, key=lambda one: max(one[1], spare))


def with_groove(setup: Setup, job: Job, limits: MachineLimits, lifts: Float[ndarray, " n"]) -> tuple[Job, float]:
    """The job with the stand-off of its parting groove, and the length of the shortest post on which that and all
    contacts of these `lifts` (mm) are reached."""
    height = float(setup.stock.bounds[0, 2])
    clamping = clamping_of(job.holding, limits.bodies.table)
    length = shortest_post(lifts, height, clamping, least_neck(job))
    job, lift = with_stand_off(setup, job, limits, length - height)
    return job, shortest_post(np.r_[lifts, lift], height, clamping, least_neck(job))


def least_neck(job: Job) -> float:
    """The least length (mm) of a neck on a stub: room for a turning tool, or for the finer ball that mills it."""
    if job.holding.neck != MILLED:
        return LEAST_NECK
    return max(LEAST_NECK, 2 * min(job.roughing.radius, job.finishing.radius))


def shortest_post(lifts: Float[ndarray, " n"], height: float, clamping: Clamping, neck: float = LEAST_NECK) -> float:
    """The length, in whole mm, of a post by which all contacts are reached that can be; `lifts` (mm) are those of
    contacts on a part whose lowest point is at the `height`, `neck` (mm) is the least that it stands over a stub."""
    standing = max((column.top for column in clamping.columns), default=0.0) + clamping.clearance
    if clamping.stub is not None:
        standing = max(standing, clamping.stub.top + neck)
    if (lifts == np.inf).any() and not np.isfinite(lifts).any():
        what = "[holding] length = 0: no contact has a free tool axis, however long the post is"
        raise OrientationError(f"{what}: take a longer overhang or a slimmer holder")
    reached = lifts[np.isfinite(lifts)].max(initial=-height)
    length = float(np.ceil(max(height + reached, standing, 1.0)))
    if length > LONGEST:
        needed = f"the part needs a post of {length:g} mm, at most {LONGEST:g} can be given"
        remedy = "take slimmer or longer holders, a lower chuck, or another machine"
        raise OrientationError(f"[holding] length = 0: {needed}: {remedy}", length=length)
    return length


def sampled_lifts(setup: Setup, job: Job, limits: MachineLimits, most: int = MOST_CONTACTS) -> Float[ndarray, " n"]:
    """How much higher (mm; lower where negative) the part would have to stand for each of about `most` sampled contacts
    on part and stock each to be reached; infinite where it is not, however high."""
    clamping = clamping_of(job.holding, limits.bodies.table)
    sampled = _sampled(setup, job, limits.bodies, most)
    return np.concatenate([least_lifts(each, clamping, job, limits) for each in sampled])


def level_lifts(setup: Setup, job: Job, bodies: MachineBodies) -> Float[ndarray, " n"]:
    """As `sampled_lifts`, for a tool that is level, whatever else is against it; none but for strategies that lay it
    so."""
    if job.path.strategy == "morph":
        return np.zeros(0)
    clamping = clamping_of(job.holding, bodies.table)
    turns = 2 * np.pi * np.arange(LEVEL_TURNS) / LEVEL_TURNS
    level = np.column_stack([np.cos(turns), np.sin(turns), np.zeros(LEVEL_TURNS)])
    least = np.cos(np.radians(job.path.max_tilt_deg))
    lifts = []
    for contacts in _sampled(setup, job, bodies):
        needed = needed_lifts(contacts.centres, level, contacts.checker.cutter, clamping)
        lifts.append(needed[contacts.normals @ level.T >= least])
    return np.concatenate(lifts)


def sampled_lifts_of_part(
    setup: Setup, job: Job, limits: MachineLimits, most: int = MOST_CONTACTS
) -> Float[ndarray, " n"]:
    """As `sampled_lifts`, of contacts on the part alone."""
    on_part, _ = _sampled(setup, job, limits.bodies, most)
    return least_lifts(on_part, clamping_of(job.holding, limits.bodies.table), job, limits)


def _sampled(setup: Setup, job: Job, bodies: MachineBodies, most: int = MOST_CONTACTS) -> list[SampledContacts]:
    """Contacts of the finishing cutter on the part, and of the roughing cutter on the stock."""
    finishing = Cutter.from_job(2, "finishing", job.tool("finishing"), bodies.nose)
    roughing = Cutter.from_job(1, "roughing", job.tool("roughing"), bodies.nose)
    stock = setup.stock.mesh(STOCK_CHORD)
    depth = job.levels.finishing_depth
    return [
        _contacts_on(setup.part.mesh, depth, cutter=finishing, setup=setup, job=job, most=most),
        _contacts_on(stock, 0.0, cutter=roughing, setup=setup, job=job, most=most),
    ]


def _contacts_on(
    mesh: TriangleMesh, depth: float, cutter: Cutter, setup: Setup, job: Job, most: int
) -> SampledContacts:
    """About `most` contacts of a cutter on a mesh with `depth` (mm) of material round it; none too near the post."""
    spacing = max(SPACING, float(np.sqrt(mesh.area / most)))
    cells = np.floor(mesh.vertices / spacing).astype(np.int64)
    _, kept = np.unique(cells, axis=0, return_index=True)
    across = np.zeros_like(mesh.vertices)
    for corner in range(3):
        np.add.at(across, mesh.faces[:, corner], mesh.face_vectors)
    normals = unit(across[kept])
    centres = mesh.vertices[kept] + cutter.radius * normals
    scene = _scene_of(mesh, setup, job, depth)
    held = setup.post.distance(centres) < cutter.radius
    gouging = scene.level_distance.signed(centres) < cutter.radius - GOUGE
    good = ~held & ~gouging
    return SampledContacts(CollisionChecker(scene, cutter), centres[good], normals[good])


def _scene_of(mesh: TriangleMesh, setup: Setup, job: Job, depth: float) -> Scene:
    """A mesh with `depth` (mm) of material round it on the post, nothing below; what holds its free end is there."""
    pin = setup.post.pin
    beside = sum(bracket(job.holding, pin).values(), ()) if pin else ()
    clamping = Clamping((), closed=False, clearance=job.holding.clearance, beside=beside)
    return Scene(mesh, mesh, enclosing_capsule(setup.stock), setup.post, depth, clamping=clamping)


def least_lifts(contacts: SampledContacts, clamping: Clamping, job: Job, limits: MachineLimits) -> Float[ndarray, " n"]:
    """The least lift (mm) of each contact among its free directions; infinite where it has none."""
    directions = directions_within(limits)
    directions = directions[limits.allow(directions)]
    needed = needed_lifts(contacts.centres, directions, contacts.checker.cutter, clamping)
    tilted = contacts.normals @ directions.T < np.cos(np.radians(job.path.max_tilt_deg))
    needed = np.where(tilted, np.inf, needed)
    order = np.argsort(needed, axis=1, kind="stable")
    least = np.full(len(order), np.inf)
    left = np.arange(len(order))
    for start in range(0, order.shape[1], BATCH):
        batch = order[left, start : start + BATCH]
        usable = np.isfinite(np.take_along_axis(needed[left], batch, axis=1))
        row, column = np.nonzero(usable)
        usable[row, column] = contacts.checker.free_by_distance(
            contacts.centres[left[row]], directions[batch[row, column]]
        )
        has_free = usable.any(axis=1)
        least[left[has_free]] = needed[left[has_free], batch[has_free, usable[has_free].argmax(axis=1)]]
        left = left[~has_free]
        if not len(left):
            break
    return least


STEEP_TILT = 80.0
"""A ball still cuts well with its axis tilted by this from the normal, degrees: its equator cuts, not its shank."""
SHORT_OVERHANG = 0.8
"""Share of the finishing cutter's overhang that is tried; it has to stay behind the flutes."""
SHARES = (0.75, 0.5)
"""Shares of the post's length for which is told what would stay uncut."""


def post_advice(setup: Setup, job: Job, limits: MachineLimits) -> dict[str, Any]:
    """`remedies` and `shorter` of the report of a post that was found, where it is slender; nothing where it is not."""
    if job.holding.length - job.holding.support_height <= job.warnings.slender * job.holding.diameter:
        return {}
    return what_would_help(setup, job, limits)


def what_would_help(setup: Setup, job: Job, limits: MachineLimits) -> dict[str, Any]:
    """What would shorten the post of a job, on which the part stands already, the most helpful first, and what it costs
    to cut it shorter as it is: the length of the post, and the area of the part that would stay uncut with it."""
    length = job.holding.length
    height = float(setup.stock.bounds[0, 2])
    clamping = clamping_of(job.holding, limits.bodies.table)
    remedies: list[dict[str, Any]] = [
        {"change": change, "length_mm": shortest_post(lifts, height, clamping, least_neck(changed))}
        for change, changed, other in _changes(job, limits)
        for lifts in [sampled_lifts(setup, changed, other)]
    ]
    helpful = sorted((one for one in remedies if one["length_mm"] < length), key=lambda one: one["length_mm"])

    lifts = sampled_lifts_of_part(setup, job, limits)
    each_area = setup.part.mesh.area / len(lifts)
    shorter = []
    for wanted in (float(np.ceil(share * length)) for share in SHARES):
        missed = np.isfinite(lifts) & (lifts > wanted - height)
        shorter.append({"length_mm": wanted, "uncut_mm2": round(float(missed.sum() * each_area), 1)})
    return {"remedies": helpful, "shorter": shorter}


def _changes(job: Job, limits: MachineLimits) -> Iterator[tuple[str, Job, MachineLimits]]:
    """Changes that are tried: what it is, and job and machine with it."""
    if job.path.max_tilt_deg < STEEP_TILT:
        steep = replace(job, path=replace(job.path, max_tilt_deg=STEEP_TILT))
        yield f"path.max_tilt_deg = {STEEP_TILT:g}", steep, limits
    overhang = round(SHORT_OVERHANG * job.finishing.overhang, 1)
    if overhang > max(job.finishing.flute_length, job.finishing.neck_length):
        short = replace(job, finishing=replace(job.finishing, overhang=overhang))
        yield f"finishing.overhang = {overhang:g}", short, limits
    if limits.bodies.nose:
        narrow = replace(limits.bodies, nose=())
        yield "a spindle no wider than the holder", job, replace(limits, bodies=narrow)


CHORD = 0.05
"""Chord tolerance of the surface, which tells the pieces of the solids apart, mm."""


def carrying_solid(surface: TSpline, solid: TriangleMesh) -> TriangleMesh:
    """The piece of a solid that the surface belongs to: what is beside it, such as a casing, carries nothing."""
    edges = half_edges(solid).reshape(-1, 2)
    count = len(solid.vertices)
    graph = coo_matrix((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(count, count))
    _, piece = connected_components(graph, directed=False)
    of_face = piece[solid.faces[:, 0]]
    pieces = [keep_faces(solid, of_face == number) for number in np.unique(of_face)]
    if len(pieces) == 1:
        return pieces[0]
    points = surface.tessellate(CHORD).vertices
    away = [float(np.median(MeshDistance(one).unsigned(points))) for one in pieces]
    return pieces[int(np.argmin(away))]


def surface_holding(holding: HoldingJob, surface: TSpline, solid: TriangleMesh) -> HoldingJob:
    """The holding with the sizes that it leaves open but the length: the post as thick as the underside of what carries
    the surface allows, since a solid of any form has no neck, and where nothing is named in a collet on a riser.
    JobError for a tailstock."""
    refuse_tailstock(holding, "what machines a surface alone")
    diameter = holding.diameter or thickest_below(carrying_solid(surface, solid))
    settled = in_collet(holding, diameter) if holding.names_nothing else holding
    return replace(settled, diameter=diameter)


CONTACTS = 400
"""So many contacts are sampled on the part."""


def blocked_share(setup: Setup, job: Job, limits: MachineLimits) -> float:
    """The share of the sampled contacts of the part that are reached without the tailstock of a job, whose bracket is
    settled, and not with it; 0 where it has none. JobError where it leaves none of them."""
    if not job.holding.has_tailstock:
        return 0.0
    bare = replace(job, holding=replace(job.holding, tailstock=NO_TAILSTOCK))
    without = np.isfinite(sampled_lifts_of_part(replace(setup, post=setup.post.alone), bare, limits, CONTACTS))
    with_it = np.isfinite(sampled_lifts_of_part(setup, job, limits, CONTACTS))
    if not without.any():
        return 0.0  # whatever is in the way, the tailstock is not what keeps the tool off
    if not with_it.any():
        reach = job.holding.tailstock_reach
        bound = "arm and column stand in the way of holder and spindle everywhere: give more, a longer pin "
        raise field_error(
            "holding", "tailstock_reach", reach, f"{bound}(tailstock_length), a longer overhang, or no tailstock"
        )
    return max(1.0 - with_it.sum() / without.sum(), 0.0)
