"""What stands as an upright beam, held at its lower end: compliance, stress and lowest frequency.

A force F at the place p bends the slice at the place c by the moment (p - c) x F, and a turn of that slice moves p.
With the flexibility S of a slice a length, P = [p]x and [c]x the matrices of the cross product, all slices below p give

    C(p) = P^T A0 P - P^T A1 - A1^T P + A2 + shear + axial,
    A0 = int S,    A1 = int S [c]x,    A2 = int [c]x^T S [c]x,
    S = blockdiag(inv(E [[Ixx, -Ixy], [-Ixy, Iyy]]), 1 / (G J)),    J = A^4 / (4 pi^2 (Ixx + Iyy))

(Saint-Venant's J; Ixx = int y^2), as sums over slices that are made once. Shear is that of a round section (Cowper
1966: 6 (1 + nu) / (7 + 6 nu)). Left out: what the holder of the lower end gives way, and all that is not bending of
slender pieces (a shoulder is a slice of `sections.shoulder`).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.linalg import eigh

from bonecam.mechanics.sections import Sections
from bonecam.runtime.threads import on_one_blas_thread

POISSON = 0.33
"""Poisson's ratio where a material states none: aluminium and titanium 0.33, PEEK 0.38 to 0.40, bone 0.3 to 0.4; from
0.3 to 0.4 a compliance changes by less than 1 %."""
AT_ONCE = 4000
"""Contacts whose stress is found at once."""


@dataclass(frozen=True, eq=False)
class Support:
    """What holds a beam at a further `place` (3,), mm: its `stiffness` (3, 3), N/mm. A pin that carries no force along
    itself has zeros there."""

    place: Float[ndarray, "3"]
    stiffness: Float[ndarray, "3 3"]


@dataclass(frozen=True, eq=False)
class _Integrals:
    """Sums over the slices below a height: A0, A1, A2 of the bending, and what shear and pull give; mm, N."""

    a0: Float[ndarray, "n 3 3"]
    a1: Float[ndarray, "n 3 3"]
    a2: Float[ndarray, "n 3 3"]


@dataclass(frozen=True, eq=False)
class Beam:
    """A beam of `sections`, rigidly held below the first, of a material with `youngs` modulus (MPa) and Poisson's
    ratio, and with a further `support` if it has one.

    ValueError where the modulus is not positive, the ratio is not between -1 and 0.5, or a slice has no area.
    """

    sections: Sections
    youngs: float
    poisson: float = POISSON
    support: Support | None = None

    def __post_init__(self) -> None:
        if not (self.youngs > 0 and -1 < self.poisson < 0.5):
            raise ValueError(f"E = {self.youngs:g} MPa, nu = {self.poisson:g}: give E > 0 and -1 < nu < 0.5")
        empty = (self.sections.area <= 0) & (self.sections.flexible > 0)
        if empty.any():
            raise ValueError(f"nothing stands at z = {self.sections.z[empty][0]:.2f} mm, below other material")

    def compliance(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3 3"]:
        """Displacement of each point for a unit force there, mm/N; row i is that along coordinate i."""
        compliance = self._free(points, points)
        if self.support is None:
            return compliance
        place = np.broadcast_to(self.support.place, points.shape)
        there = self._free(place, points)
        return compliance - self._free(points, place) @ self._reaction @ there

    def moment_stress(self, forces: Float[ndarray, "n 3"], points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        """The largest bending stress (MPa) in the slices below each point under a force (N) there, each slice as the
        ellipse with its second moments: exact for a round neck."""
        stresses = [
            self._stress(forces[start : start + AT_ONCE], points[start : start + AT_ONCE])
            for start in range(0, len(points), AT_ONCE)
        ]
        return np.concatenate(stresses) if stresses else np.zeros(0)

    @on_one_blas_thread
    def first_frequency(self, density: float) -> float:
        """The lowest natural frequency (Hz) of the beam, the mass of a `density` (kg/m^3) in the middles of slices."""
        solid = np.flatnonzero(self._mass > 0)
        centroids = self._centroids[solid]
        count = len(solid)
        one, other = (each.ravel() for each in np.indices((count, count)))
        pairs = self._free(centroids[one], centroids[other])
        if self.support is not None:
            fixed = np.broadcast_to(self.support.place, centroids.shape)
            to, back = self._free(centroids, fixed), self._free(fixed, centroids)
            pairs = pairs - to[one] @ self._reaction @ back[other]
        root = np.repeat(np.sqrt(1e-12 * density * self._mass[solid]), 3)
        flexibility = pairs.reshape(count, count, 3, 3).transpose(0, 2, 1, 3).reshape(3 * count, -1)
        matrix = root[:, None] * flexibility * root
        largest = eigh(matrix, eigvals_only=True, subset_by_index=[3 * count - 1] * 2)[0]
        return float(1 / (2 * np.pi * np.sqrt(largest)))

    def _free(self, at: Float[ndarray, "n 3"], load: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3 3"]:
        """Displacement of the places `at` for unit forces at `load`, without the support, mm/N."""
        sums = self._below(np.minimum(at[:, 2], load[:, 2]))
        to, by = _cross_matrix(at), _cross_matrix(load)
        turned = to.transpose(0, 2, 1)
        first = sums.a1.transpose(0, 2, 1)
        return turned @ sums.a0 @ by - turned @ sums.a1 - first @ by + sums.a2

    @cached_property
    def _reaction(self) -> Float[ndarray, "3 3"]:
        """Force of the support for a displacement that its place would have without it, N/mm."""
        assert self.support is not None
        place = self.support.place[None]
        stiffness = self.support.stiffness
        return stiffness @ np.linalg.inv(np.eye(3) + self._free(place, place)[0] @ stiffness)

    @cached_property
    def _mass(self) -> Float[ndarray, " n"]:
        """Volumes of the slices, mm^3."""
        return self.sections.area * (self.sections.high - self.sections.low)

    @cached_property
    def _centroids(self) -> Float[ndarray, "n 3"]:
        return np.column_stack([self.sections.centroid, self.sections.z])

    @cached_property
    def _flexibility(self) -> Float[ndarray, "n 3 3"]:
        """S of each slice; zero of one that is rigid."""
        cut = self.sections
        bends = cut.flexible > 0
        second = np.where(bends[:, None, None], cut.second, np.eye(2))
        polar = second[:, 0, 0] + second[:, 1, 1]
        area = np.where(bends, cut.area, 1.0)
        flexibility = np.zeros((len(second), 3, 3))
        # inv([[Ixx, -Ixy], [-Ixy, Iyy]]) is that of `second`, (yy and xx changed over) over the determinant
        flexibility[:, :2, :2] = second / np.linalg.det(second)[:, None, None] / self.youngs
        flexibility[:, 2, 2] = 4 * np.pi**2 * polar / area**4 * 2 * (1 + self.poisson) / self.youngs
        return np.where(bends[:, None, None], flexibility, 0.0)

    @cached_property
    def _stretch(self) -> Float[ndarray, "n 3"]:
        """What shear (x, y) and pull (z) give, a length; mm/N/mm."""
        area = np.where(self.sections.flexible > 0, self.sections.area, np.inf)
        factor = 6 * (1 + self.poisson) / (7 + 6 * self.poisson)
        shear = 2 * (1 + self.poisson) / factor
        return np.array([shear, shear, 1.0]) / (self.youngs * area[:, None])

    def _pieces(
        self, which: Int[ndarray, " n"], top: Float[ndarray, " n"], flexible: Float[ndarray, " n"]
    ) -> _Integrals:
        """The integrals over slices from their lower ends to `top`, a `flexible` length of which bends."""
        low = self.sections.low[which]
        place = np.column_stack([self.sections.centroid[which], (low + top) / 2])
        each = self._flexibility[which] * flexible[:, None, None]
        cross = _cross_matrix(place)
        upward = _cross_matrix(np.array([[0.0, 0.0, 1.0]]))
        within = ((top - low) ** 2 / 12)[:, None, None] * (upward.transpose(0, 2, 1) @ each @ upward)
        second = cross.transpose(0, 2, 1) @ each @ cross + within
        straight = (self._stretch[which] * flexible[:, None])[:, :, None] * np.eye(3)
        return _Integrals(each, each @ cross, second + straight)

    @cached_property
    def _sums(self) -> _Integrals:
        """The integrals over all slices below each, the first of them zero."""
        whole = self._pieces(np.arange(len(self.sections.low)), self.sections.high, self.sections.flexible)
        zero = np.zeros((1, 3, 3))
        return _Integrals(*(np.concatenate([zero, np.cumsum(part, axis=0)]) for part in (whole.a0, whole.a1, whole.a2)))

    def _below(self, heights: Float[ndarray, " n"]) -> _Integrals:
        """The integrals over what is below each height."""
        cut = self.sections
        full = np.searchsorted(cut.high, heights, side="right")
        which = np.minimum(full, len(cut.low) - 1)
        top = np.clip(heights, cut.low[which], cut.high[which])
        extent = cut.high[which] - cut.low[which]
        within = (full < len(cut.low)) & (extent > 0)
        share = np.where(within, (top - cut.low[which]) / np.where(extent > 0, extent, 1.0), 0.0)
        part = self._pieces(which, top, cut.flexible[which] * share)
        sums = self._sums
        return _Integrals(sums.a0[full] + part.a0, sums.a1[full] + part.a1, sums.a2[full] + part.a2)

    def _stress(self, forces: Float[ndarray, "n 3"], points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        """As `moment_stress`; of a run of like slices both ends tell all."""
        cut = self.sections
        bends = np.flatnonzero((cut.flexible > 0) & (cut.high > cut.low))
        strength = 4 * self.youngs / cut.area[bends, None, None] * self._flexibility[bends, :2, :2]
        centroids = cut.centroid[bends]
        new = np.r_[True, (strength[1:] != strength[:-1]).any(axis=(1, 2)) | (np.diff(centroids, axis=0) != 0).any(1)]
        runs = np.flatnonzero(new)
        low, high = cut.low[bends][runs], cut.high[bends][np.r_[runs[1:], len(bends)] - 1]
        met = points[:, 2:] > low
        worst = np.zeros(len(points))
        for ends in (np.broadcast_to(low, met.shape), np.minimum(high, points[:, 2:])):
            moment = self._moment(forces, points, centroids[runs], ends)
            square = np.einsum("nsi,sij,nsj->ns", moment, strength[runs], moment)
            worst = np.maximum(worst, np.where(met, square, 0.0).max(axis=1, initial=0.0))
        return np.sqrt(worst)

    def _moment(
        self,
        forces: Float[ndarray, "n 3"],
        points: Float[ndarray, "n 3"],
        centroids: Float[ndarray, "s 2"],
        heights: Float[ndarray, "n s"],
    ) -> Float[ndarray, "n s 2"]:
        """Bending moments (Nmm) about X and Y at places of each of some heights, of all forces above."""
        pairs = [(points, forces)]
        if self.support is not None:
            place = np.broadcast_to(self.support.place, points.shape)
            moved = (self._free(place, points) @ forces[:, :, None])[:, :, 0]
            pairs.append((place, -moved @ self._reaction.T))
        moments = np.zeros((*heights.shape, 2))
        for place, force in pairs:
            x, y = (place[:, None, k] - centroids[:, k] for k in range(2))
            up = place[:, 2:] - heights
            above = up >= 0
            moments[:, :, 0] += np.where(above, y * force[:, 2:] - up * force[:, 1:2], 0.0)
            moments[:, :, 1] += np.where(above, up * force[:, :1] - x * force[:, 2:], 0.0)
        return moments


def _cross_matrix(vectors: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3 3"]:
    """[v]x, with [v]x w = v x w."""
    matrices = np.zeros((len(vectors), 3, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        matrices[:, j, k], matrices[:, k, j] = -vectors[:, i], vectors[:, i]
    return matrices
