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

GAUSS, AROUND, MOST_AROUND = 3, 3, 400
WATCH_ALONG, WATCH_AROUND, NEAR_POLE = 8, 6, 1e-3


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


def watch_points(surface: TSpline) -> Samples:
    """A denser pattern, without weights, on which limits are watched; with both ends of t, normals there from just inside."""
    around = min(MOST_AROUND, WATCH_AROUND * max(len(knots) for knots in surface.tmesh.s_knots))
    spans = np.unique(surface.tmesh.t_knots[3:-3])
    parts = (np.arange(WATCH_ALONG) + 0.5) / WATCH_ALONG
    inner = (spans[:-1, None] + np.diff(spans)[:, None] * parts).ravel()
    edge = NEAR_POLE * (spans[-1] - spans[0]) * np.array([1, -1])
    s, t = (v.ravel() for v in np.meshgrid(np.arange(around) / around, inner))
    s, t = np.append(s, [0.0, 0.0]), np.append(t, spans[[0, -1]])
    bent = t + np.append(np.zeros(len(t) - 2), edge)
    _, R_s, R_t = surface.basis(s, bent, 1)
    return Samples(s, t, np.zeros(len(s)), surface.basis(s, t)[0], R_s, R_t)


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
