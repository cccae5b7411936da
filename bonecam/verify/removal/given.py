"""The mesh as given, against which a program is judged besides its design surface.

Fit and repairs lead from the mesh as given to the design surface, and every path follows that. What a program does to
the part as given is measured here from its text alone: how deep a ball goes into the faces that were given, and how
far the surface that the simulation leaves lies inside and outside of them.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.errors import VerifyError, place_name
from bonecam.job import Job
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.healing.surface_moves import winding_numbers
from bonecam.mesh.part import Part
from bonecam.verify.gouge import Gouge
from bonecam.verify.removal.normal_probes import NormalProbes

REMEDY = "mend the mesh there, raise surface.max_control_points, or raise surface.largest_deviation"
"""What to do where a program goes too deep into the mesh as given."""


@dataclass(frozen=True, eq=False)
class GivenSurface:
    """Distances to the faces as given, without debris and inner shells that were left out, in the program's frame; the
    tool may go into them by `allowed` mm (`allowed_depth`).

    The mesh need not be closed: distances have no sign. That no ball's centre is inside the part is told by the design
    surface, which is closed.
    """

    distance: MeshDistance
    allowed: float

    def signed(self, points: Float[ndarray, "n 3"], wanted: float | Float[ndarray, " n"]) -> Float[ndarray, " n"]:
        """The distance of each point, mm, or `wanted` where that is less."""
        return self.distance.unsigned(points, wanted)

    def move(self, pose: Float[ndarray, "4 4"]) -> "GivenSurface":
        """The faces under a rigid transform (4, 4)."""
        return GivenSurface(MeshDistance(self.distance.mesh.move(pose)), self.allowed)

    def check_gouge(self, gouge: Gouge) -> None:
        """VerifyError where a ball goes too deep into the faces."""
        _check_ball(gouge, self.allowed)


def allowed_depth(job: Job, missed: float, smoothed: float) -> float:
    """How deep a program of the job may go into the mesh as given, mm: by the largest deviation of the job, the
    deviation of the fit (`missed`), the gouge tolerance, and what a smooth surface in place of coarse facets took off
    them (`smoothed`, which `mesh.smooth_within` bounds)."""
    return job.surface.largest_deviation + missed + job.path.gouge_tolerance + smoothed


def given_surface(part: Part, job: Job, report: Mapping[str, Any]) -> GivenSurface:
    """The part as given, and how deep a program of the job may go into it, with the fit's deviation as the `report` has
    it."""
    missed = report["surface"]["deviation_max_mm"]
    smoothed = part.smoothing.inward if part.smoothing else 0.0
    return GivenSurface(part.given_distance, allowed_depth(job, missed, smoothed))


@dataclass(frozen=True)
class GivenRemoval:
    """How far the surface that a program leaves lies `inside` the mesh as given at most, and `outside` of it away from
    the post, mm, each with its place; and where a `ball` goes deepest into it, None where the proof of the text tells
    that. Both may be `allowed` mm."""

    inside: float
    inside_place: tuple[float, float, float]
    outside: float
    outside_place: tuple[float, float, float]
    allowed: float
    ball: Gouge | None = None

    @property
    def report(self) -> dict[str, Any]:
        """`given` of the removal's report."""
        return {
            "gouge_max_mm": round(max(self.inside, 0.0), 4),
            "gouge_place": [round(value, 3) for value in self.inside_place],
            "left_max_mm": round(max(self.outside, 0.0), 4),
            "left_place": [round(value, 3) for value in self.outside_place],
        }

    def check(self) -> None:
        """VerifyError where a ball goes, or what is left lies, too deep inside."""
        if self.ball is not None:
            _check_ball(self.ball, self.allowed)
        if self.inside > self.allowed:
            raise VerifyError(
                f"what is left lies {self.inside:.4f} mm inside the mesh as given at {place_name(self.inside_place)}, "
                f"allowed {self.allowed:.4f}: {REMEDY}",
                line=0,
                place=self.inside_place,
                error=self.inside,
            )


@dataclass(frozen=True)
class NotJudged:
    """Why a program was not judged against the mesh as given."""

    why: str

    @property
    def report(self) -> dict[str, str]:
        """`given` of the removal's report."""
        return {"skipped": f"not judged against the mesh as given: {self.why}"}

    def move(self, pose: Float[ndarray, "4 4"]) -> "NotJudged":
        """There is nothing to move."""
        return self

    def check(self) -> None:
        """Nothing is known that would refuse the program."""


def measure_given(
    normal_probes: NormalProbes, held: Bool[ndarray, " n"], given: GivenSurface, ball: Gouge | None = None
) -> GivenRemoval:
    """Where the cut probes end, beside the mesh as given; those `held` at the post tell gouges only. `ball` is where
    one goes deepest, if that was measured."""
    ends = normal_probes.points + normal_probes.heights[:, None] * normal_probes.normals
    away = given.distance.unsigned(ends)
    away = np.where(np.abs(winding_numbers(given.distance.mesh, ends)) > 0.5, -away, away)
    lowest = int(np.argmin(away))
    highest = int(np.argmax(np.where(held, -np.inf, away)))
    low, high = (tuple(float(value) for value in ends[k]) for k in (lowest, highest))
    return GivenRemoval(
        inside=-float(away[lowest]),
        inside_place=(low[0], low[1], low[2]),
        outside=float(away[highest]),
        outside_place=(high[0], high[1], high[2]),
        allowed=given.allowed,
        ball=ball,
    )


def into_given(nc: Mapping[str, Any], label: str = "") -> Iterator[str]:
    """How deep the ball goes into the mesh as given, in words behind a `label`, where `nc` of a report tells it."""
    if "gouge_to_given_max_mm" in nc:
        yield f"{label:10}{nc['gouge_to_given_max_mm']:.3f} mm into the mesh as given at most"


def given_lines(given: Mapping[str, Any] | None) -> Iterator[str]:
    """`given` of a removal's report in words, a line each."""
    if not given:
        return
    if "skipped" in given:
        yield str(given["skipped"])
        return
    inside, outside = given["gouge_max_mm"], given["left_max_mm"]
    yield f"what is left lies {inside:.3f} mm inside the mesh as given at most, {outside:.3f} mm outside"


def _check_ball(gouge: Gouge, allowed: float) -> None:
    """VerifyError where a ball goes more than `allowed` mm into the mesh as given."""
    if gouge.depth > allowed:
        place = place_name(gouge.place)
        raise VerifyError(
            f"line {gouge.line}: the ball goes {gouge.depth:.4f} mm into the mesh as given at {place}, allowed "
            f"{allowed:.4f}: {REMEDY}",
            line=gouge.line,
            place=gouge.place,
            error=gouge.depth,
        )
