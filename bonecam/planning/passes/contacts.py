"""The contacts and ball centres of a level on the curves of a pattern (`patterns/`).

`along`: lines s = const, as published (Gan et al. 2014, section 4.3); at the poles of a closed bone, where they crowd,
only those that are needed. `published`: all of them, whole. `round`: lines t = const, from the free end down to the
post. `iso-scallop`: curves along the part, each at the local step from the one before. `spiral`: one curve round the
part. `bands`: bands round the part with lines of their own.

The error of a level none of whose contacts can be machined.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.errors import ToolPathError
from bonecam.job import PathJob
from bonecam.levels.measure.level import MachinedLevel, RoundedLevel
from bonecam.material.in_process_stock import InProcessStock
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.facets.nearest_areas import nearest_areas
from bonecam.planning.passes.engaged_segments import (
    ANYTHING,
    DepthLimits,
    EngagedSegments,
    Lines,
    cutting_passes,
    useful_passes,
    whole_passes,
)
from bonecam.planning.passes.gouge_lifts import gouge_free_lifts, planned_tolerance
from bonecam.planning.passes.patterns.fastest import pattern_curves
from bonecam.planning.passes.patterns.order import order_curves
from bonecam.planning.passes.patterns.post_ring import LineContacts, post_rings
from bonecam.planning.passes.patterns.sampling import contact_frames, sample_lines
from bonecam.tool.ball_depth import MAX_DEPTH_RADII
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import ContactPath
from bonecam.workholding.column import Column
from bonecam.workholding.post import Post

WHY_NOTHING = {
    "post": "are too near the post: take a thinner post (holding.diameter) or a smaller cutter",
    "gouge": "lie where the ball does not fit: take a smaller cutter",
    "covered": "lie under what the levels round it left uncut: give the tool more room there, by a longer "
    "overhang, a slimmer holder, a longer or thinner post",
}
"""What to do where a level cannot be cut at all, by the reason that most of its contacts have."""


def nothing_to_cut(level: MachinedLevel, reasons: ndarray, contacts: Float[ndarray, "n 3"]) -> ToolPathError:
    """The error of a level none of whose contacts can be machined, for these reasons."""
    names, counts = np.unique(reasons, return_counts=True)
    most = str(names[np.argmax(counts)])
    area = float(nearest_areas(level.mesh, contacts)[reasons == most].sum())
    what = f"{counts.max()} of its {len(reasons)} contacts ({area:.1f} mm2) {WHY_NOTHING[most]}"
    evidence = {"level": level.index, "reason": most, "area_mm2": area}
    return ToolPathError(f"level {level.index}: nothing can be cut: {what}", **evidence)


POST_CLEARANCE = 0.1
"""The ball keeps this far from the post, mm."""
MIN_THICKNESS = 0.002
"""Less material than this (mm) above a contact is air: a fifth of the gouge allowed by default."""
MAX_LIFT_RADII = 0.5
"""A ball lifted by more than this many radii does not machine the level any more: its contact is left out."""


def at_post(
    points: Float[ndarray, "n 3"], normals: Float[ndarray, "n 3"], post: Post, radius: float
) -> Bool[ndarray, " n"]:
    """Which places of the part stay at the post: those under it, and those that a ball of `radius` (mm) which keeps
    off the post leaves round it."""
    centres = points + radius * normals
    return np.minimum(post.distance(points), post.distance(centres) - POST_CLEARANCE) < radius


@dataclass(frozen=True, eq=False)
class CandidateContacts:
    """All contacts on the lines of a level in machining order, before any is left out.

    `line` is the number of each contact's line; a ring has its first contact again at its end. `lifts` as
    `gouge_free_lifts` has them, NaN where the ball does not fit. `at_post`: too near the post; `in_air`: there
    is nothing to cut. The ball stays out of the `obstacles` by the `gouge_tolerance` (mm).
    """

    level: MachinedLevel
    cutter: Cutter
    line: Int[ndarray, " n"]
    parameters: Float[ndarray, "n 2"]
    contacts: Float[ndarray, "n 3"]
    normals: Float[ndarray, "n 3"]
    feeds: Float[ndarray, "n 3"]
    lifts: Float[ndarray, " n"]
    centres: Float[ndarray, "n 3"]
    at_post: Bool[ndarray, " n"]
    in_air: Bool[ndarray, " n"]
    obstacles: tuple[MeshDistance, ...]
    gouge_tolerance: float

    @property
    def lines(self) -> Lines:
        """The lines of the contacts."""
        return Lines(self.line, self.centres, self.normals)

    @property
    def usable(self) -> Bool[ndarray, " n"]:
        """The contacts that the ball reaches and that have something to cut, whatever stands on them."""
        return ~(self.at_post | np.isnan(self.lifts) | self.in_air)

    def depths(self, material: InProcessStock) -> Float[ndarray, " n"]:
        """How deep the ball enters the material at each contact, mm."""
        return material.depths(self.centres, self.cutter.envelope_radius)[0]

    def path_of(self, segments: EngagedSegments) -> ContactPath:
        """The path over segments of these contacts; none of them is told uncut."""
        kept = segments.index
        return ContactPath(
            level=self.level.index,
            cutter=self.cutter,
            pass_index=segments.passes,
            parameters=self.parameters[kept],
            contacts=self.contacts[kept],
            normals=self.normals[kept],
            feeds=self.feeds[kept],
            centres=self.centres[kept] + segments.raised,
            lifts=self.lifts[kept],
            ramp=segments.ramp,
            uncut=np.zeros((0, 3)),
            reasons=(),
        )


def candidate_contacts(
    level: MachinedLevel,
    obstacles: Sequence[MeshDistance],
    cutter: Cutter,
    post: Post,
    job: PathJob,
    *,
    turn_speed: float = np.inf,
    post_clearance: float = POST_CLEARANCE,
    walls: Sequence[LineContacts] = (),
    kept_off: Sequence[Column] = (),
) -> CandidateContacts:
    """The contacts of a level whatever the material: cusps <= cutter.scallop, chords <= job.chord_tolerance,
    no gouge beyond job.gouge_tolerance. ValueError where `job.pattern` needs a surface of another kind.

    `turn_speed` (rad/min) is that of the axis that changes the azimuth; it decides what is fastest.
    `obstacles` are what the ball must not enter: the level and the part; the lines of `walls` follow those of the
    pattern. A ball that enters a column that is `kept_off`, below the post, counts as at the post.
    """
    surface = level.surface
    curves = pattern_curves(surface, job.pattern, cutter, turn_speed)
    curves = order_curves(surface, curves, job.direction)
    lines = sample_lines(surface, curves, cutter.envelope_radius, job.chord_tolerance, job.max_step)
    line = lines.line
    parameters, directions = curves.at(line, lines.x)
    contacts, normals, feeds = contact_frames(surface, parameters, directions)
    rings = post_rings(surface, post, cutter.envelope_radius, cutter.envelope_radius + post_clearance)
    for added in [*walls, *rings]:
        line = np.r_[line, np.full(len(added.parameters), line[-1] + 1)]
        parameters = np.vstack([parameters, added.parameters])
        contacts = np.vstack([contacts, added.contacts])
        normals = np.vstack([normals, added.normals])
        feeds = np.vstack([feeds, added.feeds])

    joined = np.r_[line[1:] == line[:-1], False]
    max_lift = MAX_LIFT_RADII * cutter.radius
    tolerance = planned_tolerance(job.gouge_tolerance)
    lifts = gouge_free_lifts(
        contacts, normals, cutter.envelope_radius, tolerance, obstacles, joined=joined, max_lift=max_lift
    )
    centres = contacts + (cutter.envelope_radius + np.nan_to_num(lifts))[:, None] * normals
    at_post = post.distance(centres) < cutter.envelope_radius + post_clearance
    for column in kept_off:
        at_post |= column.distance(centres) < cutter.envelope_radius
    in_air = _in_air(level, contacts)
    return CandidateContacts(
        level=level,
        cutter=cutter,
        line=line,
        parameters=parameters,
        contacts=contacts,
        normals=normals,
        feeds=feeds,
        lifts=lifts,
        centres=centres,
        at_post=at_post,
        in_air=in_air,
        obstacles=tuple(obstacles),
        gouge_tolerance=tolerance,
    )


def contact_path(
    candidates: CandidateContacts,
    material: InProcessStock | None = None,
    allowed: DepthLimits = ANYTHING,
    deepest: float = np.inf,
) -> ContactPath:
    """The contacts of a level that can be machined while `material` is left on it, but for where the ball would
    remove less than is `allowed` (`engaged_segments.py`).

    Left out are contacts too near the post (`post`), under more material than MAX_DEPTH_RADII or where the ball would
    enter it by more than `deepest` mm (`covered`: an outer level was left uncut there), or where the ball does not fit
    (`gouge`). Those lifted by more than the scallop are listed as uncut (`gouge`) though the lifted ball still passes
    over them. Of a level that rounds the edges of the stock only what lies inside the stock is covered, which may be
    nothing. Raises ToolPathError where nothing is left of another level.
    """
    level, cutter, lifts = candidates.level, candidates.cutter, candidates.lifts
    blocked = np.isnan(lifts)
    covered = np.zeros(len(lifts), dtype=bool)
    if material is not None:
        depth = material.thickness(level, candidates.contacts) - np.nan_to_num(lifts)
        covered = ~candidates.at_post & ~blocked & (depth > MAX_DEPTH_RADII * cutter.radius)
        if np.isfinite(deepest):
            covered |= candidates.usable & (candidates.depths(material) > deepest)

    left_out = candidates.at_post | blocked | covered | candidates.in_air
    uncut = ~candidates.in_air & (left_out | (lifts > cutter.scallop))
    reasons = np.select([candidates.at_post[uncut], covered[uncut]], ["post", "covered"], "gouge")
    if left_out.all() and not isinstance(level, RoundedLevel):
        raise nothing_to_cut(level, reasons, candidates.contacts[uncut])
    segments = _stretches(candidates, ~left_out, material, allowed)
    return replace(
        candidates.path_of(segments),
        uncut=np.vstack([candidates.contacts[uncut], candidates.contacts[segments.short]]),
        reasons=(*reasons.tolist(), *("short",) * len(segments.short)),
        trimmed=_trimmed(candidates, ~left_out, segments),
    )


def _trimmed(candidates: CandidateContacts, usable: Bool[ndarray, " n"], segments: EngagedSegments) -> float:
    """Length of the usable moves that no stretch passes over, mm."""
    passed = np.zeros(len(usable), dtype=bool)
    passed[segments.index] = True
    same = candidates.line[1:] == candidates.line[:-1]
    left = same & usable[1:] & usable[:-1] & ~(passed[1:] & passed[:-1])
    return float(np.linalg.norm(np.diff(candidates.centres, axis=0), axis=1)[left].sum())


def _stretches(
    candidates: CandidateContacts, usable: Bool[ndarray, " n"], material: InProcessStock | None, allowed: DepthLimits
) -> EngagedSegments:
    """The passes over the usable contacts where they are worth a cut, also behind the passes before them."""
    lines = candidates.lines
    if material is None or not np.isfinite(allowed.limit):
        return whole_passes(lines, usable)
    in_air = candidates.in_air & ~(candidates.at_post | np.isnan(candidates.lifts))
    depths = candidates.depths(material)
    segments = cutting_passes(lines, usable, depths, allowed, in_air)
    if allowed.least <= 0 or not candidates.level.index or isinstance(candidates.level, RoundedLevel):
        # what stays on the part is not cut later; and the places of the material do not follow the edges of a bar
        return segments
    radius = candidates.cutter.envelope_radius
    centres = candidates.centres[segments.index] + segments.raised
    useful = np.zeros(len(usable), dtype=bool)
    lowers = material.useful(candidates.level, centres, segments.passes, radius, allowed.least)
    useful[segments.index[lowers]] = True
    return useful_passes(lines, useful & usable, usable | in_air, depths, allowed)


def _in_air(level: MachinedLevel, contacts: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
    """Where a level that rounds the edges of the stock has less than MIN_THICKNESS of it to remove."""
    if not isinstance(level, RoundedLevel):
        return np.zeros(len(contacts), dtype=bool)
    return level.stock.signed_distance(contacts) > -MIN_THICKNESS
