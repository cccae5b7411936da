"""What all levels of one morph share: the samples of the energy, the denser ones on which limits are watched,
the matrices."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float
from numpy import ndarray

from bonecam.levels.problem.energies.attraction import Attraction
from bonecam.levels.problem.poles import free_moves
from bonecam.levels.problem.samples import (
    Places,
    SurfaceSamples,
    creases,
    join,
    places_at,
    ring_pattern,
    thin_plate,
)
from bonecam.setup.stock import Stock
from bonecam.surface.tspline import TSpline

ENERGY_PATTERN = (3, 3)
"""Samples of the energy: rings in every t-span, and points on each for every knot of its densest control row."""
WATCH_PATTERN = (5, 5)
"""Watched samples, counted alike: denser than those of the energy, between which levels break their limits."""


@dataclass(frozen=True, eq=False)
class Discretisation:
    """The part and its stock; `samples` (about ten a control point) carry the energy, `watch` only limits: an
    even pattern, to which each level has its creases added, and the places where levels broke limits when
    they were measured. M as in `samples`, `free` as in `poles`."""

    surface: TSpline
    stock: Stock
    attraction: Attraction
    samples: SurfaceSamples
    watch: SurfaceSamples
    broken: Places
    M: sp.csc_array
    free: sp.csr_array

    def watched(self, level: Float[ndarray, "c 3"], before: Float[ndarray, "c 3"]) -> Places:
        """All places on which the limits of a level are watched, given its control points and those
        before."""
        return join(
            Places, self.watch, places_at(self.surface, creases(self.watch, level, before)), self.broken
        )

    @cached_property
    def free_M(self) -> sp.csc_array:
        """M over the free moves."""
        return sp.csc_array(self.free.T @ self.M @ self.free)

    def also_watching(self, parameters: Float[ndarray, "n 2"]) -> "Discretisation":
        """The discretisation with more samples watched, at these parameters (s, t)."""
        return replace(self, broken=join(Places, self.broken, places_at(self.surface, parameters)))


def discretise(surface: TSpline, stock: Stock, attraction: Attraction) -> Discretisation:
    """The samples and matrices of one morph."""
    samples, watch = ring_pattern(surface, *ENERGY_PATTERN), ring_pattern(surface, *WATCH_PATTERN)
    none = places_at(surface, np.empty((0, 2)))
    return Discretisation(
        surface=surface,
        stock=stock,
        attraction=attraction,
        samples=samples,
        watch=watch,
        broken=none,
        M=thin_plate(surface),
        free=free_moves(surface),
    )
