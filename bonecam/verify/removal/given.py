"""The mesh as given, against which a program is judged besides its design surface.

Fit and repairs lead from the mesh as given to the design surface, and every path follows that. What a program does to
the part as given is measured here from its text alone: how deep a ball goes into the faces that were given, and how
far the surface that the simulation leaves lies inside and outside of them.
"""

from collections.abc import Mapping
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
    """The faces as given, without debris and inner shells that were left out, in the program's frame; the tool may go
    into them by `allowed` mm: the largest deviation of the job, the deviation of the fit, and the gouge tolerance.

    The mesh need not be closed: distances have no sign. That no ball's centre is inside the part is told by the design
    surface, which is closed.
    """

    distance: MeshDistance
    allowed: float

    def signed(
        self, points: Float[ndarray, "n 3"], wanted: float | Float[ndarray, " n"]
    ) -> Float[ndarray, " n"]:
        """The distance of each point, mm, or `wanted` where that is less."""
        return self.distance.unsigned(points, wanted)

    def check_gouge(self, gouge: Gouge) -> None:
        """VerifyError where a ball goes too deep into the faces."""
        if gouge.depth > self.allowed:
            place = place_name(gouge.place)
            raise VerifyError(
                f"line {gouge.line}: the ball goes {gouge.depth:.4f} mm into the mesh as given at {place}, allowed "
                f"{self.allowed:.4f}: {REMEDY}",
                line=gouge.line,
                place=gouge.place,
                error=gouge.depth,
            )


def given_surface(part: Part, job: Job, report: Mapping[str, Any]) -> GivenSurface:
    """The part as given, and how deep a program of the job may go into it, with the fit's deviation as the `report` has
    it."""
    missed = report["surface"]["deviation_max_mm"]
    allowed = job.surface.largest_deviation + missed + job.path.gouge_tolerance
    return GivenSurface(part.given_distance, allowed)


@dataclass(frozen=True)
class GivenRemoval:
    """How far the surface that a program leaves lies `inside` the mesh as given at most, and `outside` of it away from
    the post, mm, each with its place."""

    inside: float
    inside_place: tuple[float, float, float]
    outside: float
    outside_place: tuple[float, float, float]

    @property
    def report(self) -> dict[str, Any]:
        """`given` of the removal's report."""
        return {
            "gouge_max_mm": round(max(self.inside, 0.0), 4),
            "gouge_place": [round(value, 3) for value in self.inside_place],
            "left_max_mm": round(max(self.outside, 0.0), 4),
            "left_place": [round(value, 3) for value in self.outside_place],
        }


def measure_given(
    normal_probes: NormalProbes, held: Bool[ndarray, " n"], given: GivenSurface
) -> GivenRemoval:
    """Where the cut `normal_probes` end, beside the mesh as given; those `held` at the post tell gouges only.

    VerifyError where the surface lies too deep inside.
    """
    ends = normal_probes.points + normal_probes.heights[:, None] * normal_probes.normals
    away = given.distance.unsigned(ends)
    away = np.where(np.abs(winding_numbers(given.distance.mesh, ends)) > 0.5, -away, away)
    lowest = int(np.argmin(away))
    highest = int(np.argmax(np.where(held, -np.inf, away)))
    low, high = (tuple(float(value) for value in ends[k]) for k in (lowest, highest))
    found = GivenRemoval(
        -float(away[lowest]), (low[0], low[1], low[2]), float(away[highest]), (high[0], high[1], high[2])
    )
    if found.inside > given.allowed:
        raise VerifyError(
            f"what is left lies {found.inside:.4f} mm inside the mesh as given at {place_name(ends[lowest])}, allowed "
            f"{given.allowed:.4f}: {REMEDY}",
            line=0,
            place=found.inside_place,
            error=found.inside,
        )
    return found
