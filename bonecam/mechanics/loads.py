"""The loads of a program, path by path while its removal is simulated: force, deflection, stress, and what bends.

A place of the finished surface keeps an error, because part and cutter give way. At a place p with the outward normal
n, cut last by a move with the tool axis a, it is

    -n . (C(p) + c (I - a a^T)) F,

where C is the compliance of what stands behind that path (the softest that it was on it), c that of the cutter, and F
the force on the work while an edge leaves p finished, or, of a body that does not follow single edges, the mean.
Positive: material stays.

Feeds for an even peak follow from the force that each move of a program takes at its feed. A peak is F = E + C f: what
edges press whatever the feed, and what grows with it (Altintas 2012, 2.8). So the feed that gives the peak T is that of
the program times (T - E) / (F - E). T is one for each cutter: QUANTILE of its cutting time is below it, so that what
the peaks lose in time the rest wins.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.arrays import dots, lengths
from bonecam.errors import JobError, VerifyError
from bonecam.job import HoldingJob, Job, MechanicsJob
from bonecam.job.materials.preset import CuttingForce, StiffnessTable, cutting_force, read_material
from bonecam.kernels.rays import Edges, RaySet
from bonecam.kernels.removal import Pieces
from bonecam.material.rays import RayGrid
from bonecam.mechanics.beam import (
    Beam,
    Seat,
    Support,
    column_sections,
    join,
    mesh_sections,
    ray_sections,
    shell_seat,
    shoulder,
    tailstock_support,
)
from bonecam.mechanics.edges import (
    NO_EDGES,
    NO_EDGES_ASKED,
    EdgeForces,
    across,
    cutter_compliance,
    edges_in_grid,
    edges_on,
    forces_of,
    lighter_cuts,
)
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import BESIDE, PARTING
from bonecam.workholding.clamping import Clamping
from bonecam.workholding.post import Column, Post
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
    clamping, which gives way as its `seat`. `lighter` are finishing cuts in words, with the share of the force that
    they take. A `support` holds the free end, if there is one, and `holding` is the job's, where a tailstock may be
    offered."""

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
    seat: Seat | None = None

    def beam(self, standing: Standing) -> Beam:
        """What stands as a beam, with the shoulders of the post: at its top against what is a diameter above that, and
        at its foot against the stub."""
        sets, grid = standing.sets, standing.grid
        if self.post is None:
            low = self.clamped if self.seat is None else self.seat.low
            sections = ray_sections(sets, grid, low, standing.top)
            flexible = np.where(sections.low < self.clamped, 0.0, sections.flexible)
            return Beam(replace(sections, flexible=flexible), self.stiffness.elasticity, seat=self.seat)
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
    clamped = held_below(part, shell)
    foot = max(float(shell.bounds[0, 2]), job.holding.chuck_height)
    return Workpiece(
        material=job.material.name,
        stiffness=stiffness,
        force=force,
        post=None,
        clamped=clamped,
        limits=job.mechanics,
        lighter=lighter_cuts(force, job),
        seat=shell_seat(shell, part, foot, clamped, job.holding.second_modulus),
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


UM = 1000.0
"""Micrometres in a millimetre."""
TIP = 0.05
"""Nearer to the ball's tip, as a share of its radius, edges pass a place all the time."""


@dataclass(frozen=True, eq=False)
class Finished:
    """Places of the finished surface: vertices of `mesh`, on the exact surface `points` (n, 3) with `normals` and their
    `areas` (mm^2), and the move that cut each last (`owners`, negative where none has)."""

    mesh: TriangleMesh
    points: Float[ndarray, "n 3"]
    normals: Float[ndarray, "n 3"]
    areas: Float[ndarray, " n"]
    owners: Int[ndarray, " n"]


@dataclass(eq=False)
class KeptErrors:
    """The error kept at each place of a `finished` surface (`errors`, mm), NaN where no move has cut it; the forces
    there while an edge is `passing` and in the `mean` (N), `axes` and `tool` (mm/N), axis and compliance of the cutter.
    They change while paths are taken."""

    finished: Finished

    def __post_init__(self) -> None:
        count = len(self.finished.points)
        self.errors = np.full(count, np.nan)
        self.passing = np.zeros((count, 3))
        self.mean = np.zeros((count, 3))
        self.axes = np.zeros((count, 3))
        self.tool = np.zeros(count)

    def take(self, pieces: Pieces, edges: EdgeForces, beam: Beam, tool: float, flutes: int, *, follows: bool) -> None:
        """Set the errors of the places that a path has cut last by so many `flutes` of a cutter of this compliance
        (`tool`, mm/N); the work, a `beam`, `follows` single edges, or gives way under the mean force."""
        owners = self.finished.owners
        here = np.flatnonzero(np.isin(owners, np.unique(pieces.moves)))
        if not len(here):
            return
        points = self.finished.points[here]
        piece = piece_through(points, owners[here], pieces)
        self.axes[here] = edges.edges.frames[piece, 2]
        self.tool[here] = tool
        self.passing[here] = passing_force(points, piece, edges, flutes)
        self.mean[here] = edges.mean[piece]
        self.errors[here] = self.errors_with(beam, here, follows=follows)

    def errors_with(
        self, beam: Beam, here: Int[ndarray, " k"], *, follows: bool, tool_share: float = 1.0
    ) -> Float[ndarray, " k"]:
        """The errors of some places on a `beam` that `follows` single edges, or gives way under the mean force, and
        with this share of the compliance of the cutters, mm."""
        gives = beam.compliance(self.finished.points[here])
        tool = (tool_share * self.tool[here])[:, None, None] * across(1.0, self.axes[here])
        moved = np.einsum("nij,nj->ni", gives + tool, (self.passing if follows else self.mean)[here])
        return -dots(self.finished.normals[here], moved)


def piece_through(points: Float[ndarray, "n 3"], moves: Int[ndarray, " n"], pieces: Pieces) -> Int[ndarray, " n"]:
    """Of the pieces of the move that cut each point the one whose middle is nearest; pieces are in the order of their
    moves."""
    first = np.searchsorted(pieces.moves, moves, side="left")
    last = np.searchsorted(pieces.moves, moves, side="right")
    middles = (pieces.starts + pieces.ends) / 2
    best = first.copy()
    nearest = np.full(len(points), np.inf)
    for k in range(int((last - first).max())):
        which = np.minimum(first + k, last - 1)
        away = lengths(points - middles[which])
        closer = away < nearest
        best[closer], nearest[closer] = which[closer], away[closer]
    return best


def passing_force(
    points: Float[ndarray, "n 3"], piece: Int[ndarray, " n"], forces: EdgeForces, flutes: int
) -> Float[ndarray, "n 3"]:
    """The force of all flutes on the work while one of them leaves each point finished, N, on the piece that cuts it.

    The ball touches the finished surface where its normal is across the feed; the edge that passes there cuts on the
    side of the feed. At the tip, where edges pass all the time, the force is the mean.
    """
    edges = forces.edges
    frames = edges.frames[piece]
    turn = forces.single.shape[1]
    away = np.einsum("nkc,nc->nk", frames, points - edges.centres[piece])
    feed = np.insert(edges.feeds[piece], 1, 0.0, axis=1)
    away -= dots(away, feed)[:, None] * feed
    angle = np.arctan2(away[:, 1], away[:, 0])
    at = np.floor(angle / (2 * np.pi) * turn - np.sign(angle) / 2).astype(np.int64)
    total = np.zeros((len(points), 3))
    for flute in range(flutes):
        k = (at + flute * (turn // flutes)) % turn
        phi = (k + 0.5) * 2 * np.pi / turn
        tangential, radial, axial = forces.single[piece, k].astype(float).T
        ahead = radial * np.cos(phi) + tangential * np.sin(phi)
        left = radial * np.sin(phi) - tangential * np.cos(phi)
        total += np.einsum("nk,nkc->nc", np.column_stack([ahead, left, axial]), frames)
    at_tip = np.hypot(away[:, 0], away[:, 1]) < TIP * lengths(away)
    return np.where(at_tip[:, None], forces.mean[piece], total)


def cut_shares(
    values: Float[ndarray, " n"], weights: Float[ndarray, " n"], shares: Sequence[float]
) -> Float[ndarray, " s"]:
    """The values that these shares of the weight stay below or at; zeros where there are none."""
    if not len(values) or not weights.sum() > 0:
        return np.zeros(len(shares))
    order = np.argsort(values)
    up_to = np.cumsum(weights[order])
    index = np.searchsorted(up_to, np.asarray(shares) * up_to[-1], side="left")
    return values[order][np.minimum(index, len(values) - 1)]


SLOW = 3.0
"""A body whose lowest frequency is less than so many times that of the edges does not follow the force of each edge:
its displacement is that of the mean, within the part that its resonance adds."""


@dataclass(frozen=True, eq=False)
class PathLoads:
    """What one path of a level loads: of its pieces that cut (k,) the `moves`, `minutes`, `mean` and `peak` force (N),
    the `edge_share` of the peak that does not grow with the feed, deflection of part and cutter under the mean
    (`deflection`, mm), and the largest bending stress of what stands below at the peak (`stress`, N/mm^2); the lowest
    frequency (`first_hz`) of what stands behind it, and that of the edges (`tooth_hz`)."""

    index: int | None
    rest: int
    moves: Int[ndarray, " k"]
    minutes: Float[ndarray, " k"]
    mean: Float[ndarray, " k"]
    peak: Float[ndarray, " k"]
    edge_share: Float[ndarray, " k"]
    deflection: Float[ndarray, " k"]
    stress: Float[ndarray, " k"]
    first_hz: float
    tooth_hz: float


class AskedEdges(NamedTuple):
    """The edges of a path in the part's frame, and as each set of rays is asked for them."""

    edges: Edges
    asked: Sequence[Edges]


@dataclass(eq=False)
class Loads:
    """The loads of one program on a `workpiece` (None: nothing is asked); `minutes` and `spindle` (1/min) are those of
    all its moves.

    `paths`, the errors `kept` on the finished surface, and what is `standing` change while paths are taken.
    """

    workpiece: Workpiece | None
    minutes: Float[ndarray, " m"]
    spindle: Float[ndarray, " m"]
    paths: list[PathLoads] = field(default_factory=list)
    kept: KeptErrors | None = None
    standing: Standing | None = None

    def edges(self, pieces: Pieces, grid: RayGrid, cutter: Cutter) -> AskedEdges:
        """The edges of a cutter on pieces of its moves."""
        if self.workpiece is None:
            return AskedEdges(NO_EDGES, NO_EDGES_ASKED)

        # Feed a tooth of the ball's centre, mm; 0 of rapids, and where the spindle stands
        teeth = self._piece_minutes(pieces) * self.spindle[pieces.moves] * cutter.flutes
        way = lengths(pieces.ends - pieces.starts)
        chips = np.where(teeth > 0, way / np.where(teeth > 0, teeth, 1.0), 0.0)

        edges = edges_on(pieces, chips, self.workpiece.force.array, grid.cell, cutter)
        return AskedEdges(edges, [edges_in_grid(edges, grid, direction) for direction in range(3)])

    def take(
        self,
        level: tuple[int | None, int],
        pieces: Pieces,
        edges: AskedEdges,
        cutter: Cutter,
        standing: Standing,
        finished: Finished | None,
    ) -> None:
        """Take the path of a `level` (its index and number of the rest path), whose `edges` have been asked, with what
        stands behind it. VerifyError where that is in pieces, one above the other."""
        work = self.workpiece
        if work is None:
            return
        forces = forces_of(edges.edges, edges.asked, cutter.flutes)
        try:
            beam = work.beam(standing)
        except ValueError as error:
            named = "a path of the program" if level[0] is None else f"the path of level {level[0]}"
            what = f"{named} cuts through the work: {error}"
            raise VerifyError(f"{what}: cut less deep there, or what holds the part less", line=0) from error
        first = beam.first_frequency(work.stiffness.density)
        tool = cutter_compliance(cutter)
        tooth = cutter.flutes * float(self.spindle[pieces.moves].max()) / 60
        cut = np.flatnonzero(forces.cut)
        points, mean = forces.places[cut], forces.mean[cut]
        gives = beam.compliance(points) + across(tool, edges.edges.frames[cut, 2])
        self.paths.append(
            PathLoads(
                index=level[0],
                rest=level[1],
                moves=pieces.moves[cut],
                minutes=self._piece_minutes(pieces)[cut],
                mean=lengths(mean),
                peak=lengths(forces.peak[cut]),
                edge_share=forces.edge_shares[cut],
                deflection=lengths(np.einsum("nij,nj->ni", gives, mean)),
                stress=beam.moment_stress(forces.peak[cut], points),
                first_hz=np.inf if level[0] == PARTING else first,
                tooth_hz=tooth,
            )
        )
        self.standing = standing
        if finished is not None:
            self.kept = self.kept or KeptErrors(finished)
            self.kept.take(pieces, forces, beam, tool, cutter.flutes, follows=first >= SLOW * tooth)

    def _piece_minutes(self, pieces: Pieces) -> Float[ndarray, " n"]:
        """The time of each piece: its share of that of its move."""
        counts = np.bincount(pieces.moves, minlength=len(self.minutes))
        return self.minutes[pieces.moves] / counts[pieces.moves]


QUANTILE = 0.75
LEAST, MOST = 0.5, 2.0
"""The feed of a move is changed by a factor between these."""


@dataclass(frozen=True, eq=False)
class FeedSchedule:
    """By what the feed of each move of a program is multiplied (`ratios`, 1 where nothing is cut), and the peak (N)
    that the moves of each cutter, by number, then have."""

    ratios: Float[ndarray, " m"]
    targets: Mapping[int, float]


def feed_schedule(paths: Sequence[PathLoads], tools: Sequence[int], moves: int) -> FeedSchedule:
    """The schedule of a program of so many `moves` from the loads of its `paths`, each cut by one of `tools`; parting
    keeps its feed."""
    ratios = np.full(moves, np.inf)
    targets = {}
    for tool in sorted(set(tools)):
        own = [path for path, by in zip(paths, tools, strict=True) if by == tool and path.index not in BESIDE]
        own = [path for path in own if len(path.moves)]
        if not own:
            continue
        target = targets[tool] = peaks(own, (QUANTILE,))[0]
        for path in own:
            edge = path.edge_share * path.peak
            grows = np.maximum(path.peak - edge, np.finfo(float).tiny)
            np.minimum.at(ratios, path.moves, (target - edge) / grows)
    return FeedSchedule(np.clip(np.where(np.isfinite(ratios), ratios, 1.0), LEAST, MOST), targets)


def peaks(paths: Sequence[PathLoads], shares: Sequence[float]) -> list[float]:
    """The peaks (N) that these shares of the cutting time of some paths stay below."""
    peak, minutes = (np.concatenate([getattr(path, name) for path in paths]) for name in ("peak", "minutes"))
    return [float(value) for value in cut_shares(peak, minutes, shares)]
