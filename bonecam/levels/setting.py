"""What all levels of one morph share: the samples of the energy, the denser ones on which limits are watched, the matrices."""

from dataclasses import dataclass, replace
from functools import cached_property

import scipy.sparse as sp
from jaxtyping import Float
from numpy import ndarray

from bonecam.levels.attraction import Attraction
from bonecam.levels.poles import free_moves
from bonecam.levels.samples import Samples, features, joined, ring_pattern, thin_plate, weightless
from bonecam.levels.stock import Stock
from bonecam.surface.tspline import TSpline

ALONG, AROUND = 3, 3
WATCH_ALONG, WATCH_AROUND = 5, 5


@dataclass(frozen=True, eq=False)
class Setting:
    """The part and its stock; `samples` (about ten a control point) carry the energy, `watch` only limits: an even
    pattern and the vertices of a fine tessellation of the part, which are dense where it is sharp. M as in `samples`, `free`
    as in `poles`."""

    surface: TSpline
    stock: Stock
    attraction: Attraction
    samples: Samples
    watch: Samples
    M: sp.csc_array
    free: sp.csr_array

    @cached_property
    def watch_moves(self) -> sp.csr_array:
        """What the watched samples make of the free moves."""
        return sp.csr_array(self.watch.R @ self.free)

    def watching(self, parameters: Float[ndarray, "n 2"]) -> "Setting":
        """The same with more samples watched, at these (s, t)."""
        return replace(self, watch=joined(self.watch, weightless(self.surface, parameters)))


def setting_of(surface: TSpline, stock: Stock, attraction: Attraction) -> Setting:
    """The samples and matrices of one morph."""
    samples, watch = ring_pattern(surface, ALONG, AROUND), joined(ring_pattern(surface, WATCH_ALONG, WATCH_AROUND), features(surface))
    return Setting(surface, stock, attraction, samples, watch, thin_plate(surface), free_moves(surface))
