"""What all levels of one morph share, and where one level stands before it moves.

Two sets of samples: `samples` with the integration weights of the energy, and the denser `watch` on which limits are measured.
`support` lists for each control point the watched samples it matters to.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float
from numpy import ndarray
from scipy.sparse.linalg import SuperLU, splu

from bonecam.levels.attraction import Attraction, unit
from bonecam.levels.energy import Samples, integration_points, samples_of, thin_plate, watch_points
from bonecam.levels.limits import frames
from bonecam.levels.stock import Stock
from bonecam.surface.tspline import TSpline

SUPPORT, MOVED, FIT_STIFFNESS = 0.1, 0.02, 1e-9
LANDING_ROUNDS, SHRINK, CLEAR = 10, 0.016, 0.012


@dataclass(frozen=True, eq=False)
class Setting:
    """The samples, the energy's matrices and their factors."""

    stock: Stock
    attraction: Attraction
    samples: Samples
    watch: Samples
    M: sp.csc_array
    support: sp.csc_array
    moved: sp.csc_array
    fit: SuperLU
    smooth: SuperLU

    def over_support(self, values: Float[ndarray, "n"]) -> Float[ndarray, "c"]:
        """For each control point the largest value among the watched samples it matters to."""
        return np.asarray(np.maximum.reduceat(values[self.support.indices], self.support.indptr[:-1]))

    def least_share(self, shares: Float[ndarray, "n"]) -> Float[ndarray, "c"]:
        """For each control point the smallest share among all the watched samples it moves at all."""
        return np.asarray(np.minimum.reduceat(shares[self.moved.indices], self.moved.indptr[:-1]))


def setting_of(surface: TSpline, stock: Stock, attraction: Attraction, smoothing: float) -> Setting:
    """The matrices and factors of one morph; `smoothing` is the thin-plate weight on the field of directions."""
    samples, M, watch = samples_of(surface, *integration_points(surface)), thin_plate(surface), watch_points(surface)
    fit, smooth = (splu(sp.csc_matrix(samples.N + stiffness * M)) for stiffness in (FIT_STIFFNESS, smoothing))
    return Setting(stock, attraction, samples, watch, M, _support(watch.R, SUPPORT), _support(watch.R, MOVED), fit, smooth)


def _support(R: sp.csr_array, share: float) -> sp.csc_array:
    """R without the entries below this share of their column's largest."""
    kept = sp.csc_array(R, copy=True)
    largest = kept.max(axis=0).toarray().ravel()
    kept.data[kept.data < share * np.repeat(largest, np.diff(kept.indptr))] = 0
    kept.eliminate_zeros()
    return kept


@dataclass(frozen=True, eq=False)
class Place:
    """A level before it moves: control points P, points on the integration samples with their gap to the stock and the
    direction of their pull; points and normals on the watched samples; each control point's frame (first axis: its pull),
    its way to where it lands on the wall, and the wall's outward normal there.
    """

    P: Float[ndarray, "c 3"]
    points: Float[ndarray, "n 3"]
    gap: Float[ndarray, "n"]
    pull: Float[ndarray, "n 3"]
    watched: Float[ndarray, "w 3"]
    normals: Float[ndarray, "w 3"]
    frame: Float[ndarray, "c 3 3"]
    outward: Float[ndarray, "c 3"]
    room: Float[ndarray, "c"]


def place_of(setting: Setting, P: Float[ndarray, "c 3"]) -> Place:
    """Where the level with control points P stands."""
    samples, stock = setting.samples, setting.stock
    points = samples.R @ P
    gap = -stock.signed_distance(points)
    landing = _landing(setting, P, points + (gap - SHRINK)[:, None] * stock.outward(points))
    field = setting.smooth.solve(samples.moments(setting.attraction(points, samples.normals(P), stock)))
    outward = stock.outward(P)
    room = ((landing - P) * outward).sum(1)
    watched = setting.watch.R @ P
    return Place(P, points, gap, unit(samples.R @ field), watched, setting.watch.normals(P), frames(field), outward, room)


def _landing(setting: Setting, P: ndarray, nearest: ndarray) -> ndarray:
    """Where the control points lie once the level has landed: the best fit to the wall, drawn in until it is inside."""
    landing = setting.fit.solve(setting.samples.moments(nearest) + FIT_STIFFNESS * (setting.M @ P))
    for _ in range(LANDING_ROUNDS):
        outside = setting.over_support(setting.stock.signed_distance(setting.watch.R @ landing) + CLEAR)
        if outside.max() <= 0:
            break
        landing -= np.maximum(outside, 0)[:, None] * setting.stock.outward(landing)
    return np.asarray(landing)
