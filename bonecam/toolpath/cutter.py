"""The ball-end tool as a stack of revolved shapes above the tip: ball and flutes, shank, holder."""

from dataclasses import dataclass

from bonecam.errors import JobError
from bonecam.job import ToolJob


@dataclass(frozen=True)
class Cutter:
    """A ball-end cutter; mm. Positions are measured from the tip towards the spindle.

    Raises JobError where the shapes cannot follow each other from the tip up: radius <= flute_length < overhang.
    """

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

    def __post_init__(self) -> None:
        if not self.radius <= self.flute_length < self.overhang:
            raise JobError(
                f"{self.name}: ball radius {self.radius:g}, flutes to {self.flute_length:g}, overhang {self.overhang:g} mm: "
                "make radius <= flute_length < overhang",
                cutter=self.name,
            )
        if not 0 < self.scallop < self.radius:
            raise JobError(f"{self.name}: scallop {self.scallop:g} mm: keep it between 0 and the ball radius", cutter=self.name)

    @classmethod
    def from_job(cls, number: int, name: str, job: ToolJob) -> "Cutter":
        """The cutter a job states, with its place in the tool changer."""
        return cls(
            number,
            name,
            job.radius,
            job.flute_length,
            job.shank_diameter,
            job.overhang,
            job.holder_diameter,
            job.holder_length,
            job.spindle,
            job.feed,
            job.scallop,
        )

    @property
    def length(self) -> float:
        """From the tip to the far end of the holder, mm."""
        return self.overhang + self.holder_length

    @property
    def sections(self) -> tuple[tuple[str, float, float, float], ...]:
        """(name, start, end, radius) of the cylinders above the ball's centre: cutter, shank, holder; mm from the tip."""
        return (
            ("cutter", self.radius, self.flute_length, self.radius),
            ("shank", self.flute_length, self.overhang, self.shank_diameter / 2),
            ("holder", self.overhang, self.length, self.holder_diameter / 2),
        )
