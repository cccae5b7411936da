"""What each level of a morph is cut with: the cutter, and how deep the cut may be.

What a program will take, told before it is planned: length of its passes, blocks, machining time, planning time.

The ball's centre runs on the offset surface of a level at the ball's radius, of area A'; passes a side step L apart,
that on a plane, are A' / L long. A roughing cut leaves out what is shallower than `path.least_depth`. A move is as long
as the curvature k of the offset surface there lets it be within the chord tolerance e, sqrt(8 e / k), or
MAX_STEP. What comes on top (ramps, rest paths, passes that crowd at the poles, links, turns of the rotary axes)
are factors, from the programs of eight bones of 16 to 60 mm (`tests/benchmarks/bench_bones.py`). The cutter of
`path.fine_cutter`, the parting and the second clamping are left out.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import lengths
from bonecam.job import Job
from bonecam.levels.measure import Level, machined_levels
from bonecam.machine.bodies import MachineBodies
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.facets import vertex_normals
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.contacts import DepthLimits
from bonecam.planning.spacing import MAX_STEP, side_step
from bonecam.setup.stock import schedule_of
from bonecam.tool.cutter import Cutter


def cutter_of(level: int, job: Job, bodies: MachineBodies) -> Cutter:
    """The cutter of a level, with the scallop that it may leave there and the feed of that cut."""
    number, name = (2, "finishing") if job.is_finishing(level) else (1, "roughing")
    cutter = Cutter.from_job(number, name, job.tool(name, level), bodies.nose)
    return replace(cutter, scallop=job.scallop(level))


def depth_limits(levels: Sequence[Level], level: int, cutters: Mapping[int, Cutter], job: Job) -> DepthLimits:
    """The depths of the cut that leaves a level."""
    before = cutters.get(level + 1)
    limit, outer = levels[level + 1].limit, levels[min(level + 2, len(levels) - 1)].limit
    return DepthLimits(
        limit, before.scallop if before else 0.0, least_depth(level, job), cutters[level].rest_depth(limit, outer)
    )


def least_depth(level: int, job: Job) -> float:
    """The depth (mm) below which a cut that leaves the level is left to the next one, if that is a roughing one too:
    `path.least_depth`, or half of the scallop that the next one takes off there in any case. The published pattern
    leaves none out, nor do jobs whose least depth is 0."""
    if job.path.pattern == "published":
        return -math.inf
    to_roughing = level > 0 and not job.is_finishing(level) and not job.is_finishing(level - 1)
    if not (to_roughing and job.path.least_depth):
        return 0.0
    return max(job.path.least_depth, job.scallop(level) / 2)


LENGTH_FACTOR = 1.2
"""Passes of programs are 1.04 to 1.39 times as long."""
BLOCK_FACTOR, BLOCKS_A_LEVEL = 2.0, 200
"""Programs have so many blocks a move, and for links and lead arcs of each level so many more."""
TIME_FACTOR, MINUTES_A_LEVEL = 1.4, 0.13
"""Programs take so many times as long as evenly spread passes at the cutter's feed, and for the links and approaches of
each level so much longer; rest paths in hollows (`chosen_cutters.py`) are left out."""
SECONDS_A_LEVEL, SECONDS_A_BLOCK = 2.0, 0.0022
"""CPU seconds that each level, and each block, takes to plan, post, prove and simulate: 0.57 to 1.57 times what 58
bones took beside other work (53 within 1.5), the least where there are more blocks than foretold."""
STAGES = ("toolpath", "nc", "verify", "simulation")
"""Stages of a run whose time is estimated."""


@dataclass(frozen=True)
class Estimate:
    """What a program is expected to take: `length` of its passes (mm), `blocks`, `minutes` of machining, of which the
    `least` are those of evenly spread passes at the cutters' feeds, and CPU `seconds` until it is planned, posted and
    proved."""

    length: float
    blocks: int
    minutes: float
    least: float
    seconds: float

    @property
    def report(self) -> dict[str, Any]:
        """`estimate` of the report."""
        return {
            "length_mm": round(self.length),
            "blocks": self.blocks,
            "machining_min": round(self.minutes, 1),
            "least_min": round(self.least, 1),
            "planning_cpu_s": round(self.seconds),
        }

    def __str__(self) -> str:
        program = f"{self.length / 1000:.1f} m of passes, {self.blocks} blocks, {self.minutes:.0f} min"
        return f"{program}, {self.seconds:.0f} CPU s to plan and prove them"


def estimate(levels: Sequence[Level], job: Job, bodies: MachineBodies) -> Estimate:
    """The estimate for a program that cuts these `levels`, which begin at the part and end at the stock."""
    length = minutes = moves = 0.0
    machined = machined_levels(levels)
    for level in machined:
        cutter = cutter_of(level.index, job, bodies)
        # the share of the area where the cut is at least as deep
        before = levels[level.index + 1]
        least = least_depth(level.index, job)
        shares = np.array(before.measures.depth_shares)
        cut = 1.0
        if len(shares) and least > 0:
            filled = least / before.limit * len(shares) - np.arange(len(shares))
            cut = float(1.0 - np.clip(filled, 0.0, 1.0) @ shares)
        areas, curvatures = _offset(level.mesh, cutter.radius)
        passes = cut * areas / float(side_step(cutter.radius, cutter.scallop, np.zeros(1))[0])
        steps = np.sqrt(8 * job.path.chord_tolerance / np.maximum(curvatures, np.finfo(float).tiny))
        length += float(passes.sum())
        minutes += float(passes.sum()) / cutter.feed
        moves += float((passes / np.minimum(steps, MAX_STEP)).sum())
    blocks = round(BLOCK_FACTOR * moves) + BLOCKS_A_LEVEL * len(machined)
    seconds = SECONDS_A_LEVEL * len(machined) + SECONDS_A_BLOCK * blocks
    whole = TIME_FACTOR * minutes + MINUTES_A_LEVEL * len(machined)
    return Estimate(LENGTH_FACTOR * length, blocks, whole, minutes, seconds)


@dataclass(frozen=True, eq=False)
class LayersToCut:
    """What lies between `part` and `stock`, before there are levels, and how far each face of the stock is from the
    part, mm."""

    part: TriangleMesh
    stock: TriangleMesh
    distances: Float[ndarray, " f"]
    areas: dict[float, tuple[float, float]] = field(default_factory=dict)
    """Areas (mm2) of part and stock moved out by a radius, mm."""

    @classmethod
    def between(cls, part: TriangleMesh, stock: TriangleMesh) -> "LayersToCut":
        """The layers between the meshes of a part and of its stock."""
        return cls(part, stock, MeshDistance(part).unsigned(stock.vertices)[stock.faces].mean(axis=1))

    def minutes(self, job: Job) -> float:
        """Machining time (min) with the depths of a job, as of the `estimate`: of the fewest cuts, whose areas grow
        evenly with the depth, each where the stock is beyond it."""
        schedule = schedule_of(job.levels)
        farthest = float(self.distances.max())
        cuts = schedule.lower_bound(farthest)
        share = lengths(self.stock.face_vectors) / 2 / self.stock.area
        evenly = 0.0
        for level in range(cuts):
            tool = job.tool("finishing" if job.is_finishing(level) else "roughing", level)
            if tool.radius not in self.areas:
                part, stock = (float(_offset(mesh, tool.radius)[0].sum()) for mesh in (self.part, self.stock))
                self.areas[tool.radius] = part, stock
            part, stock = self.areas[tool.radius]
            reach = schedule.reach(level)
            area = (part + (stock - part) * reach / farthest) * float(share[self.distances > reach].sum())
            evenly += area / float(side_step(tool.radius, job.scallop(level), np.zeros(1))[0]) / tool.feed
        return TIME_FACTOR * evenly + MINUTES_A_LEVEL * cuts


def _offset(mesh: TriangleMesh, radius: float) -> tuple[Float[ndarray, " f"], Float[ndarray, " f"]]:
    """Area (mm^2) and curvature (1/mm, the mean of its edges') of each face of the mesh moved out by a radius, mm."""
    normals = vertex_normals(mesh)
    offset = TriangleMesh(mesh.vertices + radius * normals, mesh.faces)
    starts, ends = mesh.faces, np.roll(mesh.faces, -1, axis=1)
    turns = np.linalg.norm(normals[ends] - normals[starts], axis=2)
    edges = np.linalg.norm(offset.vertices[ends] - offset.vertices[starts], axis=2)
    curvatures = (turns / np.maximum(edges, np.finfo(float).eps)).mean(axis=1)
    return np.linalg.norm(offset.face_vectors, axis=1) / 2, curvatures
