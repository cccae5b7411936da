"""What all levels of one morph share: the samples of the energy, the denser ones on which limits are watched,
the matrices.

A pole that is smooth stays smooth: the ring of control points next to it moves as one affine map of
itself.

Each of the ring's points alone could leave the plane they share with the pole, which then becomes the tip of
a cone, and folds.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float
from numpy import ndarray

from bonecam.levels.problem.energies.attraction import Attraction
from bonecam.levels.problem.samples import Places, SurfaceSamples, creases, join, places_at, ring_pattern, thin_plate
from bonecam.setup.stock import Stock
from bonecam.surface.tspline import TSpline

FLAT = 1e-6
"""Thickness of a ring, as a share of its size, that counts as none."""


def free_moves(surface: TSpline) -> sp.csr_array:
    """B of moves = B d: the moves of all control points (c) from those d (m) that are free. Of a ring round a
    pole with two directions in its plane, two points are: the others are where the affine map of pole and
    ring that they give takes them."""
    starts, size = surface.tmesh.row_starts, surface.tmesh.size
    B = sp.lil_array(sp.eye_array(size))
    bound = np.zeros(size, dtype=bool)
    for has_pole, pole, ring in zip(
        surface.tmesh.poles, (0, size - 1), (range(starts[1], starts[2]), range(starts[-3], starts[-2]))
    ):
        points = np.array(ring)
        offsets = surface.control_points[points] - surface.control_points[pole]
        _, sizes, axes = np.linalg.svd(offsets, full_matrices=False)
        flat = offsets @ axes[sizes > FLAT * sizes[0]].T
        count = flat.shape[1]
        if not has_pole or len(points) <= count:
            continue

        # As many of the points as they have coordinates, the farthest first, each next one as independent of those as
        # can be
        leading: list[int] = []
        rest = flat.copy()
        for _ in range(flat.shape[1]):
            leading.append(int(np.argmax(np.linalg.norm(rest, axis=1))))
            away = rest[leading[-1]] / np.linalg.norm(rest[leading[-1]])
            rest = rest - (rest @ away)[:, None] * away

        shares = flat @ np.linalg.inv(flat[leading])
        B[points, :] = 0.0
        B[points, pole] = 1 - shares.sum(1)
        for k in range(count):
            B[points, points[leading[k]]] = shares[:, k]
        bound[np.delete(points, leading)] = True
    return sp.csr_array(sp.csc_array(B)[:, np.flatnonzero(~bound)])


ENERGY_PATTERN = (3, 3)
"""Samples of the energy: rings in every t-span, and points on each for every knot of its densest control row."""
WATCH_PATTERN = (5, 5)
"""Watched samples, counted alike: denser than those of the energy, between which levels break their limits."""


@dataclass(frozen=True, eq=False)
class Discretisation:
    """The part and its stock; `samples` (about ten a control point) carry the energy, `watch` only limits: an
    even pattern, to which each level has its creases added, and the places where levels broke limits when
    they were measured. M as in `samples`, `free` as in `free_moves`."""

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
        return join(Places, self.watch, places_at(self.surface, creases(self.watch, level, before)), self.broken)

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
