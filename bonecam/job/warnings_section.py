"""The section [warnings] of a job."""

from dataclasses import dataclass

from bonecam.job.parameter import JobSection, check, millimetres, parameter


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
        0.0,
        1.0,
    )
    left_refused: float = parameter(
        0.3, "Left, refused", "Share of the part's area above which it is refused.", 0.0, 1.0
    )
    hole: float = millimetres(1.0, "Hole", "Width of a closed hole of the mesh: told above this.", 0.0, 500.0)
    hole_refused: float = millimetres(5.0, "Hole, refused", "Width of a hole above which it is refused.", 0.0, 500.0)
    guessed: float = parameter(
        0.02, "Guessed", "Share of the mesh's surface that repairs close, drop or make anew: told above this.", 0.0, 1.0
    )
    guessed_refused: float = parameter(
        0.1, "Guessed, refused", "Share of the surface above which it is refused.", 0.0, 1.0
    )
    slender: float = parameter(
        15.0,
        "Slender",
        "Diameters of the post that it may be long where its bending is not known: told above this. 5 N at its top "
        "bend one of aluminium, 4 mm thick and 60 mm long, by 0.4 mm.",
        1.0,
        1000.0,
    )
    slender_refused: float = parameter(60.0, "Slender, refused", "Diameters above which it is refused.", 1.0, 1000.0)
    spindle_refused: float = parameter(
        0.5,
        "Spindle, refused",
        "Share of the machine's lowest spindle speed: a speed below that is told, one below this share is refused.",
        0.0,
        1.0,
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
        "Depth of cut above the limit of a level: told above this, half a cell of the simulation.",
        0.0,
        10.0,
    )

    def __post_init__(self) -> None:
        check(self)
        for name in ("left", "hole", "guessed", "slender"):
            warned, refused = getattr(self, name), f"{name}_refused"
            if getattr(self, refused) < warned:
                raise self.fault(refused, f"give at least {name} ({warned:g})")
