"""One cut, and how its level is made: the numbers that energies and limits are made from."""

from dataclasses import dataclass

SPARE = 0.02
"""How much nearer to the wall samples may come than they aim at, mm."""
ROUGH = 0.5
"""The depth (mm) `StepParameters.bending` is stated for."""


@dataclass(frozen=True)
class StepParameters:
    """How a level is made: weights of the thin plate, parameters over [0, 1], and of the pull.

    `stiffness` is that of the moves, `bending` that of the new surface at a depth of ROUGH mm. `uniform` is how
    much of the pull every sample has alike, against what goes by its area: samples are dense where control
    points are. A sample with less way to the stock than the farthest is pulled by less of the depth, but by
    `least_share` of it at least: below 1 all come to the stock together.
    """

    stiffness: float
    bending: float
    uniform: float
    least_share: float = 1.0


@dataclass(frozen=True)
class Cut:
    """One cut: its `depth` (mm), and how far inside the stock its level stays where it comes to the wall,
    `landing` (mm).

    `margin` is the share of their margins that limits keep: below zero they may be exceeded by as much.
    """

    depth: float
    landing: float
    margin: float = 1.0

    @property
    def clearance(self) -> float:
        """How far inside the stock (mm) samples have to stay, but for those that are nearer to it already:
        SPARE less than they aim at."""
        return self.landing - SPARE
