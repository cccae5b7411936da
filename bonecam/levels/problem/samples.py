"""Samples of a surface, fixed patterns in its parameters, and the integrals over it as matrices over the
control points.

    thin plate   int |S_ss|^2 + 2 |S_st|^2 + |S_tt|^2      = P' M P          (Gan et al. 2014, section 4.2)
    pull         int |S - H|^2                             = P' N P - 2 P' L + const

M and N are the same for every level of one surface; L = int R'H changes with the attracting points H. The
integrals are sums over `SurfaceSamples`: Gauss points in every t-span, evenly spaced points round s (both parameters
run over [0, 1]).
"""

from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
import scipy.sparse as sp
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.arrays import dots, lengths
from bonecam.kernels import rows
from bonecam.surface.basis.gauss import span_points
from bonecam.surface.query.thin_plate import thin_plate_matrix
from bonecam.surface.tspline import TSpline

GAUSS = 3
"""Gauss points in every t-span; points round s for every knot of the densest row, too. Three integrate polynomials of
degree five exactly; the squares of cubics have six."""
MOST_AROUND = 400
"""Points round s of an integral at most."""
LEAST_AROUND = 12
"""Points on a ring of a pattern at least: one every 30 degrees near the poles, where rows have few knots."""
NEAR_POLE = 1e-3
"""How far from a pole the normal there is taken, as a share of the range of t: at it S_s vanishes."""
CLOSE_TO_POLE = (0.005, 0.02, 0.05)
"""More rings close to the poles, where a level may fold over the pole, as shares of the span there."""
BENT, HOLLOW, MOST_BETWEEN = 0.0005, 0.001, 8
"""Between neighbours of a ring pattern a level may sag by so much (mm) more than the one before, and by so
much in a hollow; there are so many more places there at most."""
SHAPED = 0.3
"""Share of the surface at a sample that control points together have where they shape it."""


@dataclass(frozen=True, eq=False)
class Places:
    """Parameters (s, t) on a surface, and the basis there: all levels share them."""

    s: Float[ndarray, "n"]
    t: Float[ndarray, "n"]
    R: sp.csr_array

    def near(self, which: Bool[ndarray, "n"]) -> Bool[ndarray, "c"]:
        """Control points that shape the surface at some of the places, and those that do where these do."""
        if not which.any():
            return np.zeros(self.R.shape[1], dtype=bool)
        own = self.R[which].sum(axis=0) > 0
        return np.asarray(self.R[self.R @ own > SHAPED].sum(axis=0) > 0)


P = TypeVar("P", bound=Places)


@dataclass(frozen=True, eq=False)
class SurfaceSamples(Places):
    """Places in one fixed pattern, their integration weights, and the derivatives of the basis there."""

    weights: Float[ndarray, "n"]
    R_s: sp.csr_array
    R_t: sp.csr_array

    def normals(self, control_points: Float[ndarray, "c 3"]) -> Float[ndarray, "n 3"]:
        """Outward unit normals of the surface with these control points."""
        n = self.area_vectors(control_points)
        return n / np.linalg.norm(n, axis=1, keepdims=True)

    def area_vectors(self, control_points: Float[ndarray, "c 3"]) -> Float[ndarray, "n 3"]:
        """S_s x S_t: outward, as long as the area per unit of the parameters."""
        return np.cross(multiply(self.R_s, control_points), multiply(self.R_t, control_points))

    @cached_property
    def N(self) -> sp.csc_array:
        """int R'R (control points squared)."""
        return gram(self.R, self.weights)

    def moments(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "c 3"]:
        """int R'H for one attracting point a sample."""
        return self.R.T @ (self.weights[:, None] * points)


def multiply(R: sp.csr_array, points: Float[ndarray, "c 3"]) -> Float[ndarray, "n 3"]:
    """R P, in a third of the time of scipy."""
    y = np.empty((R.shape[0], 3))
    rows.times(R.indptr, R.indices, R.data, np.require(points, np.float64, ["C", "W"]), y)
    return y


def gram(R: sp.csr_array, weights: Float[ndarray, "n"]) -> sp.csc_array:
    """R'WR."""
    weighed = sp.csr_array((R.data * np.repeat(weights, np.diff(R.indptr)), R.indices, R.indptr), shape=R.shape)
    return sp.csc_array(R.T @ weighed)


def integration_points(surface: TSpline) -> tuple[ndarray, ndarray, ndarray]:
    """s, t and weights of the integrals."""
    around = min(MOST_AROUND, GAUSS * max(len(knots) for knots in surface.tmesh.s_knots))
    t, across = span_points(np.unique(surface.tmesh.t_knots[3:-3]), GAUSS)
    ss, tt = np.meshgrid(np.arange(around) / around, t)
    return ss.ravel(), tt.ravel(), np.repeat(across / around, around)


def ring_pattern(surface: TSpline, along: int, around: int) -> SurfaceSamples:
    """`along` rings in every t-span, on each `around` points for every knot of its densest control row; both
    ends of t and rings close to them.

    The weights are areas of the parameters (sum 1). Normals at the ends are those just inside.
    """
    knots, rows = surface.tmesh.t_knots, surface.tmesh.s_knots
    spans = np.unique(knots[3:-3])
    parts = (np.arange(along) + 0.5) / along
    rings = (spans[:-1, None] + np.diff(spans)[:, None] * parts).ravel()
    share = np.repeat(np.diff(spans), along) / along
    near = np.array(CLOSE_TO_POLE)
    rings = np.concatenate([spans[0] + near * (spans[1] - spans[0]), rings, spans[-1] - near * (spans[-1] - spans[-2])])
    share = np.concatenate([0 * near, share, 0 * near])
    first = np.searchsorted(knots, rings, side="right") - 4
    counts = np.array([max(LEAST_AROUND, around * max(len(row) for row in rows[j : j + 4])) for j in first])
    s = np.concatenate([np.arange(count) / count for count in counts])
    t = np.repeat(rings, counts)
    share = np.repeat(share / counts, counts)
    edge = NEAR_POLE * (spans[-1] - spans[0]) * np.array([1, -1])
    s = np.append(s, [0.0, 0.0])
    t = np.append(t, spans[[0, -1]])
    share = np.append(share, [0.0, 0.0])
    _, R_s, R_t = surface.basis(s, t + np.append(np.zeros(len(t) - 2), edge), 1)
    return SurfaceSamples(s, t, R=surface.basis(s, t)[0], weights=share / share.sum(), R_s=R_s, R_t=R_t)


def samples_of(surface: TSpline, s: ndarray, t: ndarray, weights: ndarray) -> SurfaceSamples:
    """The samples at these parameters."""
    R, R_s, R_t = surface.basis(s, t, 1)
    return SurfaceSamples(s, t, R=R, weights=weights, R_s=R_s, R_t=R_t)


def places_at(surface: TSpline, parameters: Float[ndarray, "k 2"]) -> Places:
    """The places at these (s, t), those at the poles left out."""
    low, high = surface.domain[1]
    s, t = parameters[(parameters[:, 1] > low) & (parameters[:, 1] < high)].T
    return Places(s, t, surface.basis(s, t)[0])


def join(kind: type[P], *parts: Places) -> P:
    """All places as one pattern of that kind."""
    values: list[list[Any]] = [[getattr(part, field.name) for part in parts] for field in fields(kind)]
    whole: list[Any] = [
        sp.csr_array(sp.vstack(some)) if sp.issparse(some[0]) else np.concatenate(some) for some in values
    ]
    return kind(*whole)


def creases(
    pattern: SurfaceSamples, level: Float[ndarray, "c 3"], before: Float[ndarray, "c 3"] | None = None
) -> Float[ndarray, "k 2"]:
    """Parameters (s, t) between neighbours of a ring pattern: more where a level bends more than the one
    before, if there is one, and where it is hollow.

    Where both bend alike what is between two samples keeps their distance; but in a hollow the sides meet
    between them.
    """
    rings, starts, counts = np.unique(pattern.t[:-2], return_index=True, return_counts=True)
    x, n = multiply(pattern.R, level), pattern.normals(level)
    turned = n if before is None else n - pattern.normals(before)
    place = np.arange(counts.sum())
    ring = np.repeat(np.arange(len(rings)), counts)
    s = pattern.s[:-2]
    above = np.minimum(ring + 1, len(rings) - 1)
    beside = starts[ring] + (place - starts[ring] + 1) % counts[ring]
    over = starts[above] + np.rint(s * counts[above]).astype(int) % counts[above]
    parameters = []
    for neighbour, ds, dt in ((beside, 1 / counts[ring], 0 * s), (over, 0 * s, rings[above] - rings[ring])):
        across = x[neighbour] - x[:-2]
        bent = lengths(across) * lengths(turned[neighbour] - turned[:-2]) / 8
        hollow = -dots(across, n[neighbour] - n[:-2]) / 8
        more = np.sqrt(np.maximum.reduce([bent / BENT, hollow / HOLLOW, 0 * s]))
        more = np.clip(np.ceil(more) - 1, 0, MOST_BETWEEN).astype(int)
        which = np.repeat(place, more)
        share = (np.arange(len(which)) - np.repeat(np.cumsum(more) - more, more) + 1) / (more[which] + 1)
        parameters.append(np.column_stack([(s[which] + share * ds[which]) % 1.0, pattern.t[which] + share * dt[which]]))
    return np.vstack(parameters)


def thin_plate(surface: TSpline) -> sp.csc_array:
    """M: int R_ss'R_ss + 2 R_st'R_st + R_tt'R_tt over the parameters."""
    return thin_plate_matrix(surface, *integration_points(surface))
