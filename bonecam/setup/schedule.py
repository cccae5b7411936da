"""Which depth each cut may have: finishing depths next to the part, the roughing depth beyond (Gan et al.
2014, section 4.2).

Cut k removes what lies between level k - 1 and level k. No sequence of cuts can beat
`K_min = min{K : sum_{k <= K} eps_k >= d}`, d being the largest distance from the stock's surface to the part.
"""

import math
from dataclasses import dataclass
from numbers import Real

import numpy as np

from bonecam.arrays import ROUNDING
from bonecam.errors import LevelError, StockError, place_name
from bonecam.job import LevelsJob, field_error
from bonecam.job.levels_section import MOST_LEVELS
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.setup.stock import Stock

LEAST = 1e-4
"""Least depth of a cut, mm."""
STOCK_CHORD = 0.1
"""Chord tolerance of the stock's mesh that the number of cuts is counted on, mm."""
STOCK_CHORD_SHARE = 0.002
"""That chord tolerance as a share of the stock's diameter, where that is more."""

FARTHEST_DIAGONALS = 3.0
"""A stock further from the part than so many of its diagonals is refused. Levels are meshed as finely as the
part: those of a ball of 3 mm in a cube of 60 mm, ten diagonals away, were not made in 40 s of computing."""


@dataclass(frozen=True)
class Schedule:
    """Depths in mm of the first cuts above the part, and of all others."""

    first: tuple[float, ...]
    beyond: float

    def __post_init__(self) -> None:
        if not (isinstance(self.first, tuple) and all(isinstance(depth, Real) for depth in (*self.first, self.beyond))):
            raise TypeError(
                f"Schedule({self.first!r}, {self.beyond!r}): give depths in mm like Schedule((0.1, 0.1), 0.5)"
            )
        object.__setattr__(
            self, "first", tuple(map(float, self.first))
        )  # sums of numpy's small integers would overflow
        object.__setattr__(self, "beyond", float(self.beyond))
        for k, depth in enumerate((*self.first, self.beyond), start=1):
            if not LEAST <= depth < math.inf:
                raise LevelError(
                    f"cut {k} has the depth {depth} mm: give a finite depth of at least {LEAST} mm", level=k
                )

    def limit(self, k: int) -> float:
        """Largest depth of cut k >= 1, mm."""
        return self.first[k - 1] if k <= len(self.first) else self.beyond

    def reach(self, k: int) -> float:
        """The sum of the depths of cuts 1..k, mm."""
        return sum(self.first[:k]) + max(0, k - len(self.first)) * self.beyond

    def lower_bound(self, distance: float) -> int:
        """K_min: the fewest cuts that can remove `distance` mm. LevelError where they are more than
        MOST_LEVELS."""
        if math.isnan(distance):
            raise LevelError("a distance of nan mm has no number of cuts: give a number")
        for k in range(1, MOST_LEVELS + 1):
            if self.reach(k) >= distance - ROUNDING:
                return k
        raise LevelError(
            f"{distance:.1f} mm of material need more than {MOST_LEVELS} cuts, which take "
            f"{self.reach(MOST_LEVELS):.1f} mm: "
            "give deeper cuts or a smaller stock",
            level=MOST_LEVELS,
            distance=distance,
        )


def schedule_of(job: LevelsJob) -> Schedule:
    """The schedule of a job: its list of depths, its numbers of finishing and roughing depths, or the
    roughing depth throughout."""
    return Schedule(*job.cuts)


def even_out(schedule: Schedule, distance: float, cuts: int, rest: float) -> Schedule:
    """The schedule with shallower roughing cuts, so that the last of `cuts` takes as much as the others.

    `distance` (mm) is the largest from the stock to the part, `rest` what the last cut had to take at most. A
    level gains a share of its depth, the same for all: (distance - first - rest) / ((cuts - 1) * beyond) over
    the roughing cuts but the last.
    """
    before = cuts - 1 - len(schedule.first)
    if before < 1:
        return schedule
    gained = (distance - sum(schedule.first) - rest) / before
    share = gained / schedule.beyond
    return Schedule(schedule.first, min(schedule.beyond, (distance - sum(schedule.first)) / (before * share + 1)))


def check_cuts(part: TriangleMesh, stock: Stock, job: LevelsJob) -> None:
    """JobError where the stock is so far from the part that more than `most_cuts` cuts are needed, StockError
    where it is more than FARTHEST_DIAGONALS away."""
    mesh = stock.mesh(max(STOCK_CHORD, STOCK_CHORD_SHARE * stock.diameter))
    distances = MeshDistance(part).unsigned(mesh.vertices)
    place = mesh.vertices[np.argmax(distances)]
    farthest = float(distances.max())
    cuts = schedule_of(job).lower_bound(farthest)
    if cuts > job.most_cuts:
        what = f"the stock at {place_name(place)} is {farthest:.1f} mm from the part, which takes {cuts} cuts or more"
        deeper = "greater depths" if job.listed else "a greater roughing_depth"
        raise field_error(
            "levels", "most_cuts", job.most_cuts, f"{what}: give a smaller stock or {deeper}, or allow more"
        )
    if farthest > FARTHEST_DIAGONALS * part.diagonal:
        raise StockError(
            f"the stock at {place_name(place)} is {farthest:.1f} mm from the part, more than "
            f"{FARTHEST_DIAGONALS:g} times "
            f"the part's diagonal of {part.diagonal:.1f} mm: give a smaller stock, or a smaller offset of "
            "the part in it",
            distance=farthest,
            place=place,
        )
