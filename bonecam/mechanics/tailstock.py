"""How stiffly a tailstock holds the free end.

Pin or upper neck bend as a cantilever under the arm, hinged at the part; the arm bends across itself, and the column
bends and, where the force is across the arm, twists:

    pin     L^3 / (3 E I)
    along   H^3 / (3 E Ic) + a / (E w^2)
    across  H^3 / (3 E Ic) + a^2 H / (G Jc) + a^3 / (3 E Ia)

of a pin of length L, an arm of length a and width w (Ia = w^4 / 12) and a round column of height H. Of a pin of steel
of 2 x 10 mm the first alone is 495 N/mm. Left out, on the safe side: that a neck holds the part's end upright too, and
any force along it. Left out besides: the joints of the bracket.
"""

import numpy as np

from bonecam.job import HoldingJob
from bonecam.job.holding.tailstock_section import NECK
from bonecam.mechanics.beam import Support
from bonecam.workholding.column import Column

STEEL = 210_000.0
"""Elasticity of steel, MPa."""
STEEL_SHEAR = 81_000.0
"""Its shear modulus, MPa."""


def tailstock_support(holding: HoldingJob, pin: Column | None, youngs: float) -> Support | None:
    """What the tailstock of a holding, whose pin or upper neck this is, does to a part whose material has this `youngs`
    modulus (MPa); None where it has none."""
    if pin is None:
        return None
    angle = np.radians(holding.tailstock_azimuth_deg)
    way = holding.tailstock_reach * np.array([np.cos(angle), np.sin(angle)]) - [pin.x, pin.y]
    length = float(np.linalg.norm(way))
    height = pin.top + holding.tailstock_arm / 2
    arm = holding.tailstock_arm
    column = np.pi / 64 * holding.tailstock_column**4

    of_pin = youngs if holding.tailstock == NECK else STEEL
    hinged = (pin.top - pin.bottom) ** 3 / (3 * of_pin * np.pi / 4 * pin.radius**4)
    bends = hinged + height**3 / (3 * STEEL * column)
    along = bends + length / (STEEL * arm**2)
    across = bends + length**2 * height / (STEEL_SHEAR * 2 * column) + length**3 / (STEEL * arm**4 / 4)

    toward = way / length
    sideways = np.array([-toward[1], toward[0]])
    stiffness = np.zeros((3, 3))
    stiffness[:2, :2] = np.outer(toward, toward) / along + np.outer(sideways, sideways) / across
    return Support(np.array([pin.x, pin.y, pin.bottom]), stiffness)
