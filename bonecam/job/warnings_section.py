"""The section [warnings] of a job."""

from dataclasses import dataclass

from bonecam.errors import JobError
from bonecam.job.parameter import JobSection, check, parameter


@dataclass(frozen=True)
class WarningsJob(JobSection):
    """What is told before all else, and beyond what a job is refused."""

    refuse: bool = parameter(
        True, "Refuse", "Refuse what is beyond the limits ..._refused; false: it is told as a warning only."
    )
    left: float = parameter(
        0.05,
        "Left",
        "Share of the part's area, but for the place of the post, that keeps material: told above this.",
        low=0.0,
        high=1.0,
    )
    left_refused: float = parameter(
        0.3, "Left, refused", "Share of the part's area above which it is refused.", low=0.0, high=1.0
    )
    hole: float = parameter(
        1.0, "Hole", "Width of a closed hole of the mesh: told above this.", unit="mm", low=0.0, high=500.0
    )
    hole_refused: float = parameter(
        5.0, "Hole, refused", "Width of a hole above which it is refused.", unit="mm", low=0.0, high=500.0
    )
    guessed: float = parameter(
        0.02,
        "Guessed",
        "Share of the mesh's surface that repairs close, drop or make anew: told above this.",
        low=0.0,
        high=1.0,
    )
    guessed_refused: float = parameter(
        0.1, "Guessed, refused", "Share of the surface above which it is refused.", low=0.0, high=1.0
    )
    slender: float = parameter(
        15.0,
        "Slender",
        "Diameters of the post that it may be long where its bending is not known: told above this. 5 N at its top "
        "bend one of aluminium, 4 mm thick and 60 mm long, by 0.4 mm.",
        low=1.0,
        high=1000.0,
    )
    slender_refused: float = parameter(
        60.0, "Slender, refused", "Diameters above which it is refused.", low=1.0, high=1000.0
    )
    spindle_refused: float = parameter(
        0.5,
        "Spindle, refused",
        "Share of the machine's lowest spindle speed: a speed below that is told, one below this share is refused.",
        low=0.0,
        high=1.0,
    )
    error: float = parameter(
        0.035,
        "Error",
        "Error that bending leaves on 99 % of the finished surface: told above this, refused above "
        "mechanics.largest_error.",
        unit="mm",
        low=0.001,
        high=10.0,
    )
    depth: float = parameter(
        0.05,
        "Depth",
        "Depth of cut above the limit of a level: told above this, half a cell of the simulation.",
        unit="mm",
        low=0.0,
        high=10.0,
    )

    def __post_init__(self) -> None:
        check(self)
        for name in ("left", "hole", "guessed", "slender"):
            warned = getattr(self, name)
            refused = getattr(self, f"{name}_refused")
            if refused < warned:
                bound = f"give at least {name} ({warned:g})"
                raise JobError(f"{name}_refused = {refused:g}: {bound}", field=f"{name}_refused")
