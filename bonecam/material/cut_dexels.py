"""What stands after tool paths, on rays: what their balls have left of the stock, and what balls and flutes have."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.material.dexels import Dexels, Poses, dexels_of
from bonecam.setup.stock import Stock
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import MoveKind, ToolPath


@dataclass(frozen=True, eq=False)
class CutDexels:
    """What `balls` alone have left, and what whole `cutters`, balls and the flutes above them, have left."""

    balls: Dexels
    cutters: Dexels

    def after(self, path: ToolPath) -> "CutDexels":
        """What is left behind the cuts of a path."""
        starts, ends = cut_poses(path)
        if not len(ends[0]):
            return self
        radius, reach, body = path.cutter.radius, path.cutter.reach, path.cutter.body
        if len(body):
            cutters = self.cutters.without(starts, ends, radius, reach, body)
            one = self.balls is self.cutters
            return CutDexels(cutters if one else self.balls.without(starts, ends, radius, reach, body), cutters)
        return CutDexels(self.balls.without(starts, ends, radius), self.cutters.without(starts, ends, radius, reach))

    def cut_little(
        self, lines: Sequence[Poses], removed: Sequence[Poses], cutter: Cutter, allowed: Float[ndarray, " k"]
    ) -> Bool[ndarray, " k"]:
        """Whether neither the ball alone nor ball and flutes remove more than is `allowed` (mm^3) on straight moves
        through the poses of each line, behind tools in the poses `removed` of that line."""
        if cutter.is_bull:
            cut = self.cutters.removed_by(lines, removed, cutter.radius, cutter.reach, cutter.body)
            return cut <= allowed
        little = self.balls.removed_by(lines, removed, cutter.radius) <= allowed
        asked = np.flatnonzero(little).tolist()
        lines, removed = [lines[k] for k in asked], [removed[k] for k in asked]
        little[asked] = self.cutters.removed_by(lines, removed, cutter.radius, cutter.reach) <= allowed[asked]
        return np.asarray(little)


def uncut_rays(stock: Stock) -> CutDexels:
    """The stock before the first cut."""
    dexels = dexels_of(stock)
    return CutDexels(dexels, dexels)


def cut_poses(path: ToolPath) -> tuple[Poses, Poses]:
    """Ball centre and axis at beginning and end of each cutting move; a pass begins with one of no length."""
    centres = path.balls
    cutting = path.kinds == MoveKind.CUT
    goes_on = np.r_[False, cutting[:-1] & (path.pass_index[1:] == path.pass_index[:-1])]
    before = np.where(goes_on, np.arange(len(centres)) - 1, np.arange(len(centres)))
    starts = centres[before[cutting]], path.axes[before[cutting]]
    return starts, (centres[cutting], path.axes[cutting])
