"""Side steps of a ball in every direction on a surface, on a grid of parameters.

The passes of a pattern are the level curves psi(s, t) = 1/2, 3/2, ... of a function psi that counts them. Their
distance is 1 / |grad psi|, with |grad psi|^2 = (G a^2 - 2 F a b + E b^2) / (E G - F^2) for a = psi_s, b = psi_t
and the first fundamental form E, F, G; the section across them has the normal curvature in the direction of
grad psi. They leave no more than the scallop where |grad psi| L >= 1, with L the exact side step of that
section (`scallop.py`).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.ndimage import maximum_filter1d, uniform_filter1d

from bonecam.arrays import dots
from bonecam.planning.passes.patterns.sampling import tangent_range
from bonecam.planning.passes.patterns.scallop import side_step
from bonecam.planning.passes.patterns.spacing import MAX_TURN, MIN_CLEARANCE
from bonecam.surface.tspline import TSpline

AROUND, ALONG = 192, 400
"""Places of the grid in s and t: cells of 0.1 to 0.3 mm on bones of 30 mm."""

FULLNESS = 0.99
"""Part of the exact side step that is used: covers what the grid does not resolve."""
WINDOW = 5
"""Cells of the grid over which 1 / L is bounded from above."""
MOST_SHORT = 1.2
"""Shortfalls count no more: they are mended round by round."""


@dataclass(frozen=True, eq=False)
class StepMetric:
    """The first fundamental form E, F, G, its `area` sqrt(E G - F^2), and the second form e, f, g (> 0: convex) at
    the places s x t, for a ball of `radius` that may leave `scallop` (mm). s has no second place for a seam."""

    s: Float[ndarray, " a"]
    t: Float[ndarray, " b"]
    E: Float[ndarray, "a b"]
    F: Float[ndarray, "a b"]
    G: Float[ndarray, "a b"]
    area: Float[ndarray, "a b"]
    e: Float[ndarray, "a b"]
    f: Float[ndarray, "a b"]
    g: Float[ndarray, "a b"]
    radius: float
    scallop: float

    def gradient(self, a: Float[ndarray, "a b"], b: Float[ndarray, "a b"]) -> Float[ndarray, "a b"]:
        """|grad psi| (1/mm) of a function with psi_s = a and psi_t = b."""
        return np.sqrt(self.G * a**2 - 2 * self.F * a * b + self.E * b**2) / self.area

    def coverage(self, a: Float[ndarray, "a b"], b: Float[ndarray, "a b"]) -> Float[ndarray, "a b"]:
        """|grad psi| L of a function with psi_s = a and psi_t = b, with L the exact side step across its level
        curves: 1 where cusps are as high as the scallop, less where they are higher."""
        along_s = self.G * a - self.F * b
        along_t = self.E * b - self.F * a
        square = a * along_s + b * along_t
        bent = self.e * along_s**2 + 2 * self.f * along_s * along_t + self.g * along_t**2
        curvature = bent / (self.area**2 * square)
        gradient = np.sqrt(square) / self.area
        # a cell of the grid turns by no more than MAX_TURN
        cell = np.abs(a) * (self.s[1] - self.s[0]) + np.abs(b) * (self.t[1] - self.t[0])
        fits = 1 + curvature * self.radius > MIN_CLEARANCE
        bounded = np.where(fits, np.minimum(curvature, MAX_TURN * gradient / cell), 0.0)
        return gradient * side_step(self.radius, self.scallop, bounded.ravel()).reshape(bounded.shape)

    def rate(self, a: Float[ndarray, "a b"], coverage: Float[ndarray, "a b"]) -> Float[ndarray, "a b"]:
        """What psi_s = a has to be for |grad psi| L = 1 where psi_s and psi_t keep their ratio: a smooth upper bound.
        `coverage` is that of the function."""
        return _bound(a / (FULLNESS * coverage))

    def slowness(self, a: Float[ndarray, "a b"], b: Float[ndarray, "a b"]) -> Float[ndarray, "a b"]:
        """1 / L, which |grad psi| has to be for psi_s and psi_t in the ratio of a to b: a smooth upper bound."""
        return _bound(self.gradient(a, b) / (FULLNESS * self.coverage(a, b)))

    def shortfall(self, coverage: Float[ndarray, "a b"]) -> Float[ndarray, "a b"]:
        """The factor, 1 to MOST_SHORT, by which |grad psi| L falls short of 1: a smooth upper bound."""
        return _bound(np.clip(1 / coverage, 1.0, MOST_SHORT))

    @property
    def flat_step(self) -> float:
        """The side step on a plane, mm."""
        return float(2 * np.sqrt(self.scallop * (2 * self.radius - self.scallop)))


def _bound(values: Float[ndarray, "a b"]) -> Float[ndarray, "a b"]:
    """A smooth bound from above: the mean, over WINDOW cells, of the largest value within WINDOW cells."""
    values = uniform_filter1d(maximum_filter1d(values, WINDOW, 1, mode="nearest"), WINDOW, 1, mode="nearest")
    return uniform_filter1d(maximum_filter1d(values, WINDOW, 0, mode="wrap"), WINDOW, 0, mode="wrap")


def step_metric(surface: TSpline, radius: float, scallop: float) -> StepMetric:
    """The side steps on a surface that is closed in s, for a ball of `radius` that leaves `scallop` (mm) at most."""
    low, high = surface.domain[0]
    s = np.linspace(low, high, AROUND, endpoint=False)
    t = np.linspace(*tangent_range(surface), ALONG)
    grid_s, grid_t = (v.ravel() for v in np.meshgrid(s, t, indexing="ij"))
    _, Ss, St, Sss, Sst, Stt = surface.evaluate(grid_s, grid_t, 2)
    normal = np.cross(Ss, St)
    area = np.maximum(np.linalg.norm(normal, axis=1), np.finfo(float).tiny)
    first = [dots(Ss, Ss), dots(Ss, St), dots(St, St), area]
    second = [-dots(derivative, normal) / area for derivative in (Sss, Sst, Stt)]
    E, F, G, area, e, f, g = (form.reshape(AROUND, ALONG) for form in first + second)
    return StepMetric(s, t, E=E, F=F, G=G, area=area, e=e, f=f, g=g, radius=radius, scallop=scallop)
