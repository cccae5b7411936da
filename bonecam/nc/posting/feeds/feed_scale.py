"""The feeds that a program's words take: a few dozen values.

They are preferred numbers of the series R20 (ISO 3), twenty a decade, to which feeds of machine tools are stepped (ISO
229), and those that a path asks for: the cutter's, that of links and of plunges. A feed is rounded down: what an axis
allows is never exceeded. FLOOR of a cut's feed is on the scale too, so that no feed falls below it by the rounding.
"""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.nc.schema.number_format import NumberFormat
from bonecam.tool.path import MoveKind, ToolPath

R20 = np.array([100, 112, 125, 140, 160, 180, 200, 224, 250, 280, 315, 355, 400, 450, 500, 560, 630, 710, 800, 900])
"""The rounded preferred numbers of a decade."""
DECADES = 6
"""From 1 to 999,999 mm/min."""
FLOOR = 0.5
"""Evenness lowers no feed below this share of what is asked, beyond what the axes of its own row ask for."""


def feed_scale(path: ToolPath, number: NumberFormat) -> Float[ndarray, " k"]:
    """The feeds (mm/min) that the words of a path may have, rising, in whole steps of the `number` F."""
    asked = np.unique(path.feed_rates)
    floors = FLOOR * np.unique(path.feed_rates[path.kinds == MoveKind.CUT])
    # a feed that is asked for stands as it is asked: its word is rounded as it is written
    return np.unique(np.r_[stepped_feeds(number, floors), asked])


def stepped_feeds(number: NumberFormat, *more: Float[ndarray, " m"]) -> Float[ndarray, " k"]:
    """The preferred feeds (mm/min) and some `more`, rising, rounded down to whole steps of the `number` F."""
    feeds = np.concatenate([R20 * 10.0 ** (decade - 2) for decade in range(DECADES)] + list(more))
    whole = np.floor(feeds / number.step + 1e-9) * number.step
    return np.unique(whole[whole > 0])


def on_scale(feeds: Float[ndarray, "n"], scale: Float[ndarray, " k"]) -> Float[ndarray, "n"]:
    """The largest feeds of a scale that are no larger than the `feeds`; the lowest of it below them all."""
    return np.asarray(scale[np.maximum(np.searchsorted(scale, feeds * (1 + 1e-12), "right") - 1, 0)])
