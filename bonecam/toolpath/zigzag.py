"""Zig-zag on a level: iso-parametric lines cut to and fro (Gan et al. 2014, section 4.3), as contacts with ball centres.

`around`: rings t = const from the free end down to the post; spacing stays nearly even on a closed bone.
`along`: lines s = const from pole to pole, as published; they crowd at the poles.
"""

from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Int
from numpy import ndarray

from bonecam.errors import ToolPathError
from bonecam.job import PathJob
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.surface.tspline import TSpline
from bonecam.toolpath.cutter import Cutter
from bonecam.toolpath.gouge import lift_free
from bonecam.toolpath.path import ContactPath
from bonecam.toolpath.post import Post
from bonecam.toolpath.sampling import frame, sample_lines
from bonecam.toolpath.spacing import line_positions

POST_CLEARANCE = 0.1
LIFT_LIMIT_RADII = 0.5
"""A ball lifted by more than this many radii does not machine the level any more: its contact is left out."""


def cover_level(
    level: int,
    surface: TSpline,
    level_mesh: TriangleMesh,
    part_mesh: TriangleMesh,
    cutter: Cutter,
    post: Post,
    job: PathJob,
    *,
    post_clearance: float = POST_CLEARANCE,
) -> ContactPath:
    """The contacts that machine `surface`: cusps <= cutter.scallop, chords <= job.chord_tolerance, no gouge beyond tolerance.

    `level_mesh` and `part_mesh` (closed, outward) are what the ball must not enter. Contacts whose ball would come within
    `post_clearance` of the post are left uncut (`post`), those lifted by more than the scallop are listed as uncut (`gouge`)
    though the lifted ball still passes over them. Raises ToolPathError where nothing is left to cut.
    """
    across = line_positions(surface, job.direction, cutter.radius, cutter.scallop)
    across = across[::-1] if job.direction == "around" else across
    lines = sample_lines(surface, job.direction, across, cutter.radius, job.chord_tolerance, job.max_step)
    order = _to_and_fro(lines.line)
    line, parameters = lines.line[order], lines.parameters[order]
    contacts, normals, feeds = frame(surface, job.direction, parameters)
    feeds = np.where((line % 2 == 1)[:, None], -feeds, feeds)
    joined = np.r_[line[1:] == line[:-1], False]
    obstacles = [MeshDistance(level_mesh)] if level == 0 else [MeshDistance(level_mesh), MeshDistance(part_mesh)]
    lifts = lift_free(contacts, normals, cutter.radius, job.gouge_tolerance, obstacles, joined, LIFT_LIMIT_RADII * cutter.radius)
    blocked = np.isnan(lifts)
    centres = contacts + (cutter.radius + np.where(blocked, 0.0, lifts))[:, None] * normals
    at_post = post.distance(centres) < cutter.radius + post_clearance
    kept, passes = _runs(line, ~(at_post | blocked), closed=job.direction == "around")
    if not len(kept):
        raise ToolPathError(f"level {level}: nothing can be cut: take a smaller cutter or a thinner post", level=level)
    missed = at_post | blocked | (lifts > cutter.scallop)
    return ContactPath(
        level,
        cutter,
        cutter.scallop,
        passes,
        parameters[kept],
        contacts[kept],
        normals[kept],
        feeds[kept],
        centres[kept],
        lifts[kept],
        contacts[missed],
        tuple(np.where(at_post[missed], "post", "gouge").tolist()),
    )


def _to_and_fro(line: Int[ndarray, " n"]) -> Int[ndarray, " n"]:
    """The order that runs through every other line backwards."""
    starts = np.searchsorted(line, np.arange(line[-1] + 2))
    return np.concatenate([np.arange(a, b)[:: -1 if k % 2 else 1] for k, (a, b) in enumerate(pairwise(starts))])


def _runs(line: Int[ndarray, " n"], kept: Bool[ndarray, " n"], closed: bool) -> tuple[Int[ndarray, " m"], Int[ndarray, " m"]]:
    """Contacts that stay, and the pass each belongs to: a line breaks where contacts are left out, a ring opens there."""
    starts = np.searchsorted(line, np.arange(line[-1] + 2))
    order: list[ndarray] = []
    passes: list[ndarray] = []
    count = 0
    for a, b in pairwise(starts):
        here = np.arange(a, b)
        gap = np.flatnonzero(~kept[here])
        if closed and len(gap) and kept[here[0]]:
            here = np.r_[here[gap[0] : -1], here[: gap[0]]]
        breaks = np.flatnonzero(~kept[here])
        for run in np.split(here, breaks):
            run = run[kept[run]]
            if len(run):
                order.append(run)
                passes.append(np.full(len(run), count))
                count += 1
    if not order:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    return np.concatenate(order), np.concatenate(passes)
