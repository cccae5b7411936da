"""The section [holding] of a job."""

from dataclasses import dataclass

from bonecam.job.parameter import Section, parameter


@dataclass(frozen=True)
class HoldingJob(Section):
    """The post that holds the part at its lower end, on the table."""

    diameter: float = parameter(
        4.0,
        "Post diameter",
        "Diameter of the post that is left at the part's lower end.",
        unit="mm",
        low=0.5,
        high=100.0,
    )
    length: float = parameter(
        40.0, "Post length", "From the table to the lower end of the stock.", unit="mm", low=1.0, high=500.0
    )
