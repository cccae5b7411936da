"""The parting pass: a groove round the post below the finished part, down to a bridge that still holds the part.

The ball goes round the Z axis at one height, in steps: each begins a quarter of a turn earlier where the one before
ended, comes down to its depth on that ramp, and goes once round. What it removes is then no deeper than the step.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.job import HoldingJob, Job, PathJob
from bonecam.machine.bodies import MachineBodies
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.passes.contacts import POST_CLEARANCE
from bonecam.tool.ball_depth import MAX_DEPTH_RADII
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import PARTING, ContactPath, MoveKind, ToolPath
from bonecam.workholding.post import Post

RAMP = np.pi / 2
"""Each step comes down over this angle, radians."""
BESIDE = 0.5
"""Vertices of the material so far above and below the groove count as beside it, mm: as far apart as they are."""


@dataclass(frozen=True)
class Groove:
    """A groove that balls of `radius` cut round the Z axis with their centres at the height `middle`; it goes from the
    `outer` radius of what stands round the post to that of the `bridge`, mm."""

    middle: float
    radius: float
    bridge: float
    outer: float

    @property
    def bottom(self) -> float:
        """Height of the groove's lower edge, mm."""
        return self.middle - self.radius

    def floors(self, limit: float) -> list[float]:
        """Radii (mm) of the groove's bottom before and after each step; a step is no deeper than `limit` (mm) and
        than the ball may sink."""
        step = min(limit, MAX_DEPTH_RADII * self.radius)
        count = int(np.ceil((self.outer - self.bridge) / step))
        return np.linspace(self.outer, self.bridge, count + 1).tolist()

    def outline(self, post: float, points: int = 24) -> Float[ndarray, "k 2"]:
        """Radii and heights (mm) of the groove's bottom in a post of this radius, from the lower edge up."""
        angle = np.linspace(-np.pi / 2, np.pi / 2, points)
        radii = self.bridge + self.radius * (1 - np.cos(angle))
        heights = self.middle + self.radius * np.sin(angle)
        inside = radii < post
        edge = np.array([[post, heights[inside][0]], [post, heights[inside][-1]]])
        return np.vstack([edge[:1], np.column_stack([radii, heights])[inside], edge[1:]])


def cut_groove(paths: Sequence[ToolPath]) -> Groove | None:
    """The groove that paths cut, if they part."""
    parting = [path for path in paths if path.level == PARTING]
    if not parting:
        return None
    radius = parting[0].cutter.radius
    contacts = np.vstack([path.contacts[path.kinds == MoveKind.CUT] for path in parting])
    radii = np.hypot(contacts[:, 0], contacts[:, 1])
    return Groove(float(contacts[0, 2]), radius, float(radii.min()), float(radii.max()))


def groove_below(
    lowest: float, post: Post, holding: HoldingJob, cutter: Cutter, standing: TriangleMesh | None = None
) -> Groove:
    """The groove of a cutter below a part whose `lowest` point is at this height, mm; it begins outside of the post
    and of what is `standing` round it."""
    middle = lowest - holding.parting_stand_off - cutter.radius
    vertices = np.zeros((0, 3)) if standing is None else standing.vertices
    beside = vertices[np.abs(vertices[:, 2] - middle) < cutter.radius + BESIDE]
    widest = np.hypot(beside[:, 0], beside[:, 1]).max(initial=post.radius)
    return Groove(middle, cutter.radius, holding.bridge / 2, float(widest) + POST_CLEARANCE)


def parting_cutters(job: Job, bodies: MachineBodies) -> Iterator[Cutter]:
    """The cutters that may turn the groove, the stiffer one first."""
    for number, name in enumerate(("roughing", "finishing"), 1):
        yield Cutter.from_job(number, name, job.tool(name), bodies.nose)


def parting_contacts(groove: Groove, cutter: Cutter, job: Job) -> Iterator[ContactPath]:
    """The contacts of each step of the groove, a pass each; a step is no deeper than a roughing cut."""
    for number, (before, floor) in enumerate(pairwise(groove.floors(job.levels.layer_depth)), 1):
        yield _step(groove.middle, before, floor=floor, number=number, cutter=cutter, job=job.path)


def groove_core(contacts: ContactPath, post: Post) -> Post:
    """What stays of the post within a step of the groove, less POST_CLEARANCE."""
    floor = float(np.hypot(*contacts.contacts[-1, :2]))
    return Post(floor - POST_CLEARANCE, post.top)


def _step(middle: float, before: float, floor: float, number: int, cutter: Cutter, job: PathJob) -> ContactPath:
    """The contacts of one step, from the radius `before` to the `floor` (mm), counter-clockwise."""
    farthest = before + cutter.radius
    half = np.arccos(1 - job.chord_tolerance / farthest)
    turn = min(2 * half, job.max_step / farthest)
    ramp = np.linspace(-RAMP, 0.0, int(np.ceil(RAMP / turn)) + 1)
    angle = np.r_[ramp[:-1], np.linspace(0.0, 2 * np.pi, int(np.ceil(2 * np.pi / turn)) + 1)]
    radii = np.asarray(np.interp(angle, [-RAMP, 0.0], [before, floor]))
    normals = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(len(angle))])
    up = np.array([0.0, 0.0, middle])
    return ContactPath(
        level=PARTING,
        cutter=cutter,
        pass_index=np.zeros(len(angle), dtype=np.int64),
        parameters=np.full((len(angle), 2), np.nan),
        contacts=radii[:, None] * normals + up,
        normals=normals,
        feeds=np.column_stack([-np.sin(angle), np.cos(angle), np.zeros(len(angle))]),
        centres=(radii + cutter.radius)[:, None] * normals + up,
        lifts=np.zeros(len(angle)),
        ramp=np.zeros(len(angle), dtype=bool),
        uncut=np.zeros((0, 3)),
        reasons=(),
        rest=number,
    )
