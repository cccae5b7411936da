"""A blank of revolution, turned before: convex slices, whose union it is, and what a machinist is told of it."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.mesh.solids.revolution import revolve, revolve_profile, segments_around
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.setup.stocks.mesh import ConvexStock

CHORD = 0.02
"""Chord tolerance round the axis, mm."""
JOINT = 0.02
"""Slices overlap by so much, mm: a ray meets no gap between them."""
THINNEST = 1e-3
"""Slices are no thinner, mm."""
BESIDE = THINNEST / 4
"""The radius of a slice's end is taken so far beside the corner, mm."""


@dataclass(frozen=True, eq=False)
class TurnedBlank:
    """The body of revolution about Z of a `profile`, rows (radius, height) in mm from its lower pole to its upper one.
    Where that is undercut, but for a recess round the axis, the blank is taken to be full."""

    profile: Float[ndarray, "n 2"]

    @cached_property
    def heights(self) -> Float[ndarray, " m"]:
        """The heights of the profile's corners, mm, upward."""
        found = np.unique(self.profile[:, 1])
        return found[np.r_[True, np.diff(found) > THINNEST]]

    def radii(self, heights: Float[ndarray, " k"], *, inner: bool = False) -> Float[ndarray, " k"]:
        """The largest radius of the profile at each height that is none of a corner, mm; 0 beyond its ends. Or the
        radius of the recess round the axis, 0 where there is none."""
        radius, height = self.profile.T
        low, high = np.minimum(height[:-1], height[1:]), np.maximum(height[:-1], height[1:])
        met = (low <= heights[:, None]) & (heights[:, None] <= high) & (low < high)
        rise = np.where(low == high, 1.0, np.diff(height))
        at = radius[:-1] + np.clip((heights[:, None] - height[:-1]) / rise, 0.0, 1.0) * np.diff(radius)
        if inner:
            recessed = met.any(axis=1) & (met.sum(axis=1) % 2 == 0)
            return np.where(recessed, np.where(met, at, np.inf).min(axis=1), 0.0)
        return np.asarray(np.where(met, at, 0.0).max(axis=1))

    @property
    def diameter(self) -> float:
        """mm."""
        return 2 * float(self.profile[:, 0].max())

    @property
    def mesh(self) -> TriangleMesh:
        """The closed mesh of the blank."""
        return revolve_profile(self.profile, segments_around(self.diameter / 2, CHORD))

    @property
    def text(self) -> str:
        """What is to be mounted."""
        low, high = self.profile[:, 1].min(), self.profile[:, 1].max()
        return f"blank: turned to the blades' tips, diameter {self.diameter:.2f} mm, from Z {low:.2f} to Z {high:.2f}"

    @property
    def slices(self) -> list[ConvexStock]:
        """Convex bodies whose union, but for the `recesses`, the blank is: frusta, and a disc across each joint."""
        return self._stack(inner=False)

    @property
    def recesses(self) -> list[ConvexStock]:
        """Convex bodies whose union is what is turned out of the slices round the axis."""
        return self._stack(inner=True)

    def _stack(self, *, inner: bool) -> list[ConvexStock]:
        z = self.heights
        above, below = self.radii(z[:-1] + BESIDE, inner=inner), self.radii(z[1:] - BESIDE, inner=inner)
        ends = [((above[k], z[k]), (below[k], z[k + 1])) for k in range(len(z) - 1)]
        for k in range(1, len(z) - 1):
            half = min(JOINT, (z[k] - z[k - 1]) / 2, (z[k + 1] - z[k]) / 2)
            beside = self.radii(z[k] + np.array([-half, half]), inner=inner)
            radius = min(below[k - 1], above[k], *beside)
            ends.append(((radius, z[k] - half), (radius, z[k] + half)))
        return [_frustum(low, high) for low, high in ends if max(low[0], high[0]) > THINNEST]


def _frustum(low: tuple[float, float], high: tuple[float, float]) -> ConvexStock:
    """The convex frustum between two circles (radius, height)."""
    (radius, bottom), (upper, top) = low, high
    radius, upper = max(radius, THINNEST), max(upper, THINNEST)
    around = segments_around(max(radius, upper), CHORD)
    mesh = revolve(np.array([radius, upper]), np.array([bottom, top]), (bottom, top), around)
    return ConvexStock(mesh, kind="slice", proven=True)
