"""One bicubic tensor-product B-spline surface: knots with multiplicities, poles and weights."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int64
from numpy import ndarray

from bonecam.arrays import frozen
from bonecam.surface.basis.knots import span_functions


@dataclass(frozen=True, eq=False)
class Knots:
    """Cubic knots of one direction: distinct `values` (k,) with `multiplicities` (k,); closed: the last one
    is the first again.

    Open ends have multiplicity 4. In a closed direction pole 0 belongs to the function whose last support
    interval but one begins at the first knot (as OpenCASCADE counts them).
    """

    values: Float[ndarray, " k"]
    multiplicities: Int64[ndarray, " k"]
    closed: bool

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", frozen(self.values))
        object.__setattr__(self, "multiplicities", frozen(self.multiplicities, np.int64))

    @property
    def poles(self) -> int:
        """Number of poles in this direction."""
        return int(self.multiplicities[:-1].sum()) if self.closed else int(self.multiplicities.sum()) - 4

    @property
    def places(self) -> Int64[ndarray, " f"]:
        """Which knot each of the poles + 4 flat knots is; beyond the ends of a closed direction they go on
        counting."""
        if not self.closed:
            return np.repeat(np.arange(len(self.values)), self.multiplicities)
        cells = len(self.values) - 1
        once = np.repeat(np.arange(cells), self.multiplicities[:-1])
        turn, index = np.divmod(np.arange(self.poles + 4) + self.multiplicities[0] - 4, len(once))
        return once[index] + cells * turn

    @property
    def flat(self) -> Float[ndarray, " f"]:
        """The poles + 4 flat knots: pole i acts on [flat[i], flat[i + 4]]."""
        cells = len(self.values) - 1
        if not self.closed:
            return self.values[self.places]
        turn, index = np.divmod(self.places, cells)
        return self.values[index] + (self.values[-1] - self.values[0]) * turn

    def functions(self, x: Float[ndarray, " n"]) -> tuple[Float[ndarray, "n 4"], Int64[ndarray, "n 4"]]:
        """The four functions that live at each x inside [values[0], values[-1]], and the poles they belong
        to."""
        low, high = self.values[0], self.values[-1]
        period = high - low
        flat = self.flat
        count = self.poles
        if self.closed:
            x = low + np.mod(x - low, period)
            flat = np.concatenate([flat, flat[4:8] + period]) if count >= 4 else _unroll(flat, count, period)
        last = np.searchsorted(flat, high, side="left") - 1
        span = np.clip(np.searchsorted(flat, x, side="right") - 1, 3, last)
        values = span_functions(flat[span[:, None] + np.arange(-3, 5)], x, 0)[0]
        return values, (span[:, None] + np.arange(-3, 1)) % count


def _unroll(flat: ndarray, count: int, period: float) -> ndarray:
    """Flat knots of a closed direction with fewer than four poles, prolonged by four."""
    more = np.arange(len(flat), len(flat) + 4)
    return np.concatenate([flat, flat[more % count] + period * (more // count)])


@dataclass(frozen=True, eq=False)
class BSplineSurface:
    """One bicubic B-spline: poles (a, b, 3) in mm and weights (a, b), the first index along s."""

    s_knots: Knots
    t_knots: Knots
    poles: Float[ndarray, "a b 3"]
    weights: Float[ndarray, "a b"]

    def __post_init__(self) -> None:
        object.__setattr__(self, "poles", frozen(self.poles))
        object.__setattr__(self, "weights", frozen(self.weights))
        wanted = (self.s_knots.poles, self.t_knots.poles)
        if self.poles.shape != (*wanted, 3) or self.weights.shape != wanted:
            raise ValueError(
                f"the knots need {wanted} poles and weights, not {self.poles.shape[:2]} and {self.weights.shape}"
            )

    @property
    def rational(self) -> bool:
        """Whether the weights differ."""
        return bool(np.ptp(self.weights) > 0)

    @property
    def size(self) -> float:
        """Diagonal of the box round the poles, mm."""
        return float(np.linalg.norm(np.ptp(self.poles.reshape(-1, 3), axis=0)))

    @property
    def collapsed(self) -> tuple[bool, bool]:
        """Whether the first and the last row of poles along t is one point."""
        return bool(np.ptp(self.poles[:, 0], axis=0).max() == 0), bool(np.ptp(self.poles[:, -1], axis=0).max() == 0)

    @property
    def watertight(self) -> bool:
        """Whether the surface encloses a volume: closed in s, and at both ends of t closed or collapsed."""
        return self.s_knots.closed and (self.t_knots.closed or all(self.collapsed))

    def evaluate(self, s: Float[ndarray, " n"], t: Float[ndarray, " n"]) -> Float[ndarray, "n 3"]:
        """S at parameters inside the domain (mm); a closed direction wraps."""
        around, i = self.s_knots.functions(s)
        along, j = self.t_knots.functions(t)
        share = around[:, :, None] * along[:, None, :] * self.weights[i[:, :, None], j[:, None, :]]
        points: ndarray = (
            np.einsum("nij,nijc->nc", share, self.poles[i[:, :, None], j[:, None, :]]) / share.sum(axis=(1, 2))[:, None]
        )
        return points
