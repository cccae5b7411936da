"""One cut, and how its level is made: the numbers that energies and limits are made from."""

from dataclasses import dataclass

SPARE = 0.02
ROUGH = 0.5
"""The depth (mm) `Manner.bending` is stated for."""


@dataclass(frozen=True)
class Manner:
    """How levels are made: `stiffness` of the moves, `bending` of the surface at a depth of ROUGH mm,
    `smoothing` of the field of directions (all weights of the thin plate in parameters over [0, 1]), `haste`
    the least share of the depth, `late` the same of the last levels below the stock, `beyond` how far a
    sample that needs all the depth is pulled, in depths, `even` how much of the pull every sample has alike,
    against what goes by its area: samples are dense where control points are."""

    stiffness: float
    bending: float
    smoothing: float
    haste: float
    late: float
    beyond: float
    even: float


@dataclass(frozen=True)
class Cut:
    """One cut: its `depth` and how far the levels can still go in all, this one included, both mm; `landing`
    inside the stock; `margin` is the share of their margins that limits keep: below zero they may be exceeded
    by as much."""

    depth: float
    left: float
    landing: float
    margin: float = 1.0

    @property
    def clearance(self) -> float:
        """How far inside the stock (mm) samples have to stay, but for those that are nearer to it already:
        SPARE less than they aim at."""
        return self.landing - SPARE
