"""The section [mechanics] of a job."""

from dataclasses import dataclass

from bonecam.job.parameter import JobSection, parameter


@dataclass(frozen=True)
class MechanicsJob(JobSection):
    """What bending under the force of the cut may do to the part, as it is told of a program."""

    largest_error: float = parameter(
        0.05,
        "Largest error",
        "Error that bending may leave on 99 % of the finished surface; the paper's own bound.",
        unit="mm",
        low=0.001,
        high=10.0,
    )
    refuse: bool = parameter(
        True, "Refuse", "Refuse a program whose stress or error is larger; false: header and summary tell it."
    )
    flutes: int = parameter(2, "Flutes", "Cutting edges of a cutter whose section does not tell.", low=1, high=4)
