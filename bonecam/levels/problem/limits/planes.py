"""The limits of one level's program, as planes at each sample, given by its closest points on the level before and
on the stock.

A sample y = S_new(l) has the closest point c on the level before, with the outward normal n there, and y - c is
along n. So

    slabs    low <= n . (y - c) <= high    (heights over the level before: the sample may slide)
    walls    m . y <= h                    (computed again as the sample moves)

and of several of a kind the tightest holds. A new one is a new file here with one function, and its
name in SLABS or WALLS. The planes are exact at y itself; `Limits.at` sets them up again when y has moved on.

Nesting: no sample falls behind the level before (the published program leaves this out).
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import dots
from bonecam.kernels.admm import Planes
from bonecam.levels.problem.cut import Cut
from bonecam.levels.problem.limits.depth import depth
from bonecam.levels.problem.limits.linear_limits import LinearLimits
from bonecam.levels.problem.limits.wall import wall
from bonecam.setup.stock import Stock
from bonecam.surface.query.closest_point import closest_points_near
from bonecam.surface.tspline import TSpline

MARGIN, SHARE = 0.001, 0.05
"""The margin: so many mm (as much as a level may fall behind when it is measured), or this share of the room to the
wall where that is less."""


def nesting(cut: Cut, gap: Float[ndarray, " k"]) -> tuple[Float[ndarray, " k"], Float[ndarray, " k"]]:
    """Least and largest height, mm, of samples that are `gap` inside the stock at the level before: above
    zero where there is room."""
    return cut.margin * np.clip(SHARE * (gap - cut.clearance), 0, MARGIN), np.full(len(gap), np.inf)


SLABS = (depth, nesting)
WALLS = (wall,)
"""The limits of a program: those of heights over the level before, and those of the stock."""


def heights(cut: Cut, gap: Float[ndarray, " k"]) -> tuple[Float[ndarray, " k"], Float[ndarray, " k"]]:
    """Lowest and largest height over the level before of samples that are `gap` inside the stock there, by
    all slabs, mm."""
    low, high = zip(*(slab(cut, gap) for slab in SLABS))
    return np.maximum.reduce(low), np.minimum.reduce(high)


@dataclass(frozen=True, eq=False)
class Limits:
    """low <= n . (y - c) <= high and m . y <= h, one a sample, mm; the parameters (s, t) of the feet c; and
    what they are set up from: `gap` is how far inside the stock a sample is at the level before."""

    before: TSpline
    stock: Stock
    cut: Cut
    gap: Float[ndarray, " k"]
    s: Float[ndarray, " k"]
    t: Float[ndarray, " k"]
    c: Float[ndarray, "k 3"]
    n: Float[ndarray, "k 3"]
    low: Float[ndarray, " k"]
    high: Float[ndarray, " k"]
    m: Float[ndarray, "k 3"]
    h: Float[ndarray, " k"]

    @property
    def planes(self) -> Planes:
        """The planes alone, as compiled loops take them."""
        return Planes(self.c, self.n, self.low, self.high, m=self.m, h=self.h)

    def planes_with(self, c: Float[ndarray, "n 3"], n: Float[ndarray, "n 3"], high: Float[ndarray, " n"]) -> Planes:
        """The planes with those of more samples, which have only n . (y - c) <= high."""
        no_limit = np.full(len(c), np.inf)
        slabs = Planes(c, n, low=-no_limit, high=high, m=np.zeros((len(c), 3)), h=no_limit)
        return Planes(*(np.concatenate([mine, its]) for mine, its in zip(self.planes, slabs)))

    def heights(self, y: Float[ndarray, "k 3"]) -> Float[ndarray, " k"]:
        """Distance of each sample from the level before, mm, negative behind it."""
        return dots(y - self.c, self.n)

    def broken(self, y: Float[ndarray, "k 3"]) -> Float[ndarray, " k"]:
        """How far each sample breaks its worst limit, mm; negative: the room it has."""
        height = self.heights(y)
        return np.maximum.reduce([height - self.high, self.low - height, dots(self.m, y) - self.h])

    def at(self, y: Float[ndarray, "k 3"], steps: int) -> "Limits":
        """The limits set up again where the samples are at y; `steps` of Newton find their closest points."""
        return limits_at(self.before, self.stock, cut=self.cut, gap=self.gap, y=y, s=self.s, t=self.t, steps=steps)

    def only(self, which: ndarray) -> "Limits":
        """The limits of some of the samples."""
        names = ("gap", "s", "t", *Planes._fields)
        return replace(self, **{name: getattr(self, name)[which] for name in names})

    def renew(self, which: ndarray, y: Float[ndarray, "k 3"], steps: int) -> "Limits":
        """The limits, those of the samples `which` set up again where they are at y."""
        renewed = self.only(which).at(y[which], steps)
        values = {name: getattr(self, name).copy() for name in ("s", "t", *Planes._fields)}
        for name, value in values.items():
            value[which] = getattr(renewed, name)
        return replace(self, **values)

    def replace_slabs(
        self, which: ndarray, c: Float[ndarray, "n 3"], n: Float[ndarray, "n 3"], high: Float[ndarray, " n"]
    ) -> "Limits":
        """The limits, those of the samples `which` with n . (y - c) <= high instead of their slabs."""
        changed = replace(self, c=self.c.copy(), n=self.n.copy(), low=self.low.copy(), high=self.high.copy())
        changed.c[which] = c
        changed.n[which] = n
        changed.low[which] = -np.inf
        changed.high[which] = high
        return changed

    def rows(self, R: sp.csr_array, x: Float[ndarray, "k 3"]) -> LinearLimits:
        """The limits over the moves D of the control points (x, y, z stacked) with y = x + R D."""
        along, wall = (sp.hstack([sp.diags_array(v[:, j]) @ R for j in range(3)]) for v in (self.n, self.m))
        start = self.heights(x)
        low = np.concatenate([self.low - start, np.full(len(x), -np.inf)])
        return LinearLimits(
            sp.csr_array(sp.vstack([along, wall])), low, np.concatenate([self.high - start, self.h - dots(self.m, x)])
        )


def limits_at(
    before: TSpline,
    stock: Stock,
    cut: Cut,
    gap: Float[ndarray, " k"],
    y: Float[ndarray, "k 3"],
    s: Float[ndarray, " k"],
    t: Float[ndarray, " k"],
    steps: int,
) -> Limits:
    """The limits of samples at y that were `gap` inside the stock at the level before; `steps` of Newton from
    (s, t) find their feet.

    A sample that has slid to where the level before is nearer to the stock than it was itself may be as near:
    else no place there would do.
    """
    s, t, c, n = closest_points_near(before, y, s, t, steps)
    room = np.minimum(gap, -stock.signed_distance(c))
    low, high = heights(cut, room)

    # Of the planes m . y <= h at each sample the one that y breaks most.
    planes = [one(cut, room, stock, y) for one in WALLS]
    m, h = planes[0]
    for other, its in planes[1:]:
        worse = dots(other, y) - its > dots(m, y) - h
        m, h = np.where(worse[:, None], other, m), np.where(worse, its, h)

    return Limits(before, stock, cut=cut, gap=gap, s=s, t=t, c=c, n=n, low=low, high=high, m=m, h=h)
