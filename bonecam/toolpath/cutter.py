"""The ball-end tool as a stack of revolved shapes above the tip: ball and flutes, shank, holder."""

from dataclasses import dataclass

from bonecam.job import ToolJob, field_error


@dataclass(frozen=True)
class Cutter:
    """A ball-end cutter; mm. Positions are measured from the tip towards the spindle.

    `name` is the section of the job. Raises JobError where the shapes cannot follow each other from the tip
    up, or the shank does not fit into the holder: radius <= flute_length < overhang, shank_diameter <=
    holder_diameter.
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
        if not self.flute_length >= self.radius:
            raise field_error(
                self.name,
                "flute_length",
                self.flute_length,
                f"give at least the ball's radius ({self.radius:g} mm)",
            )
        if not self.overhang > self.flute_length:
            raise field_error(
                self.name,
                "overhang",
                self.overhang,
                f"give more than flute_length ({self.flute_length:g} mm)",
            )
        if not 0 < self.scallop < self.radius:
            raise field_error(
                self.name,
                "scallop",
                self.scallop,
                f"give less than the ball's radius ({self.radius:g} mm), and more than 0",
            )
        if not self.shank_diameter <= self.holder_diameter:
            raise field_error(
                self.name,
                "shank_diameter",
                self.shank_diameter,
                f"give at most holder_diameter ({self.holder_diameter:g} mm)",
            )

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
        """(name, start, end, radius) of the cylinders above the ball's centre: cutter, shank, holder; mm from
        the tip."""
        return (
            ("cutter", self.radius, self.flute_length, self.radius),
            ("shank", self.flute_length, self.overhang, self.shank_diameter / 2),
            ("holder", self.overhang, self.length, self.holder_diameter / 2),
        )
