"""The ball-end tool as a stack of revolved shapes above the tip: ball and flutes, shank, holder."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Cutter:
    """A ball-end cutter; mm. Positions are measured from the tip towards the spindle."""

    number: int
    name: str
    radius: float
    flute_length: float
    shank_diameter: float
    overhang: float
    holder_diameter: float
    holder_length: float
    spindle: float
    feed: float
    scallop: float
