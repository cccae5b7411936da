"""The bar that stock, neck and stub are turned from, and the collet that holds it.

Bars: the diameters that dealers keep of drawn round bar, in whole mm up to 20, even ones up to 40, then by 5 mm.
Collets: nuts of ER collets and what they hold (DIN ISO 15488), the slim kind up to 16 mm; beyond these a three-jaw
chuck.
"""

import math
from dataclasses import replace

from bonecam.job import HoldingJob, field_error

COLLETS = ((10.0, 22.0), (13.0, 28.0), (16.0, 35.0), (20.0, 50.0), (26.0, 63.0))
"""The thickest bar that a collet holds, and the diameter of its nut, mm: ER 16, 20, 25 with slim nuts, ER 32, 40."""
JAWS = 30.0
"""What jaws stand over a thicker bar to each side, mm."""
COLLET_TOP = 100.0
"""Top of the collet that is found, over the table, mm: a spindle of 110 mm at 90 degrees clears the table."""
RISER = (60.0, 50.0)
"""Diameter and height of the riser under it, mm; a wider collet has one as wide as itself."""
STUB = 15.0
"""Length of the stub that is found, mm: the collet keeps out of the way of the tool, and the bar is stiff."""


def next_bar(diameter: float) -> float:
    """The diameter of the thinnest bar to be had that is as thick as this, mm."""
    step = 1.0 if diameter <= 20 else 2.0 if diameter <= 40 else 5.0
    return step * math.ceil(round(diameter / step, 6))


def collet_for(bar: float) -> float:
    """The diameter of the collet nut, or of the chuck, that holds a bar of this diameter, mm."""
    return next((nut for thickest, nut in COLLETS if bar <= thickest), bar + 2 * JAWS)


def in_collet(holding: HoldingJob, bar: float) -> HoldingJob:
    """The holding with a collet that holds a bar of this diameter (mm), on a riser."""
    nut = collet_for(bar)
    on_riser = replace(holding, riser_diameter=max(RISER[0], nut), riser_height=RISER[1])
    return replace(on_riser, chuck_diameter=nut, chuck_height=COLLET_TOP)


def settled_stub(holding: HoldingJob, width: float) -> HoldingJob:
    """The holding with the sizes of bar and collet that it leaves open, for a stock that is `width` mm wide.

    A holding that names nothing gets riser, collet and stub. JobError where the bar is thinner than the stock that is
    turned from it, or the chuck no wider than the bar.
    """
    if holding.names_nothing:
        bar = next_bar(width)
        return replace(in_collet(holding, bar), stub_diameter=bar, stub_length=STUB)
    if not holding.stub_length:
        return holding
    bar = holding.stub_diameter or next_bar(width)
    if bar < width:
        bound = f"the stock that is turned from this bar is {width:.2f} mm wide: give a thicker bar"
        raise field_error("holding", "stub_diameter", bar, bound)
    if 0 < holding.chuck_diameter <= bar:
        bound = f"it is to hold a bar of {bar:g} mm: give a wider chuck"
        raise field_error("holding", "chuck_diameter", holding.chuck_diameter, bound)
    return replace(holding, stub_diameter=bar)
