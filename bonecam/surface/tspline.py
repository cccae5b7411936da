"""The T-spline surface S(s, t) = sum_i w_i B_i P_i / sum_i w_i B_i (Gan et al. 2014, Definitions 1 and 3)."""

from dataclasses import dataclass
from functools import cached_property
from typing import Generic

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import frozen
from bonecam.mesh.facets import Curvature
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.surface import query
from bonecam.surface.basis import Elements
from bonecam.surface.query import Projection, Seeds, curvature_at, normals_at, project, seeds_on
from bonecam.surface.refinement import refine
from bonecam.surface.tessellation import Tessellation, tessellate
from bonecam.surface.tmesh import M

POLE_SAMPLES = 256
"""Parameters s at which an end of t is looked at whether it is one point."""

ONE_POINT = 1e-12
"""Share of the surface's size: an end of t whose points are nearer to each other is a pole (rounding)."""

LARGEST = 1e30
"""Coordinates (mm), weights and their inverses must be smaller, so that no product overflows a double."""


@dataclass(frozen=True, eq=False, repr=False)
class TSpline(Generic[M]):
    """Control points (n, 3) in mm and positive weights (n,) over a T-mesh."""

    tmesh: M
    control_points: Float[ndarray, "n 3"]
    weights: Float[ndarray, " n"]

    def __post_init__(self) -> None:
        object.__setattr__(self, "control_points", frozen(self.control_points))
        object.__setattr__(self, "weights", frozen(self.weights))
        size = self.tmesh.size
        if self.control_points.shape != (size, 3) or self.weights.shape != (size,):
            shapes = f"control_points {self.control_points.shape} and weights {self.weights.shape}"
            raise ValueError(f"{shapes}: the T-mesh has {size} vertices, give as many control points and weights")

        # Raises ValueError on numbers that are not finite, too large, or weights that are not positive
        points_fit = (np.abs(self.control_points) < LARGEST).all(axis=1)
        if not points_fit.all():
            number = int(np.argmin(points_fit))
            raise ValueError(f"control point {number} is not finite or not below {LARGEST:g} mm")
        weights_fit = (self.weights > 1 / LARGEST) & (self.weights < LARGEST)
        if not weights_fit.all():
            number = int(np.argmin(weights_fit))
            raise ValueError(
                f"weight {number} is not positive and finite, or so small or large that nothing else counts"
            )

    def __repr__(self) -> str:
        return f"<TSpline of {len(self.control_points)} control points over a {type(self.tmesh).__name__}>"

    @cached_property
    def domain(self) -> Float[ndarray, "2 2"]:
        """[[s_low, s_high], [t_low, t_high]]; s is periodic where the surface is closed."""
        return self.tmesh.elements.domain

    @cached_property
    def poles(self) -> tuple[bool, bool]:
        """Whether the lower and the upper end of t is one point of a surface that is closed in s."""
        closed_s, closed_t = self.elements().period
        if any(self.tmesh.poles) or not closed_s or closed_t:
            return self.tmesh.poles
        s = np.linspace(self.domain[0, 0], self.domain[0, 1], POLE_SAMPLES, endpoint=False)
        ends = [self.positions(s, np.full(len(s), t)) for t in self.domain[1]]
        size = float(np.ptp(self.control_points, axis=0).max())
        low, high = (bool(np.ptp(end, axis=0).max() <= ONE_POINT * size) for end in ends)
        return low, high

    @property
    def closed_in_s(self) -> bool:
        """Whether s is periodic: lines t = const are rings."""
        return self.elements().period[0] > 0

    @cached_property
    def patches(self) -> Float[ndarray, "e c 4"]:
        """Homogeneous Bezier control points (w x, w y, w z, w) of every element, s fastest."""
        return self.tmesh.elements.patches(self.control_points, self.weights)

    @cached_property
    def seeds(self) -> Seeds:
        """Surface points from which the search for closest points starts."""
        return seeds_on(self)

    @cached_property
    def area(self) -> float:
        """Surface area, mm^2."""
        return query.area(self)

    @cached_property
    def volume(self) -> float:
        """Enclosed volume, mm^3, of a closed surface."""
        return query.volume(self)

    def elements(self) -> Elements:
        """The Bezier elements of the T-mesh: boxes, function ids, coefficients."""
        return self.tmesh.elements

    def with_control_points(self, control_points: Float[ndarray, "n 3"]) -> "TSpline[M]":
        """The surface of the same T-mesh and weights with other control points."""
        return TSpline(self.tmesh, control_points, self.weights)

    def basis(self, s: Float[ndarray, " n"], t: Float[ndarray, " n"], order: int = 0) -> tuple[sp.csr_array, ...]:
        """R, then R_s, R_t (order 1), then R_ss, R_st, R_tt (order 2): sparse (n, control points)."""
        _check_order(order)
        return self.tmesh.elements.basis(self.weights, s, t, order)

    def evaluate(
        self, s: Float[ndarray, " n"], t: Float[ndarray, " n"], order: int = 0
    ) -> Float[ndarray, "n 3"] | tuple[ndarray, ...]:
        """S (n, 3) for order 0; the tuple S, S_s, S_t for order 1; S, S_s, S_t, S_ss, S_st, S_tt for order 2.

        Raises ValueError for parameters that are not finite or lie outside the domain (a closed direction
        wraps).
        """
        return self.positions(s, t) if order == 0 else self.derivatives(s, t, order)

    def positions(self, s: Float[ndarray, " n"], t: Float[ndarray, " n"]) -> Float[ndarray, "n 3"]:
        """Surface points S(s, t) in mm."""
        elements = self.tmesh.elements
        points: ndarray = elements.derivatives(self.patches, *elements.place(s, t), 0)[0]
        return points

    def derivatives(
        self, s: Float[ndarray, " n"], t: Float[ndarray, " n"], order: int
    ) -> tuple[Float[ndarray, "n 3"], ...]:
        """S, S_s, S_t (order 1) and S_ss, S_st, S_tt (order 2)."""
        _check_order(order)
        elements = self.tmesh.elements
        return tuple(elements.derivatives(self.patches, *elements.place(s, t), order))

    def normals(self, s: Float[ndarray, " n"], t: Float[ndarray, " n"]) -> Float[ndarray, "n 3"]:
        """Outward unit normals; at a pole their limit. Raises SurfaceError where the surface has none."""
        return normals_at(self, s, t)

    def curvature(self, s: Float[ndarray, " n"], t: Float[ndarray, " n"]) -> Curvature:
        """Principal curvatures, > 0 where the part bulges outward, and directions; at a pole their limit."""
        return curvature_at(self, s, t)

    def project(self, points: Float[ndarray, "n 3"]) -> Projection:
        """Parameters (n, 2) of the closest surface points, these points (n, 3) and their distances (n,), mm."""
        return project(self, points)

    def tessellate(self, chord_tolerance: float, angle_tolerance: float | None = None) -> TriangleMesh:
        """A watertight, outward triangle mesh within the measured `chord_tolerance` (mm) of the surface."""
        return self.tessellate_with_parameters(chord_tolerance, angle_tolerance).mesh

    def tessellate_with_parameters(self, chord_tolerance: float, angle_tolerance: float | None = None) -> Tessellation:
        """The triangle mesh, the (s, t) of every vertex and the chord error that was measured."""
        return tessellate(self, chord_tolerance, angle_tolerance)

    def refine(self, s: Float[ndarray, " n"], t: Float[ndarray, " n"], directions: str = "st") -> "TSpline[M]":
        """The unchanged surface with more control points: faces that hold samples are cut in their middle."""
        return refine(self, s, t, directions)


def _check_order(order: int) -> None:
    if order not in (0, 1, 2):
        raise ValueError(f"order must be 0, 1 or 2, not {order}")
