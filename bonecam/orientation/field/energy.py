"""The elastic energy of a field of tool axes, as residuals of a least-squares problem.

Xu et al. (2013), Eq. 22, weigh membrane and thin-plate energies of the axes. Here the membrane is taken along
the passes and in the machine's angles, where a move costs time: with the turn D of a rotary axis of speed w
over a move that takes the time T at the feed, the rate is D / (w T), and 1 means that the axis is as slow as the
feed. The thin plate is the second difference of the control values. Bounds are one-sided residuals.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.sparse import csr_array, diags_array, hstack, vstack

from bonecam.arrays import angles_between, dots
from bonecam.orientation.field.axis_field import FieldDomain, axes_of, basis, second_differences

SPEED_SHARE = 0.9
"""Rates above this are what the field is freed of first."""
SPEED_WEIGHT = 60.0
"""Of a rate above SPEED_SHARE, against one below it."""
BOUND_WEIGHT = 200.0
"""Of an angle beyond a bound or a cone, in rates a radian."""
STRAIGHT = 1e-6
"""Squared sines below this are taken for it: an angle has no derivative at 0."""
PRESETS = {"membrane": (1.0, 0.2), "thin-plate": (0.1, 2.0)}
"""Weights of the rates, and of second differences of control values in rates a radian."""

Term = tuple[Float[ndarray, " m"], csr_array]
"""Residuals and their derivatives by all control values."""


@dataclass(frozen=True, eq=False)
class AxisBounds:
    """What the axes at n samples must keep, radians: polar angles between `least_polar` and `largest_polar`, angles
    from the surface normal between `least_lead` and `largest_tilt`, and from `cone_axes` no more than `cone_angles`
    (pi where there is no cone)."""

    least_polar: float
    largest_polar: Float[ndarray, " n"]
    least_lead: float
    largest_tilt: Float[ndarray, " n"]
    cone_axes: Float[ndarray, "n 3"]
    cone_angles: Float[ndarray, " n"]


@dataclass(frozen=True, eq=False)
class AxisEnergy:
    """The energy over n samples in the order of their passes.

    Move k leads from sample `moves[k]` to the next and takes `times[k]` (min) at the feed; `speeds` are those of
    azimuth and polar angle, rad/min. `weights` as in PRESETS.
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
    def shares(self) -> Float[ndarray, " n"]:
        """Roots of the shares of the whole time that belong to the samples."""
        return np.full(len(self.parameters), 1 / np.sqrt(len(self.parameters)))

    def angles(self, values: Float[ndarray, "2 c"]) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"]]:
        """Azimuth and polar angle at the samples, radians."""
        wound = 2 * np.pi * self.winding * self.domain.round(self.parameters[:, 0])
        return wound + self.values_at @ values[0], self.values_at @ values[1]

    def terms(self, values: Float[ndarray, "2 c"]) -> Term:
        """All residuals, and their derivatives by the control values (azimuth first)."""
        found = [*self._turning(values), *self._bounds(*self.angles(values))]
        found += [_term(self.roughness @ values[angle], self.roughness, angle) for angle in (0, 1)]
        return np.concatenate([r for r, _ in found]), vstack([J for _, J in found], format="csr")

    def _turning(self, values: Float[ndarray, "2 c"]) -> Iterator[Term]:
        """The rates of both angles, and what they exceed SPEED_SHARE by; a move round the part whose winding alone
        is faster cannot be helped."""
        share = np.sqrt(self.times / self.times.sum())
        s = self.domain.round(self.parameters[:, 0])
        short_way = np.mod(s[self.moves + 1] - s[self.moves] + 0.5, 1.0) - 0.5
        for angle, wound in ((0, 2 * np.pi * self.winding * short_way), (1, np.zeros(len(short_way)))):
            scale = share / (self.speeds[angle] * self.times)
            rate = scale * (wound + self.steps @ values[angle])
            yield _term(self.weights[0] * rate, _scaled(self.steps, self.weights[0] * scale), angle)
            avoidable = np.abs(scale * wound) < SPEED_SHARE * share
            over = np.where(avoidable, np.maximum(np.abs(rate) - SPEED_SHARE * share, 0.0), 0.0)
            slope = SPEED_WEIGHT * np.sign(rate) * (over > 0)
            yield _term(SPEED_WEIGHT * over, _scaled(self.steps, slope * scale), angle)

    def _bounds(self, azimuth: Float[ndarray, " n"], polar: Float[ndarray, " n"]) -> Iterator[Term]:
        """What angles exceed their bounds by, and how far axes are outside their cones."""
        bounds, weight = self.bounds, BOUND_WEIGHT * self.shares
        for beyond, sign in ((polar - bounds.largest_polar, 1.0), (bounds.least_polar - polar, -1.0)):
            slope = sign * weight * (beyond > 0)
            yield _term(weight * np.maximum(beyond, 0.0), _scaled(self.values_at, slope), 1)

        axes = axes_of(azimuth, polar)
        by_azimuth = np.column_stack([-axes[:, 1], axes[:, 0], np.zeros(len(axes))])
        by_polar = axes_of(azimuth, polar + np.pi / 2)
        cosine = dots(axes, self.normals)
        gradients = dots(by_azimuth, self.normals), dots(by_polar, self.normals)
        for beyond, sign in (
            (np.cos(bounds.largest_tilt) - cosine, -1.0),
            (cosine - np.cos(bounds.least_lead), 1.0),
        ):
            slope = sign * weight * (beyond > 0)
            yield self._by_both(weight * np.maximum(beyond, 0.0), [slope * g for g in gradients])

        cosine = np.clip(dots(axes, bounds.cone_axes), -1.0, 1.0)
        beyond = np.maximum(angles_between(axes, bounds.cone_axes) - bounds.cone_angles, 0.0)
        slope = np.where(beyond > 0, -weight / np.sqrt(np.maximum(1 - cosine**2, STRAIGHT)), 0.0)
        gradients = dots(by_azimuth, bounds.cone_axes), dots(by_polar, bounds.cone_axes)
        yield self._by_both(weight * beyond, [slope * g for g in gradients])

    def _by_both(self, residual: Float[ndarray, " n"], slopes: Sequence[Float[ndarray, " n"]]) -> Term:
        """A residual of each sample that depends on both angles."""
        return residual, hstack([_scaled(self.values_at, slope) for slope in slopes], format="csr")


def _scaled(matrix: csr_array, factors: Float[ndarray, " n"]) -> csr_array:
    """The matrix with each row times a factor."""
    return (diags_array(factors) @ matrix).tocsr()


def _term(residual: Float[ndarray, " m"], J: csr_array, angle: int) -> Term:
    """A term that depends on the azimuth (0) or the polar angle (1) alone."""
    none = csr_array(J.shape)
    return residual, hstack([J, none] if angle == 0 else [none, J], format="csr")
