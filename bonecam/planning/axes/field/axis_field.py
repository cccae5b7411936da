"""A field of tool axes over the parameters of a level or a surface: splines for the two angles of the axis.

    polar angle theta(s, t),    azimuth phi(s, t) = 2 pi w s + (a spline),    w = 1, -1, or 0 where s is open

Both splines are bicubic, periodic in s where the surface is closed round. On a machine with a turning table theta and
phi are, but for signs and offsets, the angles of the two rotary axes: what is smooth here turns the machine smoothly.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.interpolate import BSpline
from scipy.sparse import csr_array, eye_array, kron, vstack

from bonecam.arrays import frozen
from bonecam.surface.tspline import TSpline

AROUND = 20
"""Control values along s."""
ALONG = 24
"""Control values along t."""
DEGREE = 3
"""Of the splines in both parameters."""


@dataclass(frozen=True)
class FieldDomain:
    """Lowest and highest s and t; `closed`: s comes round to itself."""

    s: tuple[float, float]
    t: tuple[float, float]
    closed: bool

    @classmethod
    def of(cls, surface: TSpline) -> "FieldDomain":
        """The parameters of a surface."""
        (s0, s1), (t0, t1) = ((float(low), float(high)) for low, high in surface.domain)
        return cls((s0, s1), (t0, t1), bool(surface.elements().period[0] > 0))

    def round(self, s: Float[ndarray, " n"]) -> Float[ndarray, " n"]:
        """Which part of the way from the lowest to the highest s."""
        return (s - self.s[0]) / (self.s[1] - self.s[0])


@dataclass(frozen=True, eq=False)
class AxisField:
    """The field over a domain; `polar` and `azimuth` are control values in radians, s the faster index; `winding`
    is w."""

    domain: FieldDomain
    winding: int
    azimuth: Float[ndarray, " k"]
    polar: Float[ndarray, " k"]

    def __post_init__(self) -> None:
        object.__setattr__(self, "azimuth", frozen(self.azimuth))
        object.__setattr__(self, "polar", frozen(self.polar))

    @classmethod
    def constant(cls, domain: FieldDomain, axis: Float[ndarray, "3"]) -> "AxisField":
        """The field of winding 0 that is one unit axis everywhere."""
        each = np.ones(AROUND * ALONG)
        return cls(domain, 0, np.arctan2(axis[1], axis[0]) * each, np.arccos(np.clip(axis[2], -1, 1)) * each)

    def axes(self, parameters: Float[ndarray, "n 2"]) -> Float[ndarray, "n 3"]:
        """Unit tool axes at (s, t)."""
        B = basis(parameters, self.domain)
        wound = 2 * np.pi * self.winding * self.domain.round(parameters[:, 0])
        return axes_of(wound + B @ self.azimuth, B @ self.polar)


def basis(parameters: Float[ndarray, "n 2"], domain: FieldDomain) -> csr_array:
    """Values of the products of B-splines at (s, t): sparse (n, AROUND ALONG)."""
    if not len(parameters):
        return csr_array((0, AROUND * ALONG))
    share = domain.round(parameters[:, 0])
    t = np.clip(parameters[:, 1], *domain.t)
    if domain.closed:
        s_knots = np.arange(-DEGREE, AROUND + DEGREE + 1) / AROUND
        around = BSpline.design_matrix(np.mod(share, 1.0), s_knots, DEGREE)
    else:
        around = BSpline.design_matrix(np.clip(share, 0, 1), _clamped((0.0, 1.0), AROUND), DEGREE)
    along = BSpline.design_matrix(t, _clamped(domain.t, ALONG), DEGREE)
    count = len(t)
    each = DEGREE + 1
    values = along.data.reshape(count, each, 1) * around.data.reshape(count, 1, each)
    columns = along.indices.reshape(count, each, 1) * AROUND + around.indices.reshape(count, 1, each) % AROUND
    rows = np.repeat(np.arange(count), each**2)
    return csr_array((values.ravel(), (rows, columns.ravel())), shape=(count, AROUND * ALONG))


def second_differences(domain: FieldDomain) -> csr_array:
    """Second differences of control values: along s, of a closed domain those of its rings, and along t."""
    ring = np.eye(AROUND)
    around = 2 * ring - np.roll(ring, 1, axis=1) - np.roll(ring, -1, axis=1)
    if not domain.closed:
        around = np.diff(ring, 2, axis=0)
    along = np.diff(np.eye(ALONG), 2, axis=0)
    parts = [kron(eye_array(ALONG), csr_array(around)), kron(csr_array(along), eye_array(AROUND))]
    return vstack(parts, format="csr")


def axes_of(azimuth: Float[ndarray, " n"], polar: Float[ndarray, " n"]) -> Float[ndarray, "n 3"]:
    """Unit vectors of azimuth and polar angle."""
    across = np.sin(polar)
    return np.column_stack([across * np.cos(azimuth), across * np.sin(azimuth), np.cos(polar)])


def _clamped(interval: tuple[float, float], count: int) -> Float[ndarray, " k"]:
    """Knots of `count` B-splines over an interval, at whose ends the first and the last are 1."""
    low, high = interval
    inner = np.linspace(low, high, count - DEGREE + 1)
    return np.concatenate([np.full(DEGREE, low), inner, np.full(DEGREE, high)])
