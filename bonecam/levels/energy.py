"""The morph's energy as matrices over the control points (Gan et al. 2014, section 4.2).

    thin plate   c_int * int |S_ss|^2 + 2 |S_st|^2 + |S_tt|^2      = c_int * P' M P
    attraction   c_ext * int |S - H|^2                             = c_ext * (P' N P - 2 P' L + const)

M and N are the same for every level of one surface; L = int R'H changes with the attracting points H. The integrals are
sums over `Samples`: Gauss points in every t-span, evenly spaced points round s (both parameters run over [0, 1]).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float
from numpy import ndarray

from bonecam.surface.tspline import TSpline

GAUSS, AROUND, MOST_AROUND, NEAR_POLE = 3, 3, 400, 1e-3


@dataclass(frozen=True, eq=False)
class Samples:
    """Parameters (s, t) in one fixed pattern, their integration weights, and the basis there: all levels share them."""

    s: Float[ndarray, "n"]
    t: Float[ndarray, "n"]
    weights: Float[ndarray, "n"]
    R: sp.csr_array
    R_s: sp.csr_array
    R_t: sp.csr_array

    def normals(self, control_points: Float[ndarray, "c 3"]) -> Float[ndarray, "n 3"]:
        """Outward unit normals of the surface with these control points."""
        n = np.cross(self.R_s @ control_points, self.R_t @ control_points)
        return np.asarray(n / np.linalg.norm(n, axis=1, keepdims=True))

    @cached_property
    def N(self) -> sp.csc_array:
        """int R'R (control points squared)."""
        return sp.csc_array(self.R.T @ sp.diags_array(self.weights) @ self.R)

    def moments(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "c 3"]:
        """int R'H for one attracting point a sample."""
        return np.asarray(self.R.T @ (self.weights[:, None] * points))


def integration_points(surface: TSpline) -> tuple[ndarray, ndarray, ndarray]:
    """s, t and weights of the integrals."""
    around = min(MOST_AROUND, AROUND * max(len(knots) for knots in surface.tmesh.s_knots))
    spans = np.unique(surface.tmesh.t_knots[3:-3])
    x, w = np.polynomial.legendre.leggauss(GAUSS)
    size = np.diff(spans)
    t = (spans[:-1, None] + size[:, None] * (x + 1) / 2).ravel()
    across = (size[:, None] * w / 2).ravel()
    ss, tt = np.meshgrid(np.arange(around) / around, t)
    return ss.ravel(), tt.ravel(), np.repeat(across / around, around)


def with_poles(surface: TSpline, s: ndarray, t: ndarray, weights: ndarray) -> Samples:
    """The samples at these parameters and, without weight, at both ends of t, with the normals from just inside."""
    low, high = surface.domain[1]
    ends, inner = np.array([low, high]), np.array([low, high]) + NEAR_POLE * (high - low) * np.array([1, -1])
    found = samples_of(surface, s, t, weights)
    R = surface.basis(np.zeros(2), ends)[0]
    _, R_s, R_t = surface.basis(np.zeros(2), inner, 1)
    stack = [sp.csr_array(sp.vstack(pair)) for pair in ((found.R, R), (found.R_s, R_s), (found.R_t, R_t))]
    return Samples(np.append(s, [0.0, 0.0]), np.append(t, ends), np.append(weights, [0.0, 0.0]), *stack)


def samples_of(surface: TSpline, s: ndarray, t: ndarray, weights: ndarray) -> Samples:
    """The samples at these parameters."""
    R, R_s, R_t = surface.basis(s, t, 1)
    return Samples(s, t, weights, R, R_s, R_t)


def thin_plate(surface: TSpline) -> sp.csc_array:
    """M: int R_ss'R_ss + 2 R_st'R_st + R_tt'R_tt over the parameters."""
    s, t, weights = integration_points(surface)
    *_, ss, st, tt = surface.basis(s, t, 2)
    W = sp.diags_array(weights)
    return sp.csc_array(ss.T @ W @ ss + 2 * (st.T @ W @ st) + tt.T @ W @ tt)
