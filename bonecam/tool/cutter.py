"""A cutter as a stack of revolved shapes above the tip: ball and flutes, shank, holder, spindle
nose; and how deep a ball may sink into the material.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import JobError
from bonecam.job import Job, ToolJob, field_error
from bonecam.job.tool_section import misfit
from bonecam.machine.bodies import Frustum, stack_length

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


REST_SHARE = 0.2
"""Of its radius, that a ball may take in one step of a rest path: 0.4 mm for one of 2 mm."""


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
    """A ball-end cutter in its holder and spindle; mm. Positions are measured from the tip
    towards the spindle.

    `name` is the section of the job. The `holder` begins at the `overhang` (stick-out), the spindle `nose` behind
    it, at the gauge line. What moves is its ball. A cutter with a neck has a thinner piece of the shank from the flutes
    up to `neck_length`.
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

    def __post_init__(self) -> None:
        if not self.flute_length >= self.radius:
            raise self._error("flute_length", f"give at least the ball's radius ({self.radius:g} mm)")
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
        )

    def rest_depth(self, limit: float, outer: float) -> float:
        """Depth (mm) of the steps of rest paths before a cut of the depth `limit`, which follows them: as much as the
        cut outside that takes, which the holding bears with `limit` left on the part, or as the ball bears."""
        return max(limit, min(outer, REST_SHARE * self.radius))

    def tips_of(self, centres: Float[ndarray, "*n 3"], axes: Float[ndarray, "*n 3"]) -> Float[ndarray, "*n 3"]:
        """The tips (mm) where the centres of the ball are these and the axes so."""
        return np.asarray(centres - self.radius * axes)

    def centres_of(self, tips: Float[ndarray, "*n 3"], axes: Float[ndarray, "*n 3"]) -> Float[ndarray, "*n 3"]:
        """The centres (mm) of the ball where the tips are these and the axes so."""
        return np.asarray(tips + self.radius * axes)

    @property
    def length(self) -> float:
        """From the tip to the far end of the holder: the gauge line, mm."""
        return self.overhang + stack_length(self.holder)

    @property
    def reach(self) -> float:
        """Height of the flutes above the ball's centre, mm."""
        return self.flute_length - self.radius

    @cached_property
    def profile(self) -> tuple[ToolSection, ...]:
        """Cylinders and cones above the ball's centre, from the tip up: cutter, neck and shank, those of the holder
        and of the spindle."""
        sections = [ToolSection("cutter", self.radius, self.flute_length, self.radius, self.radius)]
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
            ("cutter", self.radius, self.flute_length, self.radius),
            ("shank", self.flute_length, self.overhang, self.shank_diameter / 2),
            ("holder", self.overhang, self.length, widest / 2),
        )
