"""The limits of one level's program, as planes at each sample; each holds where the sample's foot and nearest stock point say.

A sample y = S_new(l) has the foot c on the level before, with the outward normal n there, and y - c is along n. So

    depth     n . (y - c) <= depth          the distance to the level before, not to where the sample came from: it may slide
    nesting   n . (y - c) >= low            low is zero, or a little more where there is room
    stock     m . y <= h                    the plane that touches the stock, `clearance` inside, at the nearest stock point

The planes are exact at y itself; `limits_at` sets them up again when y has moved on.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float
from numpy import ndarray

from bonecam.kernels import splitting
from bonecam.levels.solve import Rows
from bonecam.levels.stock import Stock
from bonecam.surface.tspline import TSpline

EDGE, CLEAR_OF, TIP = 1e-4, 0.02, 32


@dataclass(frozen=True, eq=False)
class Limits:
    """low <= n . (y - c) <= high and m . y <= h, one a sample, mm; and the parameters (s, t) of the feet c."""

    c: Float[ndarray, "k 3"]
    n: Float[ndarray, "k 3"]
    low: Float[ndarray, " k"]
    high: Float[ndarray, " k"]
    m: Float[ndarray, "k 3"]
    h: Float[ndarray, " k"]
    s: Float[ndarray, " k"]
    t: Float[ndarray, " k"]

    def heights(self, y: Float[ndarray, "k 3"]) -> Float[ndarray, " k"]:
        """Distance of each sample from the level before, mm, negative behind it."""
        return np.asarray(((y - self.c) * self.n).sum(1))

    def broken(self, y: Float[ndarray, "k 3"]) -> Float[ndarray, " k"]:
        """How far each sample breaks its worst limit, mm; negative: the room it has."""
        height = self.heights(y)
        return np.maximum.reduce([height - self.high, self.low - height, (self.m * y).sum(1) - self.h])

    def only(self, which: ndarray) -> "Limits":
        """Those of some samples."""
        return Limits(*(value[which] for value in (self.c, self.n, self.low, self.high, self.m, self.h, self.s, self.t)))

    def rows(self, R: sp.csr_array, x: Float[ndarray, "k 3"]) -> Rows:
        """The same over the control points' moves D (x, y, z stacked): y = x + R D."""
        along, wall = (sp.hstack([sp.diags_array(v[:, j]) @ R for j in range(3)]) for v in (self.n, self.m))
        start = self.heights(x)
        low = np.concatenate([self.low - start, np.full(len(x), -np.inf)])
        return Rows(sp.csr_array(sp.vstack([along, wall])), low, np.concatenate([self.high - start, self.h - (self.m * x).sum(1)]))


def unset(n: ndarray, s: ndarray, t: ndarray, low: ndarray, high: ndarray) -> Limits:
    """Heights and places to start from; feet and planes are found by `limits_at`."""
    none = np.zeros_like(n)
    return Limits(none, n, low, high, none, np.zeros(len(n)), s, t)


def feet(
    before: TSpline, y: Float[ndarray, "k 3"], s: Float[ndarray, " k"], t: Float[ndarray, " k"], steps: int
) -> tuple[ndarray, ndarray, ndarray, ndarray]:
    """Parameters s and t of the feet of y on a surface, by `steps` of Newton from the given ones; the feet and the normals there.

    A foot is the nearest place that Newton came by, so |y - foot| never understates the distance to the whole surface.
    """
    (low, high), s, t = before.domain[1], s.copy(), t.copy()
    inside = (low + EDGE * (high - low), high - EDGE * (high - low))
    np.clip(t, *inside, out=t)
    best = [np.full(len(y), np.inf), s.copy(), t.copy(), np.empty_like(y), np.empty_like(y), np.empty_like(y)]
    for k in range(steps + 1):
        S, S_s, S_t = before.derivatives(s, t, 1)
        splitting.keep_nearest(y, s, t, S, S_s, S_t, *best)
        if k < steps:
            splitting.foot_step(y, S, S_s, S_t, s, t)
            s -= np.floor(s)
            np.clip(t, *inside, out=t)
    _, s, t, S, S_s, S_t = best
    n = np.cross(S_s, S_t)
    n /= np.maximum(np.linalg.norm(n, axis=1), np.finfo(float).tiny)[:, None]
    for end in inside:
        if (at := t == end).any():
            n[at] = _tip(before, end)
    return s, t, S, n


def _tip(surface: TSpline, t: float) -> Float[ndarray, "3"]:
    """The mean normal round a pole, which may be the tip of a cone."""
    _, S_s, S_t = surface.derivatives(np.arange(TIP) / TIP, np.full(TIP, t), 1)
    n = np.cross(S_s, S_t).sum(0)
    return np.asarray(n / max(float(np.linalg.norm(n)), np.finfo(float).tiny))


def limits_at(before: TSpline, stock: Stock, y: Float[ndarray, "k 3"], old: Limits, clearance: Float[ndarray, " k"], steps: int) -> Limits:
    """The limits where the samples are now; `old` gives where to look for feet, and `clearance` how far inside the stock they stay.

    CLEAR_OF mm and more from its foot a sample's direction from it stands for the normal: the same at a foot, and where Newton has
    not found one, or at the tip of a pole, the distance is not understated.
    """
    s, t, c, n = feet(before, y, old.s, old.t, steps)
    across = y - c
    size = np.linalg.norm(across, axis=1)
    away = size > CLEAR_OF
    n[away] = across[away] * (np.sign((across * n).sum(1)) / np.maximum(size, CLEAR_OF))[away, None]
    m = stock.outward(y)
    return Limits(c, n, old.low, old.high, m, (m * y).sum(1) - stock.signed_distance(y) - clearance, s, t)
