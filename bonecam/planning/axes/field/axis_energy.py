"""The elastic energy of a field of tool axes, as residuals of a least-squares problem.

With the turn D of a rotary axis of speed w over a move that takes the time T at the feed, the rate is D / (w T); 1
means that the axis is as slow as the feed. Differs from Xu et al. (2013), Eq. 22, in:

1. The membrane is taken along the passes only, where a move costs time, not in all directions of the surface.
2. It is taken in the machine's angles, divided by its speeds, not in the components of the axes.
3. The thin plate is the second difference of the control values, not an integral: its matrix is banded.
4. Cones and machine limits are one-sided residuals, so that a field leaves a cone where none holds a smooth one.

On the phalanx's own level the mean feed is 869 of 900 mm/min (501 along the normals): `docs/pages/theory/axes.md`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.sparse import csr_array

from bonecam.arrays import dots, lengths
from bonecam.kernels.normal_equations import add_pairs, csr_parts, width
from bonecam.planning.axes.field.axis_field import FieldDomain, axes_of, basis, second_differences
from bonecam.planning.axes.field.facet_energy import FacetEnergy
from bonecam.tool.elliptic_cones import EllipticCones

SPEED_SHARE = 0.9
"""Rates above this are what the field is freed of first."""
SPEED_WEIGHT = 60.0
"""Of a rate above SPEED_SHARE, against one below it."""
BOUND_WEIGHT = 200.0
"""Of an angle beyond a bound or a cone, in rates a radian."""
SOFT_POLAR = np.radians(95.0)
"""A tool that droops below this polar angle (radians) comes near to table and housing: it costs,"""
SOFT_WEIGHT = 20.0
"""so much, in rates a radian: a tenth of a bound, so that cones come first."""
LEAST_SINE = np.sin(np.radians(5.0))
"""Of a bound from the normal: that of less than 5 degrees weighs no more."""
STRAIGHT = 1e-6
"""Sines below this are taken for it: an angle has no derivative at 0."""
PRESETS = {"membrane": (1.0, 0.2), "thin-plate": (0.1, 2.0)}
"""Weights of the rates, and of second differences of control values in rates a radian."""

Residual = tuple[Float[ndarray, " m"], Float[ndarray, " m"], Float[ndarray, " m"]]
"""Residuals, and their derivatives by azimuth and polar angle."""


@dataclass(frozen=True, eq=False)
class AxisBounds:
    """What the axes at n samples must keep, radians: polar angles between `least_polar` and `largest_polar`, angles
    from the surface normal between `least_lead` and `largest_tilt`, and within the `cones`, `cone_margin` inside their
    rims as `EllipticCones.off` measures it."""

    least_polar: float
    largest_polar: Float[ndarray, " n"]
    least_lead: float
    largest_tilt: Float[ndarray, " n"]
    cones: EllipticCones
    cone_margin: Float[ndarray, " n"]


@dataclass(frozen=True, eq=False)
class AxisEnergy:
    """The energy over n samples in the order of their passes.

    Move k leads from sample `moves[k]` to the next and takes `times[k]` (min) at the feed; `speeds` are those of
    azimuth and polar angle, rad/min. `weights` as in PRESETS. `areas` (mm^2) of the samples weigh their bounds, all
    alike where none are given; `facets` is the energy on those between all contacts.
    """

    parameters: Float[ndarray, "n 2"]
    normals: Float[ndarray, "n 3"]
    domain: FieldDomain
    winding: int
    moves: Int[ndarray, " m"]
    times: Float[ndarray, " m"]
    speeds: tuple[float, float]
    bounds: AxisBounds
    weights: tuple[float, float]
    areas: Float[ndarray, " n"] | None = None
    facets: FacetEnergy | None = None

    @cached_property
    def values_at(self) -> csr_array:
        """From control values to values at the samples, (n, c)."""
        return basis(self.parameters, self.domain)

    @cached_property
    def steps(self) -> csr_array:
        """From control values to differences over the moves, (m, c)."""
        at = self.values_at
        return (at[self.moves + 1] - at[self.moves]).tocsr()

    @cached_property
    def roughness(self) -> csr_array:
        """From control values to their second differences both ways, weighted."""
        differences = second_differences(self.domain)
        return differences * (self.weights[1] / np.sqrt(differences.shape[0]))

    @cached_property
    def bandwidth(self) -> int:
        """How many diagonals the lower band of the normal equations of both angles has."""
        matrices = [self.values_at, self.steps, self.roughness]
        if self.facets is not None:
            matrices.append(self.facets.matrix)
        return 2 * max(width(*csr_parts(matrix)[:2]) for matrix in matrices)

    @cached_property
    def shares(self) -> Float[ndarray, " n"]:
        """Roots of the shares of the whole area that belong to the samples."""
        areas = np.ones(len(self.parameters)) if self.areas is None else self.areas
        return np.sqrt(areas / areas.sum())

    def angles(self, values: Float[ndarray, "2 c"]) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"]]:
        """Azimuth and polar angle at the samples, radians."""
        wound = 2 * np.pi * self.winding * self.domain.round(self.parameters[:, 0])
        return wound + self.values_at @ values[0], self.values_at @ values[1]

    def residuals(self, values: Float[ndarray, "2 c"]) -> tuple["Residuals", ...]:
        """The residuals of moves, of samples, of second differences, and on facets."""
        rough = (self.roughness @ values.T).T
        each = np.ones(rough.shape[1])
        roughness = Residuals.of(self.roughness, [(rough[0], each, 0 * each), (rough[1], 0 * each, each)])
        parts = self._turning(values), self._bounds(*self.angles(values)), roughness
        return parts if self.facets is None else (*parts, self._on_facets(values, self.facets))

    def _on_facets(self, values: Float[ndarray, "2 c"], facets: FacetEnergy) -> "Residuals":
        """The elastic energy on the facets, in rates."""
        residuals: list[Residual] = []
        each = np.ones(facets.matrix.shape[0])
        for angle, wound in ((0, self.winding * facets.wound), (1, 0.0)):
            scale = facets.feed / self.speeds[angle]
            slopes = (scale * each, 0 * each)
            residuals.append((scale * (facets.matrix @ values[angle] + wound), *slopes[:: -1 if angle else 1]))
        return Residuals.of(facets.matrix, residuals)

    def _turning(self, values: Float[ndarray, "2 c"]) -> "Residuals":
        """The rates of both angles, and what they exceed SPEED_SHARE by; a move round the part whose winding alone
        is faster cannot be helped."""
        residuals: list[Residual] = []
        share = np.sqrt(self.times / self.times.sum())
        s = self.domain.round(self.parameters[:, 0])
        short_way = np.mod(s[self.moves + 1] - s[self.moves] + 0.5, 1.0) - 0.5
        none = np.zeros(len(short_way))
        for angle, wound in ((0, 2 * np.pi * self.winding * short_way), (1, none)):
            scale = share / (self.speeds[angle] * self.times)
            rate = scale * (wound + self.steps @ values[angle])
            avoidable = np.abs(scale * wound) < SPEED_SHARE * share
            over = np.where(avoidable, np.maximum(np.abs(rate) - SPEED_SHARE * share, 0.0), 0.0)
            slope = SPEED_WEIGHT * np.sign(rate) * (over > 0) * scale
            for residual, by_angle in ((self.weights[0] * rate, self.weights[0] * scale), (SPEED_WEIGHT * over, slope)):
                residuals.append((residual, none, by_angle) if angle else (residual, by_angle, none))
        return Residuals.of(self.steps, residuals)

    def _bounds(self, azimuth: Float[ndarray, " n"], polar: Float[ndarray, " n"]) -> "Residuals":
        """What angles exceed their bounds by, and how far axes are outside their cones."""
        residuals: list[Residual] = []
        bounds = self.bounds
        weight = BOUND_WEIGHT * self.shares
        drooping = SOFT_WEIGHT / BOUND_WEIGHT
        for beyond, sign, share in (
            (polar - bounds.largest_polar, 1.0, 1.0),
            (bounds.least_polar - polar, -1.0, 1.0),
            (polar - SOFT_POLAR, 1.0, drooping),
        ):
            slope = sign * share * weight * (beyond > 0)
            residuals.append((share * weight * np.maximum(beyond, 0.0), 0 * slope, slope))

        axes = axes_of(azimuth, polar)
        by_azimuth = np.column_stack([-axes[:, 1], axes[:, 0], np.zeros(len(axes))])
        by_polar = axes_of(azimuth, polar + np.pi / 2)
        cosine = dots(axes, self.normals)
        gradients = dots(by_azimuth, self.normals), dots(by_polar, self.normals)
        for bound, sign in ((bounds.largest_tilt, -1.0), (bounds.least_lead, 1.0)):
            beyond = sign * (cosine - np.cos(bound))
            scale = weight / np.maximum(np.sin(bound), LEAST_SINE)  # so that it is an angle near the bound
            slope = sign * scale * (beyond > 0)
            residuals.append((scale * np.maximum(beyond, 0.0), slope * gradients[0], slope * gradients[1]))

        matrices = bounds.cones.matrices
        mean = np.maximum(bounds.cones.mean_angles, 0.0)
        q, *slopes = (np.einsum("nij,nj->ni", matrices, part) for part in (axes, by_azimuth, by_polar))
        across = np.maximum(lengths(q[:, :2]), STRAIGHT)
        flat = np.tan(mean)
        beyond = np.arctan2(flat * across, q[:, 2]) - (mean - bounds.cone_margin)
        beyond = np.where(bounds.cones.found, np.maximum(beyond, 0.0), 0.0)
        scale = (beyond > 0) * weight * flat / np.maximum((flat * across) ** 2 + q[:, 2] ** 2, STRAIGHT)
        by_azimuth, by_polar = (
            scale * (q[:, 2] * dots(q[:, :2], slope[:, :2]) / across - across * slope[:, 2]) for slope in slopes
        )
        residuals.append((weight * beyond, by_azimuth, by_polar))
        return Residuals.of(self.values_at, residuals)


@dataclass(frozen=True, eq=False)
class Residuals:
    """Residuals (q, m) that depend on the two angles at the rows of `matrix` (m, c), which leads to these from
    control values; `slopes` (q, m, 2) are their derivatives by azimuth and polar angle."""

    matrix: csr_array
    values: Float[ndarray, "q m"]
    slopes: Float[ndarray, "q m 2"]

    @classmethod
    def of(cls, matrix: csr_array, found: Sequence[Residual]) -> "Residuals":
        """Of residuals and their derivatives by either angle."""
        values, by_azimuth, by_polar = (np.array(part) for part in zip(*found))
        return cls(matrix, values, np.stack([by_azimuth, by_polar], axis=-1))

    @property
    def energy(self) -> float:
        """The sum of their squares."""
        return float((self.values**2).sum())

    @property
    def gradient(self) -> Float[ndarray, "2 c"]:
        """Half the derivatives of their energy by the control values."""
        return np.asarray((self.matrix.T @ np.einsum("qm,qma->ma", self.values, self.slopes)).T)

    def add_to(self, band: Float[ndarray, "k w"]) -> None:
        """Add their normal equations to a band whose unknown 2 j + a is angle a of control value j."""
        metric = np.einsum("qma,qmb->mab", self.slopes, self.slopes)
        add_pairs(band, *csr_parts(self.matrix), metric)
