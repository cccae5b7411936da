"""The section [stock] of a job."""

import pkgutil
from dataclasses import dataclass
from pathlib import Path

from bonecam.job.parameter import JobSection, millimetres, parameter
from bonecam.plugins import added_names

PUBLISHED_KINDS = ("capsule", "cylinder", "box", "mesh")
"""The kinds of stock in the order in which filter scripts number them."""


_FILES = sorted(module.name for module in pkgutil.iter_modules([str(Path(__file__).parents[1] / "setup" / "stocks")]))
STOCK_KINDS = tuple(dict.fromkeys((*PUBLISHED_KINDS, *_FILES, *added_names("stocks"))))
"""The published kinds, then those of other files of bonecam/setup/stocks, then those that users and other packages
add."""


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
    diameter: float = millimetres(0.0, "Diameter", "Diameter of capsule or cylinder; 0: the smallest.", 0.0, 500.0)
    length: float = millimetres(
        0.0, "Length", "Length of capsule (with both caps), cylinder or box; 0: the smallest.", 0.0, 2000.0
    )
    width: float = millimetres(0.0, "Width", "Side of a box along X; 0: the smallest.", 0.0, 500.0)
    depth: float = millimetres(0.0, "Depth", "Side of a box along Y; 0: the smallest.", 0.0, 500.0)
    mesh: str = parameter("", "Mesh", "File of a closed convex stock, in mm, Z upright.", file="")
    scale: float = parameter(
        1.0, "Scale", "Scale factor of the mesh file; 0: the smallest that holds the part.", 0.0, 1000.0
    )
    allowance: float = millimetres(
        0.5, "Allowance", "Material round the part where the size is the smallest that holds the part.", 0.05, 50.0
    )
    spare_volume: float = parameter(
        0.03,
        "Spare volume",
        "Share by which a capsule may exceed the smallest volume in order to take fewer cuts.",
        0.0,
        1.0,
    )
    offset_x: float = millimetres(0.0, "Offset X", "Offset of the part from the stock's axis along X.", -500.0, 500.0)
    offset_y: float = millimetres(0.0, "Offset Y", "Offset of the part from the stock's axis along Y.", -500.0, 500.0)
    offset_z: float = millimetres(
        0.0, "Offset Z", "Height of the part's middle above the middle of a stock of given size.", -1000.0, 1000.0
    )
    tilt_x_deg: float = parameter(
        0.0,
        "Tilt about X",
        "Rotation of the part about X in the stock; the first of the three.",
        -180.0,
        180.0,
        unit="deg",
    )
    tilt_y_deg: float = parameter(
        0.0, "Tilt about Y", "Rotation of the part about Y; the second.", -180.0, 180.0, unit="deg"
    )
    turn_deg: float = parameter(
        0.0,
        "Turn",
        "Rotation of the part about Z; the last. For a box without given sides it is chosen.",
        -180.0,
        180.0,
        unit="deg",
    )
