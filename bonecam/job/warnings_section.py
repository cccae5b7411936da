"""The section [warnings] of a job."""

from dataclasses import dataclass

from bonecam.job.parameter import JobSection, check, millimetres, parameter

LEFT_REFUSED = 0.3
"""Share of the part's area that keeps material above which it is refused."""
GUESSED_REFUSED = 0.1
"""Share of the mesh's surface that repairs guess above which it is refused."""
SLENDER_REFUSED = 60.0
"""Diameters of the post above which its length is refused: 5 N bend one of aluminium so long, 4 mm thick, by 26 mm."""
SPINDLE_REFUSED = 0.5
"""Share of the machine's lowest spindle speed below which a speed is refused."""


@dataclass(frozen=True)
class WarningsJob(JobSection):
    """What is told before all else, and beyond what a job is refused."""

    refuse: bool = parameter(
        True, "Refuse", "Refuse what is far beyond the limits; false: it is told as a warning only."
    )
    left: float = parameter(
        0.05,
        "Left",
        f"Share of the part's area, but for the place of the post, that keeps material: told above this, refused above "
        f"{LEFT_REFUSED:g}.",
        0.0,
        LEFT_REFUSED,
    )
    hole: float = millimetres(1.0, "Hole", "Width of a closed hole of the mesh: told above this.", 0.0, 500.0)
    hole_refused: float = millimetres(5.0, "Hole, refused", "Width of a hole above which it is refused.", 0.0, 500.0)
    guessed: float = parameter(
        0.02,
        "Guessed",
        "Share of the mesh's surface that repairs close, drop or make anew: told above this, refused above "
        f"{GUESSED_REFUSED:g}.",
        0.0,
        GUESSED_REFUSED,
    )
    slender: float = parameter(
        15.0,
        "Slender",
        "Diameters of the post that it may be long where its bending is not known: told above this, refused above "
        f"{SLENDER_REFUSED:g}. 5 N at its top bend one of aluminium, 4 mm thick and 60 mm long, by 0.4 mm.",
        1.0,
        SLENDER_REFUSED,
    )
    error: float = millimetres(
        0.035,
        "Error",
        "Error that bending leaves on 99 % of the finished surface: told above this, refused above "
        "mechanics.largest_error.",
        0.001,
        10.0,
    )
    depth: float = millimetres(
        0.05,
        "Depth",
        "Depth of cut above the limit of a level and the scallop before it: told above this, half a cell of the "
        "simulation.",
        0.0,
        10.0,
    )

    def __post_init__(self) -> None:
        check(self)
        if self.hole_refused < self.hole:
            raise self.fault("hole_refused", f"give at least hole ({self.hole:g})")
