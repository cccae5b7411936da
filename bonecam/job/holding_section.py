"""The section [holding] of a job."""

from dataclasses import dataclass

from bonecam.errors import JobError
from bonecam.job.parameter import JobSection, check, millimetres, parameter

NO_TAILSTOCK, PIN, NECK = "none", "pin", "neck"
AUTO, TURNED, MILLED = "auto", "turned", "milled"
NO_FLAT = "none"
FLATS = {"+X": (1.0, 0.0), "-X": (-1.0, 0.0), "+Y": (0.0, 1.0), "-Y": (0.0, -1.0)}
"""Where a flat of the shell may face in the second clamping, as a unit vector in the plane of the table."""


LEAST_POST = 0.5
"""A post is no thinner, mm."""
STAND_OFF = 1.0
"""Stand-off of a parting groove where none is given and none was found yet, mm: a saw or a file gets between."""
LEAST_STAND_OFF = 0.1
"""Least stand-off, mm: what the ball keeps from the post."""
LEAST_BRIDGE = 0.2
"""A bridge is no thinner, mm: two cells of the simulation, within which it is measured."""


@dataclass(frozen=True)
class HoldingJob(JobSection):
    """What holds the part: at its lower end, from the table up, riser, chuck or collet, a stub of the bar, and the neck
    (the post) that is left between the stub and the part; at its free end, if there is one, a tailstock: a pin or a
    second neck under the arm of a bracket, whose column stands beside the part on the table and turns with it."""

    tailstock: str = parameter(
        NO_TAILSTOCK,
        "Tailstock",
        "What holds the free end: none; pin: a steel pin in a hole of the part; neck: a second neck of the bar, held "
        "at its upper end. Either hangs from the arm of a bracket that stands on the table.",
        choices=(NO_TAILSTOCK, PIN, NECK),
    )
    tailstock_diameter: float = millimetres(3.0, "Tailstock diameter", "Diameter of pin or upper neck.", 0.5, 50.0)
    tailstock_length: float = millimetres(
        12.0, "Tailstock length", "From the part up to the arm: how far pin or upper neck stand free.", 1.0, 200.0
    )
    tailstock_height: float = millimetres(
        0.0,
        "Tailstock height",
        "From the table to the lower side of the arm; 0: where the length brings it.",
        0.0,
        1000.0,
    )
    tailstock_x: float = millimetres(
        0.0,
        "Tailstock X",
        "Where pin or upper neck stand, from the axis of the lower neck; X and Y 0: over the part's highest place.",
        -500.0,
        500.0,
    )
    tailstock_y: float = millimetres(0.0, "Tailstock Y", "As tailstock_x, along Y.", -500.0, 500.0)
    tailstock_reach: float = millimetres(
        0.0,
        "Tailstock reach",
        "From the axis of the lower neck to that of the bracket's column; 0: 100 mm, or as far as the table allows.",
        0.0,
        1000.0,
    )
    tailstock_azimuth_deg: float = parameter(
        0.0, "Tailstock azimuth", "Direction in which the column stands, from X towards Y.", -360.0, 360.0, unit="deg"
    )
    tailstock_column: float = millimetres(30.0, "Tailstock column", "Diameter of the bracket's column.", 5.0, 200.0)
    tailstock_arm: float = millimetres(16.0, "Tailstock arm", "Width and height of the bracket's arm.", 3.0, 200.0)

    diameter: float = millimetres(
        0.0,
        "Post diameter",
        "Diameter of the post (neck) that is left at the part's lower end; 0: the thinnest that is stiff enough.",
        0.0,
        100.0,
    )
    length: float = millimetres(
        0.0,
        "Post length",
        "From the table to the lower end of the stock; 0: the shortest with which all is reached.",
        0.0,
        500.0,
    )
    chuck_diameter: float = millimetres(
        0.0,
        "Chuck diameter",
        "Diameter of the chuck or collet round the post; 0: the post stands on the table.",
        0.0,
        1000.0,
    )
    chuck_height: float = millimetres(
        0.0, "Chuck height", "From the table to the top of the chuck or collet.", 0.0, 500.0
    )
    riser_diameter: float = millimetres(
        0.0, "Riser diameter", "Diameter of the riser under the chuck or collet; 0: none.", 0.0, 1000.0
    )
    riser_height: float = millimetres(0.0, "Riser height", "From the table to the top of the riser.", 0.0, 500.0)
    stub_diameter: float = millimetres(
        0.0,
        "Stub diameter",
        "Diameter of the bar that the chuck holds; 0: the next bar to be had that the stock is turned from.",
        0.0,
        500.0,
    )
    stub_length: float = millimetres(
        0.0,
        "Stub length",
        "Length of the bar, at its own diameter, between chuck and neck; 0: the chuck holds the neck.",
        0.0,
        300.0,
    )
    neck: str = parameter(
        AUTO,
        "Neck",
        "How stock and neck come out of the bar: turned before on a lathe, or milled at the program's start from a bar "
        "that is only sawn; auto: milled where a capsule on a bar is cut by morph levels, else turned.",
        choices=(AUTO, TURNED, MILLED),
    )
    bar_end: float = millimetres(
        1.0, "Bar end", "How far the sawn bar stands over the stock that is milled from it.", 0.0, 50.0
    )
    clearance: float = millimetres(
        5.0,
        "Clearance",
        "Distance that the whole tool keeps from table and chuck, and holder and spindle from the post.",
        0.0,
        100.0,
    )
    parting: bool = parameter(
        False, "Parting", "Turn a groove round the post below the finished part, down to a bridge that holds it."
    )
    parting_stand_off: float = millimetres(
        0.0,
        "Parting stand-off",
        "From the part's lower end down to the groove: the height of the stump that stays there; 0: the least with "
        "which a cutter gets all round, 1 mm or more.",
        0.0,
        100.0,
    )
    parting_core: float = millimetres(
        0.0,
        "Parting core",
        "Diameter of the bridge that the groove leaves; 0: half of the post's diameter.",
        0.0,
        100.0,
    )

    second: str = parameter(
        "",
        "Second clamping",
        "File of a closed shell round the finished end, in frame and unit of the part's file: the parted part, turned "
        "over, stands in it, and a second program cuts the stump. None: one program.",
        file="",
    )
    second_height: float = millimetres(
        0.0, "Second height", "From the table to the lower end of the shell in the second clamping.", 0.0, 500.0
    )
    second_chuck_diameter: float = millimetres(
        0.0,
        "Second chuck diameter",
        "Diameter of the chuck or vice round the shell in the second clamping; 0: none above the table.",
        0.0,
        1000.0,
    )
    second_chuck_height: float = millimetres(
        0.0, "Second chuck height", "From the table to the top of that chuck or vice.", 0.0, 500.0
    )
    second_flat: str = parameter(
        NO_FLAT,
        "Second flat",
        "Where the flat on the side of the shell faces in the second clamping, which fixes its turn; none: no flat.",
        choices=(NO_FLAT, *FLATS),
    )
    second_pin: float = millimetres(
        0.0, "Second pin", "Diameter of the pin under the shell, on the axis of the stump; 0: none.", 0.0, 50.0
    )
    second_modulus: float = parameter(
        1600.0,
        "Second modulus",
        "Elasticity of the shell: of PLA printed upright, across its layers (PolyTerra PLA, data sheet V5.3: 1615, and "
        "1997 along them).",
        1.0,
        1e6,
        unit="N/mm2",
    )

    @property
    def has_tailstock(self) -> bool:
        """Whether something holds the free end."""
        return self.tailstock != NO_TAILSTOCK

    @property
    def bridge(self) -> float:
        """Diameter (mm) of the bridge that a parting groove leaves of the post."""
        return self.parting_core or self.diameter / 2

    @property
    def stand_off(self) -> float:
        """From the part's lower end down to a parting groove, mm."""
        return self.parting_stand_off or STAND_OFF

    @property
    def turned_over(self) -> "HoldingJob":
        """What holds the shell of the second clamping; there is no post."""
        return HoldingJob(
            diameter=self.diameter,
            chuck_diameter=self.second_chuck_diameter,
            chuck_height=self.second_chuck_height,
            clearance=self.clearance,
            second_flat=self.second_flat,
            second_pin=self.second_pin,
            second_modulus=self.second_modulus,
        )

    @property
    def names_nothing(self) -> bool:
        """Whether all that holds the part is to be found: then it is riser, collet, stub and neck."""
        names = ("diameter", "length", "chuck_height", "riser_height", "stub_length")
        return not any(getattr(self, name) for name in names)

    @property
    def support_height(self) -> float:
        """Height of the foot of the neck over the table, mm: the top of stub, chuck or riser."""
        return max(self.chuck_height, self.riser_height) + self.stub_length

    def __post_init__(self) -> None:
        check(self)
        for name in ("chuck_", "second_chuck_", "riser_"):
            diameter, height = (getattr(self, f"{name}{size}") for size in ("diameter", "height"))
            if (diameter > 0) != (height > 0):
                missing = f"{name}{'diameter' if height > 0 else 'height'}"
                what = name.removeprefix("second_").rstrip("_")
                raise self.fault(missing, f"give both sizes of the {what}, or none")
        if self.second and not self.parting:
            remedy = "give holding.parting = true, which parts the part from its post first"
            raise JobError(f"second = {self.second!r}: {remedy}", field="second")
        self._check_stack()
        if self.has_tailstock and self.tailstock_diameter >= self.tailstock_arm:
            bound = f"give less than the arm that holds it ({self.tailstock_arm:g} mm), or a wider arm"
            raise self.fault("tailstock_diameter", bound)
        if 0 < self.parting_stand_off < LEAST_STAND_OFF:
            raise self.fault("parting_stand_off", f"give {LEAST_STAND_OFF:g} mm or more, or 0 for the least that does")
        if 0 < self.parting_core < LEAST_BRIDGE:
            raise self.fault("parting_core", f"give {LEAST_BRIDGE:g} mm or more, or 0 for half of the post's diameter")
        if self.parting_core >= self.diameter > 0:
            bound = f"give less than the post's diameter ({self.diameter:g} mm), or no parting"
            raise self.fault("parting_core", bound)

    def _check_stack(self) -> None:
        """JobError where riser, chuck, stub and neck do not stand on one another."""
        if 0 < self.diameter < LEAST_POST:
            raise self.fault("diameter", f"give {LEAST_POST:g} mm or more, or 0 for the thinnest that is stiff enough")
        post, chuck, riser, stub = self.diameter, self.chuck_diameter, self.riser_diameter, self.stub_diameter
        faults = {
            "chuck_diameter": [
                (0 < chuck <= post, f"give more than the post's diameter ({post:g} mm)"),
                (0 < riser < chuck, f"give at most the riser's diameter ({riser:g} mm), or a wider riser"),
                (0 < chuck <= stub, f"give more than the stub's diameter ({stub:g} mm), which the chuck holds"),
            ],
            "chuck_height": [
                (0 < self.chuck_height <= self.riser_height, f"give more than riser_height ({self.riser_height:g} mm)")
            ],
            "stub_diameter": [
                (stub > 0 and not self.stub_length, "give stub_length too, or 0 for no stub"),
                (0 < stub <= post, f"give more than the post's diameter ({post:g} mm)"),
            ],
        }
        for field, each in faults.items():
            for wrong, bound in each:
                if wrong:
                    raise self.fault(field, bound)
        if 0 < self.length <= self.support_height:
            field = next(name for name in ("stub_length", "chuck_height", "riser_height") if getattr(self, name))
            ends = f"it ends at {self.support_height:g} mm: " if field == "stub_length" else ""
            bound = f"{ends}give less than the post's length ({self.length:g} mm), or a longer post"
            raise self.fault(field, bound)
