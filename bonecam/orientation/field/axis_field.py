"""A field of tool axes over the parameters of a closed level: splines for the two angles of the axis.

    polar angle theta(s, t),    azimuth phi(s, t) = 2 pi w s + (a part periodic in s),    w = 1 or -1

Both are bicubic B-splines, periodic in s. On a machine with a turning table theta and phi are, but for signs
and offsets, the angles of the two rotary axes: what is smooth here turns the machine smoothly.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.interpolate import BSpline
from scipy.sparse import csr_array

from bonecam.arrays import frozen

AROUND = 20
"""Control values round the level."""
ALONG = 18
"""Control values from pole to pole."""
DEGREE = 3
"""Of the splines in both parameters."""


@dataclass(frozen=True, eq=False)
class AxisField:
    """The field over s in 0 .. 1 and t in `domain`; `polar` and `azimuth` are control values in radians, t the
    faster index; `winding` is w."""

    domain: tuple[float, float]
    winding: int
    azimuth: Float[ndarray, " k"]
    polar: Float[ndarray, " k"]

    def __post_init__(self) -> None:
        object.__setattr__(self, "azimuth", frozen(self.azimuth))
        object.__setattr__(self, "polar", frozen(self.polar))

    def axes(self, parameters: Float[ndarray, "n 2"]) -> Float[ndarray, "n 3"]:
        """Unit tool axes at (s, t)."""
        B = basis(parameters, self.domain)
        return axes_of(2 * np.pi * self.winding * parameters[:, 0] + B @ self.azimuth, B @ self.polar)


def basis(parameters: Float[ndarray, "n 2"], domain: tuple[float, float]) -> csr_array:
    """Values of the products of B-splines at (s, t): sparse (n, AROUND ALONG)."""
    low, high = domain
    inner = np.linspace(low, high, ALONG - DEGREE + 1)
    t_knots = np.concatenate([np.full(DEGREE, low), inner, np.full(DEGREE, high)])
    s_knots = np.arange(-DEGREE, AROUND + DEGREE + 1) / AROUND
    s, t = np.mod(parameters[:, 0], 1.0), np.clip(parameters[:, 1], low, high)
    around = BSpline.design_matrix(s, s_knots, DEGREE)
    along = BSpline.design_matrix(t, t_knots, DEGREE)
    count, each = len(s), DEGREE + 1
    values = around.data.reshape(count, each, 1) * along.data.reshape(count, 1, each)
    columns = around.indices.reshape(count, each, 1) % AROUND * ALONG + along.indices.reshape(count, 1, each)
    rows = np.repeat(np.arange(count), each**2)
    return csr_array((values.ravel(), (rows, columns.ravel())), shape=(count, AROUND * ALONG))


def axes_of(azimuth: Float[ndarray, " n"], polar: Float[ndarray, " n"]) -> Float[ndarray, "n 3"]:
    """Unit vectors of azimuth and polar angle."""
    across = np.sin(polar)
    return np.column_stack([across * np.cos(azimuth), across * np.sin(azimuth), np.cos(polar)])
