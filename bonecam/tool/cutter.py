"""A cutter as a stack of revolved shapes above the tip: ball, bull nose or flat end and flutes, shank, holder, spindle
nose; where it must be a ball, and how deep that may sink into the material.

The ball that holds the end of a cutter touches the part where it does, whichever way the cutter leans.

A bull nose of radius R with corners of radius r (a torus) that leans from the normal of the part by the lead angle phi
touches with the circle of its corner whose normals make phi with the axis. All these normals meet on the axis:

    rho = r + (R - r) / sin(phi)    from the contact,
    H   = r + (R - r) cot(phi)      above the tip.

The ball of radius rho about that place holds the end of the cutter, for it is at least as wide as the corner on the
circle where they touch, and cuts the same cusps where the cutter leans along the feed. So a path of its centre that
keeps the ball out of the part keeps the cutter out, and centre and tip lie H apart on every axis. Where the axis leans
by delta more or less the cutter stays off the surface by (R - r) / sin(phi) (1 - cos(delta)).
A ball-end cutter has R = r, and is its own. A flat end has r = 0: its rim lies on the ball.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import frozen
from bonecam.errors import JobError
from bonecam.job import Job, ToolJob, field_error
from bonecam.job.tool_section import misfit
from bonecam.machine.bodies import Frustum, stack_length
from bonecam.machine.machine import Machine


def check_shapes(job: Job, machine: Machine) -> None:
    """JobError where a bull nose or a flat end is asked to do what is planned for balls alone."""
    for name in ("finishing", "fine"):
        if getattr(job, name).shape != "ball":
            raise _refused(job, name, "only a ball finishes")
    if job.roughing.shape == "ball":
        return
    if job.path.strategy != "morph" or job.path.pattern == "published":
        why = "other ends than balls rough the levels of a morph, in other patterns than the published one"
        raise _refused(job, "roughing", why)
    if job.holding.second:
        raise _refused(job, "roughing", "the second clamping roughs with a ball")
    if job.holding.parting:
        raise _refused(job, "roughing", "the groove that parts is turned by a ball")
    if machine.programmed_point == "centre":
        raise _refused(job, "roughing", f"{machine.name} programs the centre of a ball")


def _refused(job: Job, name: str, why: str) -> JobError:
    return field_error(name, "shape", getattr(job, name).shape, f"{why}: give shape = 'ball'")


MAX_DEPTH_RADII = 0.75
"""A ball is never sunk deeper than this many radii into the material."""


def check_depths(job: Job) -> None:
    """JobError where the depth of a cut is more than the ball of its cutter may sink into the material."""
    first, beyond = job.levels.cuts
    for level, depth in enumerate((*first, beyond)):
        section = "finishing" if job.is_finishing(level) else "roughing"
        radius = getattr(job, section).radius
        deepest = MAX_DEPTH_RADII * radius
        if depth > deepest:
            name = "finishing_depth" if level < len(first) else "roughing_depth"
            name = "depths" if job.levels.listed else name
            bound = (
                f"a ball of {section}.radius = {radius:g} mm sinks {deepest:g} mm at most ({MAX_DEPTH_RADII:g} of it)"
            )
            remedy = "give shallower cuts or a larger ball"
            raise field_error("levels", name, getattr(job.levels, name), f"{bound}: {remedy}")


@dataclass(frozen=True)
class EnvelopingBall:
    """A ball of `radius` with its centre at a `height` above the tip, mm."""

    radius: float
    height: float


def enveloping_ball(radius: float, corner: float, lead: float) -> EnvelopingBall:
    """The ball that holds a cutter of this radius with a `corner` (mm) and touches where it leans by `lead` (radians).

    ValueError unless 0 <= corner <= radius and 0 < lead <= a quarter turn.
    """
    if not 0 <= corner <= radius:
        raise ValueError(f"a corner of {corner:g} mm on a radius of {radius:g} mm: give at most that, and 0 or more")
    if not 0 < lead <= math.pi / 2:
        raise ValueError(f"a lead of {lead:g} rad: give more than 0, and at most a quarter turn")
    flat = radius - corner
    return EnvelopingBall(corner + flat / math.sin(lead), corner + flat / math.tan(lead))


REST_SHARE = 0.2
"""Of its radius, that a ball may take in one step of a rest path: 0.4 mm for one of 2 mm."""
TANGENTS = 9
"""Cones that stand for the corner of a bull nose from its bottom to its side, both included: they touch it, and are
0.5 % of its radius off between."""


@dataclass(frozen=True)
class ToolSection:
    """A cylinder or cone about the tool axis: from `start` to `end` (mm from the tip towards the spindle), its
    radius at the start and at the end (mm); `name` is cutter, shank, holder or spindle."""

    name: str
    start: float
    end: float
    radius: float
    end_radius: float

    @property
    def widest(self) -> float:
        """The larger radius, mm."""
        return max(self.radius, self.end_radius)

    @property
    def taper(self) -> float:
        """Growth of the radius along the axis, mm/mm; 0 of a cylinder, and of the flutes of half a ball."""
        length = self.end - self.start
        return (self.end_radius - self.radius) / length if length else 0.0


@dataclass(frozen=True)
class Cutter:
    """A ball-end, bull-nose or flat-end cutter in its holder and spindle; mm. Positions are measured from the tip
    towards the spindle.

    `name` is the section of the job. The `holder` begins at the `overhang` (stick-out), the spindle `nose` behind
    it, at the gauge line. A bull nose has the `corner_radius` (0: a flat end; None: a ball), and leans from the
    normal by the `lead` (radians). What moves is the ball that holds its end (`EnvelopingBall`), a ball-end cutter's
    own. A cutter with a neck has a thinner piece of the shank from the flutes up to `neck_length`.
    Raises JobError where the shapes cannot follow each other from the tip up, or the shank does not fit into the
    holder: radius <= flute_length < neck_length < overhang, shank_diameter <= the holder's.
    """

    number: int
    name: str
    radius: float
    flute_length: float
    shank_diameter: float
    overhang: float
    holder: tuple[Frustum, ...]
    spindle: float
    feed: float
    scallop: float
    nose: tuple[Frustum, ...] = ()
    neck_diameter: float = 0.0
    neck_length: float = 0.0
    flutes: int = 2
    corner_radius: float | None = None
    lead: float = np.pi / 2

    def __post_init__(self) -> None:
        if self.corner_radius is not None and not 0 <= self.corner_radius < self.radius:
            raise self._error("corner_radius", f"give less than the radius ({self.radius:g} mm), and 0 or more")
        if not self.flute_length >= self.centre_height:
            what = "the ball's radius" if not self.is_bull else "what its lead asks for"
            remedy = "" if not self.is_bull else f", or more {self.name}.lead_deg"
            raise self._error("flute_length", f"give at least {what} ({self.centre_height:g} mm){remedy}")
        fault = misfit(self, self.holder[0].diameter)
        if fault:
            raise self._error(*fault)
        if not 0 < self.scallop < self.radius:
            bound = f"give less than the ball's radius ({self.radius:g} mm), and more than 0"
            raise self._error("scallop", bound)
        if not (self.spindle > 0 and self.feed > 0):
            raise ValueError(f"{self.name}: no spindle speed or feed: take the cutter of Job.tool({self.name!r})")

    def _error(self, name: str, bound: str) -> JobError:
        """The error of a value that breaks a bound."""
        return field_error(self.name, name, getattr(self, name), bound)

    @classmethod
    def from_job(cls, number: int, name: str, job: ToolJob, nose: Iterable[Frustum] = ()) -> "Cutter":
        """The cutter of a job (`Job.tool`) in a spindle with this nose; `number` is its place in the tool changer where
        the job gives none."""
        return cls(
            job.number or number,
            name,
            radius=job.radius,
            flute_length=job.flute_length,
            shank_diameter=job.shank_diameter,
            overhang=job.overhang,
            holder=job.holder_stack,
            spindle=job.spindle,
            feed=job.feed,
            scallop=job.scallop,
            nose=tuple(nose),
            neck_diameter=job.neck_diameter,
            neck_length=job.neck_length,
            flutes=job.flutes or cls.flutes,
            corner_radius={"ball": None, "bull": job.corner_radius, "flat": 0.0}[job.shape],
            lead=cls.lead if job.shape == "ball" else float(np.radians(job.lead_deg)),
        )

    def rest_depth(self, limit: float, outer: float) -> float:
        """Depth (mm) of the steps of rest paths before a cut of the depth `limit`, which follows them: as much as the
        cut outside that takes, which the holding bears with `limit` left on the part, or as the ball bears."""
        return max(limit, min(outer, REST_SHARE * self.radius))

    @property
    def is_bull(self) -> bool:
        """Whether it is a bull nose, or a flat end: one with a sharp corner."""
        return self.corner_radius is not None

    @property
    def end_name(self) -> str:
        """What its end is called: ball, bull nose or flat end."""
        return "ball" if self.corner_radius is None else "bull nose" if self.corner_radius else "flat end"

    @property
    def corner(self) -> float:
        """Radius of the arc that cuts, mm: that of the corner, 0 of a flat end, or of the ball."""
        return self.radius if self.corner_radius is None else self.corner_radius

    @property
    def _corner_angles(self) -> Float[ndarray, " t"]:
        """Angles (radians) from straight down of the cones that stand for the corner; a sharp one has bottom and side
        alone."""
        return np.linspace(0, np.pi / 2, TANGENTS if self.corner else 2)

    @cached_property
    def _envelope(self) -> EnvelopingBall:
        """The ball that holds the end of the cutter."""
        return enveloping_ball(self.radius, self.corner, self.lead)

    @property
    def envelope_radius(self) -> float:
        """Radius of the ball that holds the end of the cutter, mm."""
        return self._envelope.radius

    @property
    def centre_height(self) -> float:
        """Height above the tip of the centre of the ball that holds the end of the cutter, mm."""
        return self._envelope.height

    def tips_of(self, centres: Float[ndarray, "*n 3"], axes: Float[ndarray, "*n 3"]) -> Float[ndarray, "*n 3"]:
        """The tips (mm) where the centres of the ball that holds the end are these and the axes so."""
        return np.asarray(centres - self.centre_height * axes)

    def centres_of(self, tips: Float[ndarray, "*n 3"], axes: Float[ndarray, "*n 3"]) -> Float[ndarray, "*n 3"]:
        """The centres (mm) of the ball that holds the end where the tips are these and the axes so."""
        return np.asarray(tips + self.centre_height * axes)

    @cached_property
    def body(self) -> Float[ndarray, "k 3"]:
        """Cones that bound end and flutes of a bull nose: rows (sin phi, cos phi, s), and what they hold has
        sin(phi) r - cos(phi) h <= s at the height h above the ball's centre, r from the axis (mm); bottom first, then
        the side and the top. None of a ball-end cutter, whose capsules are known without."""
        if not self.is_bull:
            return frozen(np.zeros((0, 3)))
        phi = self._corner_angles
        sine, cosine = np.sin(phi), np.cos(phi)
        cosine[-1] = 0.0
        flat = self.radius - self.corner
        corner = flat * sine + self.corner * (1 - cosine) + self.centre_height * cosine
        return frozen(np.vstack([np.column_stack([sine, cosine, corner]), [0.0, -1.0, self.reach]]))

    @property
    def length(self) -> float:
        """From the tip to the far end of the holder: the gauge line, mm."""
        return self.overhang + stack_length(self.holder)

    @property
    def reach(self) -> float:
        """Height of the flutes above the ball's centre, mm."""
        return self.flute_length - self.centre_height

    @cached_property
    def bull_end(self) -> tuple[ToolSection, ...]:
        """Cones and the cylinder of a bull nose from the tip up to where its `profile` begins; none of a ball."""
        if not self.is_bull:
            return ()
        phi = self._corner_angles
        radii = [*(self.radius - self.corner * (1 - np.sin(phi))).tolist(), self.radius]
        heights = [*(self.corner * (1 - np.cos(phi))).tolist(), self.centre_height]
        rows = zip(heights[:-1], heights[1:], radii[:-1], radii[1:], strict=True)
        return tuple(ToolSection("cutter", *row) for row in rows if row[0] < row[1])

    @cached_property
    def profile(self) -> tuple[ToolSection, ...]:
        """Cylinders and cones above the ball's centre, from the tip up: cutter, neck and shank, those of the holder
        and of the spindle."""
        sections = [ToolSection("cutter", self.centre_height, self.flute_length, self.radius, self.radius)]
        for diameter, end in ((self.neck_diameter, self.neck_length), (self.shank_diameter, self.overhang)):
            if end:
                start = sections[-1].end
                sections.append(ToolSection("shank", start, end, diameter / 2, diameter / 2))
        for name, stack in (("holder", self.holder), ("spindle", self.nose)):
            for piece in stack:
                start = sections[-1].end
                radius, top_radius = piece.diameter / 2, piece.top_diameter / 2
                sections.append(ToolSection(name, start, start + piece.length, radius, top_radius))
        return tuple(sections)

    @property
    def sections(self) -> tuple[tuple[str, float, float, float], ...]:
        """(name, start, end, radius) of cylinders that hold cutter, shank and holder; mm from the tip."""
        widest = max(max(piece.diameter, piece.top_diameter) for piece in self.holder)
        return (
            ("cutter", self.centre_height, self.flute_length, self.radius),
            ("shank", self.flute_length, self.overhang, self.shank_diameter / 2),
            ("holder", self.overhang, self.length, widest / 2),
        )
