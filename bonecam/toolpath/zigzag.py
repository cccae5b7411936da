"""Zig-zag on a level: iso-parametric lines cut to and fro (Gan et al. 2014, section 4.3), as contacts with
ball centres.

`around`: rings t = const from the free end down to the post; spacing stays nearly even on a closed bone.
`along`: lines s = const from pole to pole, as published; they crowd at the poles.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.errors import ToolPathError
from bonecam.job import PathJob
from bonecam.levels.measure.level import Level
from bonecam.mesh.distance import MeshDistance
from bonecam.setup.holding import Post
from bonecam.toolpath.cutter import Cutter
from bonecam.toolpath.gouge import lift_free
from bonecam.toolpath.material import Material
from bonecam.toolpath.path import ContactPath
from bonecam.toolpath.sampling import frame, sample_lines
from bonecam.toolpath.spacing import line_positions

POST_CLEARANCE = 0.1
THINNEST = 0.002
DEEPEST_RADII = 0.75
"""A ball is never sunk deeper than this many radii into what is left."""
LIFT_LIMIT_RADII = 0.5
"""A ball lifted by more than this many radii does not machine the level any more: its contact is left out."""


@dataclass(frozen=True, eq=False)
class Candidates:
    """The contacts of all lines of a level in machining order, ends of lines included, before any is left
    out.

    `lifts` as `lift_free` has them, NaN where the ball does not fit; `at_post`: too near the post; `air`:
    there is nothing to cut.
    """

    level: Level
    cutter: Cutter
    closed: bool
    line: Int[ndarray, " n"]
    parameters: Float[ndarray, "n 2"]
    contacts: Float[ndarray, "n 3"]
    normals: Float[ndarray, "n 3"]
    feeds: Float[ndarray, "n 3"]
    lifts: Float[ndarray, " n"]
    centres: Float[ndarray, "n 3"]
    at_post: Bool[ndarray, " n"]
    air: Bool[ndarray, " n"]


def candidates(
    level: Level,
    obstacles: Sequence[MeshDistance],
    cutter: Cutter,
    post: Post,
    job: PathJob,
    *,
    post_clearance: float = POST_CLEARANCE,
) -> Candidates:
    """The contacts of a level: cusps <= cutter.scallop, chords <= job.chord_tolerance, no gouge beyond
    tolerance.

    `obstacles` are what the ball must not enter: the level and the part. Nothing here depends on the levels
    cut before.
    """
    surface = level.surface
    assert surface is not None
    across = line_positions(surface, job.direction, cutter.radius, cutter.scallop)
    across = across[::-1] if job.direction == "around" else across
    lines = sample_lines(surface, job.direction, across, cutter.radius, job.chord_tolerance, job.max_step)
    order = _to_and_fro(lines.line)
    line, parameters = lines.line[order], lines.parameters[order]
    contacts, normals, feeds = frame(surface, job.direction, parameters)
    feeds = np.where((line % 2 == 1)[:, None], -feeds, feeds)
    joined = np.r_[line[1:] == line[:-1], False]
    lifts = lift_free(
        contacts,
        normals,
        cutter.radius,
        job.gouge_tolerance,
        obstacles,
        joined,
        LIFT_LIMIT_RADII * cutter.radius,
    )
    centres = contacts + (cutter.radius + np.nan_to_num(lifts))[:, None] * normals
    at_post, closed = post.distance(centres) < cutter.radius + post_clearance, job.direction == "around"
    air = _in_air(level, contacts)
    return Candidates(
        level, cutter, closed, line, parameters, contacts, normals, feeds, lifts, centres, at_post, air
    )


def cover_level(found: Candidates, material: Material | None = None) -> ContactPath:
    """The contacts that machine a level.

    Those too near the post are left uncut (`post`), and those under more `material` than DEEPEST_RADII
    (`covered`: an outer level was left uncut there). Those lifted by more than the scallop are listed as
    uncut (`gouge`) though the lifted ball still passes over them. Of a level that rounds the stock only what
    lies inside the stock is covered. Raises ToolPathError where nothing is left.
    """
    level, cutter, lifts = found.level, found.cutter, found.lifts
    blocked = np.isnan(lifts)
    covered = np.zeros(len(lifts), dtype=bool)
    if material is not None:
        thickness = material.over(level, found.contacts) - np.nan_to_num(lifts)
        covered = ~found.at_post & ~blocked & (thickness > DEEPEST_RADII * cutter.radius)
    left_out = found.at_post | blocked | covered | found.air
    kept, passes = _runs(found.line, ~left_out, found.closed)
    if not len(kept):
        raise ToolPathError(
            f"level {level.index}: nothing can be cut: take a smaller cutter or a thinner post",
            level=level.index,
        )
    missed = ~found.air & (left_out | (lifts > cutter.scallop))
    return ContactPath(
        level.index,
        cutter,
        cutter.scallop,
        passes,
        found.parameters[kept],
        found.contacts[kept],
        found.normals[kept],
        found.feeds[kept],
        found.centres[kept],
        lifts[kept],
        found.contacts[missed],
        tuple(np.select([found.at_post[missed], covered[missed]], ["post", "covered"], "gouge").tolist()),
    )


def _in_air(level: Level, contacts: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
    """Where a level that rounds the stock lies outside it, or has less than THINNEST mm of it to remove:
    there is nothing to cut."""
    if level.within is None:
        return np.zeros(len(contacts), dtype=bool)
    return np.asarray(level.within.signed_distance(contacts) > -THINNEST)


def _to_and_fro(line: Int[ndarray, " n"]) -> Int[ndarray, " n"]:
    """The order that runs through every other line backwards."""
    starts = np.searchsorted(line, np.arange(line[-1] + 2))
    return np.concatenate(
        [np.arange(a, b)[:: -1 if k % 2 else 1] for k, (a, b) in enumerate(pairwise(starts))]
    )


def _runs(
    line: Int[ndarray, " n"], kept: Bool[ndarray, " n"], closed: bool
) -> tuple[Int[ndarray, " m"], Int[ndarray, " m"]]:
    """Contacts that stay, and the pass each belongs to: a line breaks where contacts are left out, a ring
    opens there."""
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
