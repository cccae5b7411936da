"""The section [holding] of a job."""

from dataclasses import dataclass

from bonecam.errors import JobError
from bonecam.job.parameter import JobSection, check, parameter

LEAST_BRIDGE = 0.2
"""A bridge is no thinner, mm: two cells of the simulation, within which it is measured."""


@dataclass(frozen=True)
class HoldingJob(JobSection):
    """The post that holds the part at its lower end, and the chuck or collet on the table that holds the post."""

    diameter: float = parameter(
        4.0,
        "Post diameter",
        "Diameter of the post that is left at the part's lower end.",
        unit="mm",
        low=0.5,
        high=100.0,
    )
    length: float = parameter(
        0.0,
        "Post length",
        "From the table to the lower end of the stock; 0: the shortest with which all is reached.",
        unit="mm",
        low=0.0,
        high=500.0,
    )
    chuck_diameter: float = parameter(
        0.0,
        "Chuck diameter",
        "Diameter of the chuck or collet round the post; 0: the post stands on the table.",
        unit="mm",
        low=0.0,
        high=1000.0,
    )
    chuck_height: float = parameter(
        0.0,
        "Chuck height",
        "From the table to the top of the chuck or collet.",
        unit="mm",
        low=0.0,
        high=500.0,
    )
    clearance: float = parameter(
        5.0,
        "Clearance",
        "Distance that the whole tool keeps from table and chuck, and holder and spindle from the post.",
        unit="mm",
        low=0.0,
        high=100.0,
    )
    parting: bool = parameter(
        False,
        "Parting",
        "Turn a groove round the post below the finished part, down to a bridge that holds it.",
    )
    parting_stand_off: float = parameter(
        1.0,
        "Parting stand-off",
        "From the part's lower end down to the groove: the height of the stump that stays there.",
        unit="mm",
        low=0.1,
        high=100.0,
    )
    parting_core: float = parameter(
        0.0,
        "Parting core",
        "Diameter of the bridge that the groove leaves; 0: half of the post's diameter.",
        unit="mm",
        low=0.0,
        high=100.0,
    )

    second: str = parameter(
        "",
        "Second clamping",
        "File of a closed shell round the finished end, in frame and unit of the part's file: the parted part, turned "
        "over, stands in it, and a second program cuts the stump. None: one program.",
    )
    second_height: float = parameter(
        0.0,
        "Second height",
        "From the table to the lower end of the shell in the second clamping.",
        unit="mm",
        low=0.0,
        high=500.0,
    )
    second_chuck_diameter: float = parameter(
        0.0,
        "Second chuck diameter",
        "Diameter of the chuck or vice round the shell in the second clamping; 0: none above the table.",
        unit="mm",
        low=0.0,
        high=1000.0,
    )
    second_chuck_height: float = parameter(
        0.0,
        "Second chuck height",
        "From the table to the top of that chuck or vice.",
        unit="mm",
        low=0.0,
        high=500.0,
    )

    @property
    def bridge(self) -> float:
        """Diameter (mm) of the bridge that a parting groove leaves of the post."""
        return self.parting_core or self.diameter / 2

    @property
    def turned_over(self) -> "HoldingJob":
        """What holds the shell of the second clamping; there is no post."""
        return HoldingJob(
            diameter=self.diameter,
            chuck_diameter=self.second_chuck_diameter,
            chuck_height=self.second_chuck_height,
            clearance=self.clearance,
        )

    def __post_init__(self) -> None:
        check(self)
        for name in ("", "second_"):
            diameter, height = (getattr(self, f"{name}chuck_{size}") for size in ("diameter", "height"))
            if (diameter > 0) != (height > 0):
                missing = f"{name}chuck_{'diameter' if height > 0 else 'height'}"
                raise JobError(f"{missing} = 0: give both sizes of the chuck, or none", field=missing)
        if self.second and not self.parting:
            remedy = "give holding.parting = true, which parts the part from its post first"
            raise JobError(f"second = {self.second!r}: {remedy}", field="second")
        if 0 < self.chuck_diameter <= self.diameter:
            bound = f"give more than the post's diameter ({self.diameter:g} mm)"
            raise JobError(f"chuck_diameter = {self.chuck_diameter:g}: {bound}", field="chuck_diameter")
        if 0 < self.length <= self.chuck_height:
            bound = f"give less than the post's length ({self.length:g} mm), or a longer post"
            raise JobError(f"chuck_height = {self.chuck_height:g}: {bound}", field="chuck_height")
        if 0 < self.parting_core < LEAST_BRIDGE:
            bound = f"give {LEAST_BRIDGE:g} mm or more, or 0 for half of the post's diameter"
            raise JobError(f"parting_core = {self.parting_core:g}: {bound}", field="parting_core")
        if self.parting_core >= self.diameter:
            bound = f"give less than the post's diameter ({self.diameter:g} mm), or no parting"
            raise JobError(f"parting_core = {self.parting_core:g}: {bound}", field="parting_core")
