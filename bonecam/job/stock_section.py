"""The section [stock] of a job."""

import pkgutil
from dataclasses import dataclass
from pathlib import Path

from bonecam.job.parameter import JobSection, parameter
from bonecam.runtime.own_files import added_names

PUBLISHED_KINDS = ("capsule", "cylinder", "box", "mesh")
"""The kinds of stock in the order in which filter scripts number them."""


def _kinds() -> tuple[str, ...]:
    """The kinds of stock: the published ones, then those of other files of bonecam/setup/stocks, then those that users
    and other packages add."""
    folder = Path(__file__).parents[1] / "setup" / "stocks"
    files = sorted(module.name for module in pkgutil.iter_modules([str(folder)]))
    return tuple(dict.fromkeys((*PUBLISHED_KINDS, *files, *added_names("stocks"))))


STOCK_KINDS = _kinds()


@dataclass(frozen=True)
class StockJob(JobSection):
    """The stock, upright on the Z axis, and the pose of the part in it.

    A size of zero means the smallest that holds the part.
    """

    kind: str = parameter(
        "capsule",
        "Kind",
        "A capsule, a cylinder, a box, or a closed convex mesh. Levels of their own round the edges first.",
        choices=STOCK_KINDS,
    )
    diameter: float = parameter(
        0.0, "Diameter", "Diameter of capsule or cylinder; 0: the smallest.", unit="mm", low=0.0, high=500.0
    )
    length: float = parameter(
        0.0,
        "Length",
        "Length of capsule (with both caps), cylinder or box; 0: the smallest.",
        unit="mm",
        low=0.0,
        high=2000.0,
    )
    width: float = parameter(0.0, "Width", "Side of a box along X; 0: the smallest.", unit="mm", low=0.0, high=500.0)
    depth: float = parameter(0.0, "Depth", "Side of a box along Y; 0: the smallest.", unit="mm", low=0.0, high=500.0)
    mesh: str = parameter("", "Mesh", "File of a closed convex stock, in mm, Z upright.", file="")
    scale: float = parameter(
        1.0, "Scale", "Scale factor of the mesh file; 0: the smallest that holds the part.", low=0.0, high=1000.0
    )
    allowance: float = parameter(
        0.5,
        "Allowance",
        "Material round the part where the size is the smallest that holds the part.",
        unit="mm",
        low=0.05,
        high=50.0,
    )
    spare_volume: float = parameter(
        0.03,
        "Spare volume",
        "Share by which a capsule may exceed the smallest volume in order to take fewer cuts.",
        low=0.0,
        high=1.0,
    )
    offset_x: float = parameter(
        0.0, "Offset X", "Offset of the part from the stock's axis along X.", unit="mm", low=-500.0, high=500.0
    )
    offset_y: float = parameter(
        0.0, "Offset Y", "Offset of the part from the stock's axis along Y.", unit="mm", low=-500.0, high=500.0
    )
    offset_z: float = parameter(
        0.0,
        "Offset Z",
        "Height of the part's middle above the middle of a stock of given size.",
        unit="mm",
        low=-1000.0,
        high=1000.0,
    )
    tilt_x_deg: float = parameter(
        0.0,
        "Tilt about X",
        "Rotation of the part about X in the stock; the first of the three.",
        unit="deg",
        low=-180.0,
        high=180.0,
    )
    tilt_y_deg: float = parameter(
        0.0, "Tilt about Y", "Rotation of the part about Y; the second.", unit="deg", low=-180.0, high=180.0
    )
    turn_deg: float = parameter(
        0.0,
        "Turn",
        "Rotation of the part about Z; the last. For a box without given sides it is chosen.",
        unit="deg",
        low=-180.0,
        high=180.0,
    )
