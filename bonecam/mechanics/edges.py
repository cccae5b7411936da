"""The edges of a cutter: how far its ball gives way across its axis, what force one edge takes, and where they stand on
the pieces of its moves.

The cutter is a stepped beam that the holder holds rigidly. A force across the axis at the ball's centre bends a piece
of the second moment I at the distance x above it by the moment x F; Castigliano gives c = sum int x^2 / (E I) dx over
flutes, neck and shank up to the holder. Pull along the axis is left out: the displacement is c (I - a a^T) F.

The force of one edge of a ball at the middle of a strip has a closed form: clamping is chosen by it, before any path is
planned.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import dots, lengths, perpendicular, unit
from bonecam.errors import JobError
from bonecam.job import Job
from bonecam.job.materials.preset import CuttingForce
from bonecam.kernels.rays import TURN, Edges, over_turns
from bonecam.kernels.removal import Pieces
from bonecam.material.rays import RayGrid, order
from bonecam.tool.cutter import Cutter

CARBIDE = 580_000.0
"""Modulus of cemented carbide with 10 % of cobalt, N/mm^2 (ISO 513 K grades: 570,000 to 630,000)."""
CORE = 0.8
"""Diameter of the round bar that bends as the fluted part does, as a share of the cutter's (Kops & Vo 1990, CIRP Annals
39, 93)."""


def cutter_compliance(cutter: Cutter) -> float:
    """Displacement of the ball's centre across the axis for a unit force there, mm/N."""
    # int x^2 / I dx over a cylinder or cone, 1/mm, by Gauss's rule with 8 points: exact for a cylinder, to 1e-6 for a
    # cone that doubles its radius
    nodes, weights = np.polynomial.legendre.leggauss(8)
    along = (nodes + 1) / 2
    total = 0.0
    for piece in cutter.profile:
        if piece.name in ("holder", "spindle"):
            break
        share = CORE if piece.name == "cutter" else 1.0
        low, high = piece.start - cutter.radius, piece.end - cutter.radius
        radius, end_radius = share * piece.radius, share * piece.end_radius
        x = low + along * (high - low)
        r = radius + along * (end_radius - radius)
        total += float((weights * x**2 * 4 / (np.pi * r**4)).sum() * (high - low) / 2)
    return total / CARBIDE


def across(compliance: float, axes: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3 3"]:
    """c (I - a a^T) for unit axes, mm/N."""
    return compliance * (np.eye(3) - axes[:, :, None] * axes[:, None, :])


SHALLOWER = (2.0, 3.0, 5.0)
"""How many times as shallow finishing cuts are asked, with scallops as much lower."""


def strip_force(force: CuttingForce, radius: float, depth: float, scallop: float, chip: float) -> Float[ndarray, "3"]:
    """Forces (N: tangential, radial, that is along the normal of the ball, axial) on an edge of a ball of `radius` mm
    that takes `chip` mm off the middle of a strip `depth` mm deep, beside one that was left with scallops of `scallop`
    mm.

    The edge is engaged from where the strip before it ends, a = acos(1 - depth / R) from the middle of the ball's
    groove, to half of the way w = sqrt(8 R scallop) between two passes on the other side: over R (a + asin(w / 2R))
    along the ball, with chips of h sin(kappa) (Altintas 2012, 2.8). Depth and scallop beyond the radius count as it.
    """
    whole = math.acos(1 - min(depth / radius, 1.0))
    half = math.asin(min(math.sqrt(2 * scallop / radius), 1.0))
    edge = radius * (whole + half)
    area = chip * radius * (2 - math.cos(whole) - math.cos(half))
    return force.array[:3] * area + force.array[3:] * edge


def job_strip_forces(force: CuttingForce, job: Job, name: str) -> Float[ndarray, "3"]:
    """The forces (N) of the deepest strip of the cutter "roughing" or "finishing" of a job, as `strip_force`."""
    tool = job.tool(name)
    depth = job.deepest(name)
    chip = tool.feed / (tool.spindle * tool.flutes)
    scallop = max(tool.scallop, job.levels.scallop_share * depth) if name == "roughing" else tool.scallop
    return strip_force(force, tool.radius, depth, scallop, chip)


def job_strip_force(force: CuttingForce, job: Job, name: str) -> float:
    """The size (N) of the force of the deepest strip of the cutter "roughing" or "finishing" of a job."""
    return float(np.linalg.norm(job_strip_forces(force, job, name)))


def lighter_jobs(job: Job) -> Iterator[tuple[str, Job]]:
    """Jobs with ever shallower finishing cuts than those of a job, and these cuts in words; at the feed that the
    material gives them."""
    levels = job.levels
    fields = "levels.finishing_depth, finishing.scallop"
    by_number = not levels.listed and bool(levels.cuts[0])
    if not by_number:
        fields = "levels.finishing_depth, the first of levels.depths where they are stated, finishing.scallop"
    for times in SHALLOWER:
        depth, scallop = (float(f"{value / times:.2g}") for value in (job.deepest("finishing"), job.finishing.scallop))
        changed: dict[str, float | str] = {"finishing_depth": depth}
        if not by_number:
            outer = levels.listed[1:] or (levels.cuts[1],)
            changed |= {"schedule": "numbers", "depths": " ".join(f"{each:g}" for each in (depth, *outer))}
        try:
            lighter = job.with_values(levels=changed, finishing={"scallop": scallop})
        except JobError:  # a job takes none that are so small
            continue
        yield f"finishing cuts of {depth:g} mm with scallops of {scallop:g} ({fields})", lighter


def lighter_cuts(force: CuttingForce, job: Job) -> tuple[tuple[str, float], ...]:
    """Finishing cuts of `lighter_jobs`, in words, and the share of its force that each takes."""
    whole = job_strip_force(force, job, "finishing")
    return tuple((what, job_strip_force(force, lighter, "finishing") / whole) for what, lighter in lighter_jobs(job))


AHEAD = 2.5
"""A piece is asked this many cells ahead of where it begins: closer than that rays do not tell what it cuts from what
the piece before it has left, and forces come out 7 to 12 % low."""
ALONG = 1e-6
"""Below this sine of the angle between feed and axis the feed has no direction across the axis."""
TINY = 1e-12
"""A force whose square is less is none, N^2."""
NO_EDGES = Edges(
    frames=np.empty((0, 3, 3)),
    centres=np.empty((0, 3)),
    feeds=np.empty((0, 2)),
    chips=np.empty(0),
    coefficients=np.zeros(6),
    forces=np.empty((0, TURN, 3), dtype=np.float32),
    engaged=np.empty((0, 5)),
    asked=np.empty(0, dtype=bool),
)
"""Of moves whose forces are not asked."""
NO_EDGES_ASKED = (NO_EDGES,) * 3
"""What the three sets of rays tell of moves whose forces are not asked."""


def edges_on(
    pieces: Pieces, chips: Float[ndarray, " n"], coefficients: Float[ndarray, "6"], cell: float, cutter: Cutter
) -> Edges:
    """The edges of a cutter on pieces of moves in the part's frame, with the feed a tooth of each (`chips`, mm), before
    rays `cell` mm apart are asked."""
    way = pieces.ends - pieces.starts
    length = lengths(way)
    feed = unit(way)
    axes = unit(pieces.start_axes + pieces.end_axes)
    across = feed - dots(feed, axes)[:, None] * axes
    first = np.where((lengths(across) > ALONG)[:, None], unit(across), perpendicular(axes))
    ahead = np.maximum(AHEAD * cell - length / 2, 0.0)
    count = len(length)
    return Edges(
        frames=np.stack([first, np.cross(axes, first), axes], axis=1),
        centres=(pieces.starts + pieces.ends) / 2 + ahead[:, None] * feed,
        feeds=np.column_stack([dots(feed, first), dots(feed, axes)]),
        chips=np.where(length > 0, chips, 0.0),
        coefficients=coefficients,
        forces=np.empty((0, TURN, 3), dtype=np.float32),
        engaged=np.empty((count, 0)),
        asked=np.zeros(count, dtype=bool),
    )


def edges_in_grid(edges: Edges, grid: RayGrid, direction: int) -> Edges:
    """The edges in the coordinates of the rays along one of the grid's directions, with room for what these tell."""
    columns = order(direction)
    count = len(edges.chips)
    frames = grid.of_vectors(edges.frames.reshape(-1, 3))[:, columns].reshape(-1, 3, 3)
    return edges._replace(
        frames=np.ascontiguousarray(frames),
        centres=np.ascontiguousarray(grid.of_points(edges.centres)[:, columns]),
        forces=np.zeros((count, TURN, 3), dtype=np.float32),
        engaged=np.zeros((count, 5)),
        asked=np.zeros(count, dtype=bool),
    )


@dataclass(frozen=True, eq=False)
class EdgeForces:
    """What all sets of rays tell of the pieces (n,) of a cutter's moves.

    `edges` are those in the part's frame; `single` (n, TURN, 3) is the force of one edge at each place of a turn along
    v, e_r and a (N, float32); `mean` and `peak` (n, 3) that of all flutes over a turn, in the part's frame; `places`
    (n, 3): the mean engaged point; `cut` (n,): some edge is engaged; `areas` (n,): engaged, across the feed, mm^2;
    `spans` (n,): length of the engaged edge, summed over the places of a turn, mm.
    """

    edges: Edges
    single: Float[ndarray, "n t 3"]
    mean: Float[ndarray, "n 3"]
    peak: Float[ndarray, "n 3"]
    places: Float[ndarray, "n 3"]
    areas: Float[ndarray, " n"]
    spans: Float[ndarray, " n"]

    @property
    def edge_shares(self) -> Float[ndarray, " n"]:
        """The share of the peak that does not grow with the feed: what an edge presses over its length, in the mean of
        the places of a turn where it cuts, beside the largest force on it; 1 at most."""
        rubbing = float(np.linalg.norm(self.edges.coefficients[3:]))
        squares = np.einsum("ntk,ntk->nt", self.single, self.single)
        length = self.spans / np.maximum((squares > 0).sum(axis=1), 1)
        return np.minimum(rubbing * length / np.sqrt(np.maximum(squares.max(axis=1), TINY)), 1.0)

    @property
    def cut(self) -> ndarray:
        """Whether some edge is engaged on each piece."""
        return self.areas > 0


def forces_of(edges: Edges, asked: Sequence[Edges], flutes: int) -> EdgeForces:
    """The sum of what each set of rays told of the `edges` (`asked`), for a cutter with so many flutes."""
    single = asked[0].forces
    for other in asked[1:]:
        single += other.forces
    engaged = np.sum([each.engaged for each in asked], axis=0)
    mean, peak = np.empty((2, len(single), 3))
    over_turns(single, edges.frames, flutes, mean, peak)
    away = engaged[:, 1:4] / np.maximum(engaged[:, :1], np.finfo(float).tiny)
    points = edges.centres + np.einsum("nk,nkc->nc", away, edges.frames)
    return EdgeForces(edges, single, mean=mean, peak=peak, places=points, areas=engaged[:, 4], spans=engaged[:, 0])
