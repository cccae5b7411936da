"""The cutters of a job that leaves them open, chosen from a list of ball ends by what they take and what they leave.

A ball of radius R leaves the closing of the part by it (Serra 1982): c is how deep that is at most, A(d) the area where
it is deeper than d, away from the post. Clean is a ball with c <= CLEAN and A(COVERED) <= SHARE of the part. The
largest clean one, of LEAST_RADIUS at least, cuts last: it finishes, or cuts the hollows that a larger one leaves.
Roughing takes any ball that is no smaller. Of all such sets on whose best neck the part holds that one is taken with
the least

    T = layers + REST_MINUTES sum_k A(k a) + FINE_MINUTES + POST_MINUTES P,

minutes: the cuts between part and stock of the depths that the neck bears (`estimate.LayersToCut`), the steps of the
finishing depth a in hollows that the roughing ball leaves, the fine cutter where there is one, and the area P that
stays at the post.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import takewhile
from typing import Any

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.arrays import lengths, unit
from bonecam.errors import BonecamError, JobError
from bonecam.job import HoldingJob, Job
from bonecam.job.tool_list import ListedTool, known_cutters, read_tool_list
from bonecam.machine.limits import MachineLimits
from bonecam.mechanics.edges import cutter_compliance
from bonecam.mesh.hollows import ACCURACY, Ball
from bonecam.mesh.solids import cylinder, solid_union
from bonecam.mesh.triangle_mesh import TriangleMesh, keep_faces
from bonecam.planning.axes.lead import check_lead
from bonecam.planning.contacts import at_post
from bonecam.planning.estimate import LayersToCut
from bonecam.planning.neck import Neck, neck_diameters, ranking, shortest_neck, wanted_of
from bonecam.planning.post_length import STOCK_CHORD
from bonecam.setup.placement import Setup
from bonecam.text.numbers import shown
from bonecam.tool.cutter import Cutter
from bonecam.workholding.post import Post, post_below, settled_stub

CLEAN = 0.10
"""What may stay in the deepest hollow, mm: of a phalanx's 0.10 a program leaves 0.135, of a middle phalanx's 0.09
0.079."""
COVERED, SHARE = 0.05, 0.005
"""Hollows deeper than this, mm, may cover this share of the part."""
LEAST_RADIUS = 1.0
"""Finer balls, mm, are not chosen: they take four times as long, and their necks bend five times as far."""
SHALLOW = 0.02
"""What stays is told, and cut again by a finer ball, where it is deeper, mm: twice the finishing scallop."""
FINER = 2.0
"""A fine ball is smaller than the finishing one by this factor at most."""
REST_MINUTES, FINE_MINUTES = 0.044, 0.2
"""Minutes of each mm2 and step in a hollow, and of a fine cutter, fitted to eight programs of four bones. With layers
0.93 to 1.08 of what six bones take with chosen cutters, 0.82 of a scaphoid, which was not among the four; of those, one
of 2.3 minutes of links is told at 0.83. Fillets round the post tell nothing."""
POST_MINUTES = 0.012
"""Minutes that a mm2 at the post is worth: a second clamping cuts 95 mm2 of the phalanx in 1.1 min."""
FOOT, CHORD = 20.0, 0.02
"""The post goes so far below the part, and its facets lie so near to it, mm."""
NO_AREA = 1e-9
"""Faces of the union of less area, mm2, have no normal."""
FEW = "has no ball ends for all sections: add some, or state the radius of every cutter"
"""What is told of a list without a set of cutters."""
HOPEFUL = 1.3
"""Other necks are tried for the sets that cost no more than so many times the best on the thickest."""
EQUAL = 1.1
"""T is as accurate as this: of sets that it cannot tell apart one with little stress is taken."""
LITTLE = 0.75
"""Stress in a neck is little below this share of what it may be."""
SHOWN = 3
"""Sets that are reported."""


@dataclass(frozen=True)
class CutterSet:
    """The job with a set of cutters, the best of its necks, area (mm2) and depth (mm) of the hollows that stay, and the
    minutes T."""

    job: Job
    neck: Neck
    left_mm2: float
    left_mm: float
    minutes: float

    @property
    def cost(self) -> float:
        """The time T, with what the area at the post is worth, min."""
        return self.minutes + POST_MINUTES * self.neck.left_mm2

    @property
    def report(self) -> dict[str, Any]:
        """The set in the report."""
        figures = {"minutes": self.minutes, "left_mm2": self.left_mm2, "left_mm": self.left_mm}
        neck = {name: getattr(self.neck, name) for name in ("shift_um", "stress_mpa", "left_mm2")}
        neck["at_post_mm2"] = neck.pop("left_mm2")
        rounded = {name: round(value, 2) for name, value in {**figures, **neck}.items()}
        named = {name: getattr(self.job, name).preset for name in self.job.cutter_names}
        return {**named, **rounded, "neck_mm": self.neck.diameter, "holds": self.neck.holds}


class Hollows:
    """What balls leave of a part on its post, in the closing of both: areas (mm2) and depths (mm) of faces whose edges
    are half of the radius at most, and which of them are away from the post."""

    def __init__(self, mesh: TriangleMesh, post: Post) -> None:
        self.mesh, self.post = mesh, post
        foot = float(mesh.bounds[0, 2]) - FOOT
        both = solid_union([mesh, cylinder(post.radius, foot, post.top, CHORD)])
        self.solid = keep_faces(both, lengths(both.face_vectors) > NO_AREA)
        self._of: dict[float, tuple[Float[ndarray, " f"], Float[ndarray, " f"], Bool[ndarray, " f"]]] = {}

    def of(self, radius: float) -> tuple[Float[ndarray, " f"], Float[ndarray, " f"], Bool[ndarray, " f"]]:
        """Areas, depths and whether away from the post of the faces of the part that a ball of a radius leaves."""
        if radius not in self._of:
            ball = Ball(self.solid, radius)
            faces, corners = ball.probed.faces, ball.probed.vertices
            places = corners[faces].mean(axis=1)
            hollow = (ball.entered[len(corners) :] > ACCURACY) & (self.post.column.distance(places) > CHORD)
            places, across = places[hollow], ball.probed.face_vectors[hollow]
            depths = lengths(ball.lying_near(places) - places) - radius if len(places) else np.zeros(0)
            away = ~at_post(places, unit(across), self.post, radius)
            self._of[radius] = lengths(across) / 2, np.maximum(depths, 0.0), away
        return self._of[radius]

    def deeper(self, radius: float, depth: float) -> float:
        """The area (mm2) away from the post that a ball leaves deeper than `depth`, mm."""
        areas, depths, away = self.of(radius)
        return float(areas[away & (depths > depth)].sum())

    def deepest(self, radius: float) -> float:
        """The depth (mm) of the deepest hollow of a ball away from the post."""
        _, depths, away = self.of(radius)
        return float(depths[away].max(initial=0.0))

    def steps(self, radius: float, step: float) -> float:
        """The area (mm2) of all cuts of depth `step` (mm) that take what a ball leaves away from the post."""
        areas, depths, away = self.of(radius)
        return float((areas * np.ceil(depths / step))[(depths > SHALLOW) & away].sum())

    def clean(self, radius: float) -> bool:
        """Whether what a ball leaves is neither deep nor large."""
        share = self.deeper(radius, COVERED) / self.mesh.area
        return self.deepest(radius) <= CLEAN and share <= SHARE


def leaves_cutters_open(job: Job) -> bool:
    """Whether a cutter that a job uses is to be chosen."""
    return not set(job.open_cutters).isdisjoint(job.cutter_names)


def with_chosen_cutters(setup: Setup, job: Job, limits: MachineLimits) -> tuple[Job, dict[str, Any]]:
    """The job with a cutter in the place of each that it leaves open, a fine one too where it is worth its time, and
    what the report tells of the best sets; the job, and nothing, where it leaves none open.

    A section that is open keeps its tool number, flutes, speed, feed and scallop. `setup` has the part with its hollows
    open. JobError where a list of cutters cannot be read, or has no ball for a section.
    """
    trial = _Trial.of(setup, job, limits) if leaves_cutters_open(job) else None
    if trial is None or not trial.necks:  # what is wrong with necks is told where the post is sought
        return job, {}
    listed, catalogue = known_cutters(job.nc.tools), read_tool_list("")
    sets = trial.tried(listed)
    if not sets:
        raise JobError(f"nc.tools = {shown(job.nc.tools)}: {FEW}", section="nc", field="tools")
    told: dict[str, Any] = {"sets": [one.report for one in sets[:SHOWN]], "tried": len(sets)}
    if job.nc.tools:
        others = trial.tried([*listed, *catalogue])
        if others[0].cost < sets[0].cost - FINE_MINUTES:
            told["more"] = others[0].report
    if finer := trial.finer(sets[0], [*listed, *catalogue]):
        told["finer"] = finer
    return replace(sets[0].job, holding=job.holding), told


@dataclass(frozen=True, eq=False)
class _Trial:
    """What sets of cutters have in common: the job with its stub, the necks that meet the part with the setup on each,
    the thickest last, the layers to be cut, and what balls leave."""

    job: Job
    limits: MachineLimits
    necks: Sequence[tuple[Setup, HoldingJob]]
    layers: LayersToCut
    hollows: Hollows

    @classmethod
    def of(cls, setup: Setup, job: Job, limits: MachineLimits) -> "_Trial":
        """The trial for a part in its stock."""
        job = replace(job, holding=settled_stub(job.holding, setup.stock.diameter))
        width = float(np.ptp(setup.stock.bounds[:, :2], axis=0).min())
        necks = list[tuple[Setup, HoldingJob]]()
        for diameter in neck_diameters(width, job):
            holding = replace(job.holding, diameter=diameter)
            with suppress(BonecamError):
                necks.append((replace(setup, post=post_below(setup.part.mesh, holding)), holding))
        layers = LayersToCut.between(setup.part.mesh, setup.stock.mesh(STOCK_CHORD))
        thickest = necks[-1][0] if necks else setup
        return cls(job, limits, necks, layers, Hollows(setup.part.mesh, thickest.post))

    def tried(self, listed: Sequence[ListedTool]) -> list[CutterSet]:
        """All sets of the cutters that are `listed`, the best first; other necks are tried for those alone that are
        HOPEFUL on the thickest."""
        jobs = list(_jobs_with(self.job, _stiffest(listed, self.job, self.limits), self.hollows))
        thick = sorted((self.set_of(one, [self.neck(one, *self.necks[-1])]) for one in jobs), key=_order)
        hopeful = [one for one in thick if one.cost <= HOPEFUL * thick[0].cost]
        found = [
            self.set_of(one.job, [*(self.neck(one.job, *neck) for neck in self.necks[:-1]), one.neck])
            for one in hopeful
        ]
        found.sort(key=_order)
        equal = [one for one in found if one.neck.holds and one.cost <= EQUAL * found[0].cost]
        little = LITTLE * wanted_of(found[0].job)["stress_mpa"] if found else 0.0
        best = min(equal or found[:1], key=lambda one: (one.neck.stress_mpa > little, one.cost), default=None)
        return sorted(found, key=lambda one: one is not best)

    def finer(self, taken: CutterSet, listed: Sequence[ListedTool]) -> dict[str, Any]:
        """The largest ball of those `listed` that leaves half as much as a set that is `taken`, as its fine cutter,
        with what it leaves and the minutes that it takes; nothing where the set leaves nothing to speak of, or there is
        none."""
        last, step = taken.job.smallest_ball, taken.job.levels.finishing_depth
        balls = _stiffest(listed, self.job, self.limits)
        smaller = sorted((radius for radius in balls if radius < last), reverse=True)
        half = (radius for radius in smaller if self.hollows.deepest(radius) <= taken.left_mm / 2)
        radius = next(half, None) if taken.left_mm > 2 * SHALLOW else None
        if radius is None:
            return {}
        figures = {
            "left_mm2": self.hollows.deeper(radius, SHALLOW),
            "left_mm": self.hollows.deepest(radius),
            "minutes": FINE_MINUTES + REST_MINUTES * self.hollows.steps(last, step),
        }
        rounded = {name: round(value, 2) for name, value in figures.items()}
        return {"preset": balls[radius].name, "radius_mm": radius, **rounded}

    def neck(self, job: Job, standing: Setup, holding: HoldingJob) -> Neck:
        """How one of the necks holds the part for the cutters of a job."""
        return shortest_neck(standing, replace(job, holding=holding), self.limits, self.layers)

    def set_of(self, job: Job, necks: Sequence[Neck]) -> CutterSet:
        """The cutters of a job on the best of some necks, with the minutes T."""
        neck = ranking(necks)[0]
        last = job.smallest_ball
        minutes = neck.machining_min or self.layers.minutes(job)
        minutes += REST_MINUTES * self.hollows.steps(job.roughing.radius, job.levels.finishing_depth)
        minutes += FINE_MINUTES * job.path.fine_cutter
        return CutterSet(job, neck, self.hollows.deeper(last, SHALLOW), self.hollows.deepest(last), minutes)


def _order(one: CutterSet) -> tuple[bool, int, float]:
    """Sets that hold first, the quickest first; of others those that bend least (um)."""
    return not one.neck.holds, 0 if one.neck.holds else round(one.neck.shift_um), one.cost


def _stiffest(listed: Sequence[ListedTool], job: Job, limits: MachineLimits) -> dict[float, ListedTool]:
    """The stiffest ball end of each radius (mm) that can lean by the lead of a job, the smallest radius first."""
    found = list[tuple[float, float, ListedTool]]()
    for one in listed:
        cutter = Cutter.from_job(1, one.name, replace(job, roughing=one.tool).tool("roughing"), limits.bodies.nose)
        with suppress(JobError):
            check_lead(cutter, job.path.lead_deg)
            found.append((one.tool.radius, cutter_compliance(cutter), one))
    softest_first = sorted(found, key=lambda row: (row[0], -row[1]))
    return {radius: one for radius, _, one in softest_first}


def _jobs_with(job: Job, listed: Mapping[float, ListedTool], hollows: Hollows) -> Iterator[Job]:
    """The job with each set of cutters that is tried."""
    if not listed:
        return
    open_ones = job.open_cutters
    large = [radius for radius in listed if radius >= LEAST_RADIUS] or [max(listed)]
    clean = max(large[:1] + list(takewhile(hollows.clean, large[1:])))
    finishing = [radius for radius in large if clean / FINER <= radius <= FINER * clean]
    for ball in finishing if "finishing" in open_ones else [job.finishing.radius]:
        finer = [radius for radius in listed if radius < ball]
        fine = job.fine.radius if job.path.fine_cutter else 0.0
        if "fine" in open_ones and job.path.fine_cutter and finer:
            enough = [radius for radius in finer if hollows.deepest(radius) <= SHALLOW / 2]
            fine = max(enough, default=min(finer))
        elif {"fine", "finishing"} <= set(open_ones) and ball > clean:
            fine = clean
        larger = [radius for radius in large if radius >= ball] or [max(listed)]
        for rough in larger if "roughing" in open_ones else [job.roughing.radius]:
            taken = {"roughing": rough, "finishing": ball, **({"fine": fine} if fine else {})}
            tools: dict[str, Any] = {
                name: listed[radius].in_section(getattr(job, name))
                for name, radius in taken.items()
                if name in open_ones
            }
            try:
                one = replace(job, **tools, path=replace(job.path, fine_cutter=bool(fine)))
            except JobError:  # a cutter of the shop cannot stand in two places of the changer
                continue
            yield one
