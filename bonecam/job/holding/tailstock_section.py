"""The part of the section [holding] that tells what holds the free end."""

from dataclasses import dataclass

from bonecam.errors import JobError
from bonecam.job.parameter import JobSection, parameter

NO_TAILSTOCK, PIN, NECK = "none", "pin", "neck"


@dataclass(frozen=True)
class TailstockJob(JobSection):
    """What holds the part at its free end: a pin or a second neck under the arm of a bracket, whose column stands
    beside the part on the table and turns with it."""

    tailstock: str = parameter(
        NO_TAILSTOCK,
        "Tailstock",
        "What holds the free end: none; pin: a steel pin in a hole of the part; neck: a second neck of the bar, held "
        "at its upper end. Either hangs from the arm of a bracket that stands on the table.",
        choices=(NO_TAILSTOCK, PIN, NECK),
    )
    tailstock_diameter: float = parameter(
        3.0, "Tailstock diameter", "Diameter of pin or upper neck.", unit="mm", low=0.5, high=50.0
    )
    tailstock_length: float = parameter(
        12.0,
        "Tailstock length",
        "From the part up to the arm: how far pin or upper neck stand free.",
        unit="mm",
        low=1.0,
        high=200.0,
    )
    tailstock_height: float = parameter(
        0.0,
        "Tailstock height",
        "From the table to the lower side of the arm; 0: where the length brings it.",
        unit="mm",
        low=0.0,
        high=1000.0,
    )
    tailstock_x: float = parameter(
        0.0,
        "Tailstock X",
        "Where pin or upper neck stand, from the axis of the lower neck; X and Y 0: over the part's highest place.",
        unit="mm",
        low=-500.0,
        high=500.0,
    )
    tailstock_y: float = parameter(0.0, "Tailstock Y", "As tailstock_x, along Y.", unit="mm", low=-500.0, high=500.0)
    tailstock_reach: float = parameter(
        0.0,
        "Tailstock reach",
        "From the axis of the lower neck to that of the bracket's column; 0: 100 mm, or as far as the table allows.",
        unit="mm",
        low=0.0,
        high=1000.0,
    )
    tailstock_azimuth_deg: float = parameter(
        0.0,
        "Tailstock azimuth",
        "Direction in which the column stands, from X towards Y.",
        unit="deg",
        low=-360.0,
        high=360.0,
    )
    tailstock_column: float = parameter(
        30.0, "Tailstock column", "Diameter of the bracket's column.", unit="mm", low=5.0, high=200.0
    )
    tailstock_arm: float = parameter(
        16.0, "Tailstock arm", "Width and height of the bracket's arm.", unit="mm", low=3.0, high=200.0
    )

    @property
    def has_tailstock(self) -> bool:
        """Whether something holds the free end."""
        return self.tailstock != NO_TAILSTOCK

    def check_tailstock(self) -> None:
        """JobError where pin or upper neck are no thinner than the arm that holds them."""
        if self.has_tailstock and self.tailstock_diameter >= self.tailstock_arm:
            bound = f"give less than the arm that holds it ({self.tailstock_arm:g} mm), or a wider arm"
            raise JobError(f"tailstock_diameter = {self.tailstock_diameter:g}: {bound}", field="tailstock_diameter")
