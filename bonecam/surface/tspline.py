"""The T-spline surface S(s, t) = sum_i w_i B_i P_i / sum_i w_i B_i (Gan et al. 2014, Definitions 1 and 3)."""

from dataclasses import dataclass
from functools import cached_property
from typing import Generic, TypeVar

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import frozen
from bonecam.errors import SurfaceError
from bonecam.kernels import bezier
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.surface.basis.elements import Elements
from bonecam.surface.query import measures
from bonecam.surface.query.curvature import Curvature, pole_curvature, pole_normal, surface_curvature, unit
from bonecam.surface.query.diagnose import Diagnosis, diagnose
from bonecam.surface.query.project import Projection, Seeds, project
from bonecam.surface.refinement.refine import refine
from bonecam.surface.tessellation.tessellate import Tessellation, tessellate
from bonecam.surface.tmesh.extracted import ExtractedTMesh
from bonecam.surface.tmesh.general import TMesh
from bonecam.surface.tmesh.open_rows import OpenRowTMesh
from bonecam.surface.tmesh.rows import RowTMesh

POLE = 1e-9  # of the t-range: nearer to a pole than this its limits are taken
POLE_DIRECTIONS = 256
LARGEST = 1e30  # coordinates, weights and their inverses must be smaller, lest products overflow
ONE_POINT = 1e-12  # of the size: an end whose points are nearer to each other is a pole
M = TypeVar("M", bound=RowTMesh | OpenRowTMesh | TMesh | ExtractedTMesh)


def _matrices(order: int) -> int:
    if order not in (0, 1, 2):
        raise ValueError(f"order must be 0, 1 or 2, not {order}")
    return (1, 3, 6)[order]


@dataclass(frozen=True, eq=False)
class TSpline(Generic[M]):
    """Control points (n, 3) in mm and positive weights (n,) over a T-mesh, row-structured or general."""

    tmesh: M
    control_points: Float[ndarray, "n 3"]
    weights: Float[ndarray, " n"]

    def __post_init__(self) -> None:
        object.__setattr__(self, "control_points", frozen(self.control_points))
        object.__setattr__(self, "weights", frozen(self.weights))
        if self.control_points.shape != (self.tmesh.size, 3) or self.weights.shape != (self.tmesh.size,):
            shapes = f"control_points {self.control_points.shape} and weights {self.weights.shape}"
            raise ValueError(
                f"{shapes}: the T-mesh has {self.tmesh.size} vertices, give as many control points and weights"
            )
        places = (np.abs(self.control_points) < LARGEST).all(axis=1)
        if not places.all():
            raise ValueError(
                f"control point {int(np.argmin(places))} is not finite or not below {LARGEST:g} mm"
            )
        weights = (self.weights > 1 / LARGEST) & (self.weights < LARGEST)
        if not weights.all():
            raise ValueError(
                f"weight {int(np.argmin(weights))} is not positive and finite, or so small or large that nothing else counts"
            )

    @cached_property
    def domain(self) -> Float[ndarray, "2 2"]:
        """[[s_low, s_high], [t_low, t_high]]; s is periodic where the surface is closed."""
        return self.tmesh.domain

    @cached_property
    def poles(self) -> tuple[bool, bool]:
        """Whether the lower and the upper end of t is one point of a surface that is closed in s."""
        if any(self.tmesh.poles) or not self.elements().period[0] or self.elements().period[1]:
            return self.tmesh.poles
        s = np.linspace(self.domain[0, 0], self.domain[0, 1], POLE_DIRECTIONS, endpoint=False)
        ends = [self.positions(s, np.full(len(s), t)) for t in self.domain[1]]
        size = float(np.ptp(self.control_points, axis=0).max())
        low, high = (bool(np.ptp(end, axis=0).max() <= ONE_POINT * size) for end in ends)
        return low, high

    def with_control_points(self, control_points: Float[ndarray, "n 3"]) -> "TSpline[M]":
        """The same T-mesh and weights with other control points."""
        return TSpline(self.tmesh, control_points, self.weights)

    def elements(self) -> Elements:
        """The Bezier elements of the T-mesh: boxes, function ids, coefficients."""
        return self.tmesh.elements

    @cached_property
    def patches(self) -> Float[ndarray, "e c 4"]:
        """Homogeneous Bezier control points (w x, w y, w z, w) of every element, s fastest."""
        return self.tmesh.elements.patches(self.control_points, self.weights)

    def basis(
        self, s: Float[ndarray, " n"], t: Float[ndarray, " n"], order: int = 0
    ) -> tuple[sp.csr_array, ...]:
        """R, then R_s, R_t (order 1), then R_ss, R_st, R_tt (order 2): sparse (n, control points)."""
        elements = self.tmesh.elements
        place, s, t = elements.place(s, t)
        count = np.diff(elements.starts)[place]
        indptr = np.concatenate([[0], np.cumsum(count)]).astype(
            np.int64 if count.sum() > 2**31 - 1 else np.int32
        )
        indices = np.empty(indptr[-1], dtype=indptr.dtype)
        values = np.empty((_matrices(order), indptr[-1]))
        if elements.degree != 3:
            raise SurfaceError(
                f"the elements have degree {elements.degree}: the basis is assembled for cubic ones"
            )
        parts = (elements.starts, elements.functions, elements.coefficients, self.weights, elements.boxes)
        bezier.basis_values(*parts, place, s, t, order, indptr, indices, values)
        shape = (len(s), self.tmesh.size)
        return tuple(sp.csr_array((v, indices.copy(), indptr.copy()), shape=shape) for v in values)

    def evaluate(
        self, s: Float[ndarray, " n"], t: Float[ndarray, " n"], order: int = 0
    ) -> Float[ndarray, "n 3"] | tuple[ndarray, ...]:
        """S (n, 3) for order 0; the tuple S, S_s, S_t for order 1; S, S_s, S_t, S_ss, S_st, S_tt for order 2.

        Raises ValueError for parameters that are not finite or lie outside the domain (a closed direction
        wraps).
        """
        return self.positions(s, t) if order == 0 else self.derivatives(s, t, order)

    def positions(self, s: Float[ndarray, " n"], t: Float[ndarray, " n"]) -> Float[ndarray, "n 3"]:
        """S."""
        elements = self.tmesh.elements
        found: ndarray = elements.derivatives(self.patches, *elements.place(s, t), 0)[0]
        return found

    def derivatives(
        self, s: Float[ndarray, " n"], t: Float[ndarray, " n"], order: int
    ) -> tuple[Float[ndarray, "n 3"], ...]:
        """S, S_s, S_t (order 1) and S_ss, S_st, S_tt (order 2)."""
        elements = self.tmesh.elements
        _matrices(order)
        return tuple(elements.derivatives(self.patches, *elements.place(s, t), order))

    def normals(self, s: Float[ndarray, " n"], t: Float[ndarray, " n"]) -> Float[ndarray, "n 3"]:
        """Outward unit normals; at a pole the limit (see surface.curvature). Raises SurfaceError where there
        is none."""
        _, S_s, S_t = self.evaluate(s, t, 1)
        normals = np.cross(S_s, S_t)
        for end, here in self._at_poles(t):
            normals[here] = self._pole(end)[0]
        return unit(normals)

    def curvature(self, s: Float[ndarray, " n"], t: Float[ndarray, " n"]) -> Curvature:
        """Principal curvatures, > 0 where the part bulges outward, and directions; at a pole the limit."""
        derivatives = self.evaluate(s, t, 2)
        poles = self._at_poles(t)
        regular = (
            np.setdiff1d(np.arange(len(s)), np.concatenate([here for _, here in poles]))
            if poles
            else np.arange(len(s))
        )
        normals = unit(np.cross(derivatives[1][regular], derivatives[2][regular]))
        found = surface_curvature(tuple(d[regular] for d in derivatives), normals)
        whole = [
            np.empty((len(s), *part.shape[1:]))
            for part in (found.k1, found.k2, found.direction1, found.direction2)
        ]
        for where, one in [(regular, found)] + [
            (here, pole_curvature(*self._pole(end)[1:], self._pole(end)[0])) for end, here in poles
        ]:
            for target, part in zip(whole, (one.k1, one.k2, one.direction1, one.direction2)):
                target[where] = part
        return Curvature(*whole)

    def _at_poles(self, t: ndarray) -> list[tuple[int, ndarray]]:
        """Which samples lie on the lower (0) and the upper (1) pole, where there is one."""
        low, high = self.domain[1]
        distance = (np.asarray(t) - low, high - np.asarray(t))
        found = [
            (end, np.flatnonzero(distance[end] <= POLE * (high - low))) for end in (0, 1) if self.poles[end]
        ]
        return [(end, here) for end, here in found if len(here)]

    def _pole(self, end: int) -> tuple[ndarray, ndarray, ndarray]:
        """The normal at a pole and S_t, S_tt round it."""
        low, high = self.domain[0]
        s = low + (high - low) * (np.arange(POLE_DIRECTIONS) / POLE_DIRECTIONS)
        derivatives = self.evaluate(s, np.full(len(s), self.domain[1, end]), 2)
        return pole_normal(derivatives[2], end == 1), derivatives[2], derivatives[5]

    def tessellate(self, chord_tolerance: float, angle_tolerance: float | None = None) -> TriangleMesh:
        """A watertight, outward mesh within the measured `chord_tolerance` (mm): see surface.tessellate."""
        return self.tessellate_with_parameters(chord_tolerance, angle_tolerance).mesh

    def tessellate_with_parameters(
        self, chord_tolerance: float, angle_tolerance: float | None = None
    ) -> Tessellation:
        """The mesh, the (s, t) of every vertex and the chord error that was measured."""
        return tessellate(self, chord_tolerance, angle_tolerance)

    def project(self, points: Float[ndarray, "n 3"]) -> Projection:
        """Foot parameters (n, 2), feet (n, 3) and distances (n,) of points in mm: see surface.project."""
        return project(self, points)

    def diagnose(self) -> Diagnosis:
        """Standard, semi-standard or non-standard, nullity, and how T-junction extensions meet: see
        surface.diagnose."""
        return diagnose(self)

    def refine(
        self, s: Float[ndarray, " n"], t: Float[ndarray, " n"], directions: str = "st"
    ) -> "TSpline[M]":
        """The same surface, the faces that hold the samples cut in their middle: see surface.refine."""
        return refine(self, s, t, directions)

    @cached_property
    def seeds(self) -> Seeds:
        """Where projections start."""
        return Seeds(self)

    @cached_property
    def area(self) -> float:
        """Surface area, mm^2."""
        return measures.area(self)

    @cached_property
    def volume(self) -> float:
        """Enclosed volume, mm^3, of a closed surface."""
        return measures.volume(self)
