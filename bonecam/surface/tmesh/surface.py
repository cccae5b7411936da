"""The interface of a T-spline surface, without state, for queries, tessellation and refinement.

`surface.tspline.TSpline` is the one class that implements it. The interface lies below the rooms that
compute with a surface and the class above them, so that its methods may call them.
"""

from abc import ABC, abstractmethod
from typing import Any, Generic, NamedTuple, TypeVar

import scipy.sparse as sp
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial import KDTree

from bonecam.surface.basis.elements import Elements
from bonecam.surface.tmesh.extracted import ExtractedTMesh
from bonecam.surface.tmesh.general import TMesh
from bonecam.surface.tmesh.open_rows import OpenRowTMesh
from bonecam.surface.tmesh.row_tmesh import RowTMesh

M = TypeVar("M", bound=RowTMesh | OpenRowTMesh | TMesh | ExtractedTMesh)


class Seeds(NamedTuple):
    """Surface points from which the search for closest points starts."""

    parameters: Float[ndarray, "n 2"]
    """(s, t) of the points."""
    tree: KDTree
    """The points in mm, for the nearest of them."""
    step_limit: Float[ndarray, "2"]
    """Longest step of the search in s and in t: about two spacings of the points."""


class Surface(ABC, Generic[M]):
    """A rational spline S(s, t) over a T-mesh of any kind: control points (n, 3) in mm, weights (n,)."""

    tmesh: M
    control_points: Float[ndarray, "n 3"]
    weights: Float[ndarray, " n"]

    @property
    @abstractmethod
    def domain(self) -> Float[ndarray, "2 2"]:
        """[[s_low, s_high], [t_low, t_high]]; s is periodic where the surface is closed."""

    @property
    @abstractmethod
    def poles(self) -> tuple[bool, bool]:
        """Whether the lower and the upper end of t is one point of a surface that is closed in s."""

    @property
    @abstractmethod
    def patches(self) -> Float[ndarray, "e c 4"]:
        """Homogeneous Bezier control points (w x, w y, w z, w) of every element, s fastest."""

    @property
    @abstractmethod
    def seeds(self) -> Seeds:
        """Surface points from which the search for closest points starts."""

    @abstractmethod
    def elements(self) -> Elements:
        """The Bezier elements of the T-mesh: boxes, function ids, coefficients."""

    @abstractmethod
    def basis(self, s: Float[ndarray, " n"], t: Float[ndarray, " n"], order: int = 0) -> tuple[sp.csr_array, ...]:
        """R, then R_s, R_t (order 1), then R_ss, R_st, R_tt (order 2): sparse (n, control points)."""

    @abstractmethod
    def positions(self, s: Float[ndarray, " n"], t: Float[ndarray, " n"]) -> Float[ndarray, "n 3"]:
        """Surface points S(s, t) in mm."""

    @abstractmethod
    def derivatives(
        self, s: Float[ndarray, " n"], t: Float[ndarray, " n"], order: int
    ) -> tuple[Float[ndarray, "n 3"], ...]:
        """S, S_s, S_t (order 1) and S_ss, S_st, S_tt (order 2)."""

    @abstractmethod
    def normals(self, s: Float[ndarray, " n"], t: Float[ndarray, " n"]) -> Float[ndarray, "n 3"]:
        """Outward unit normals; at a pole their limit."""

    @abstractmethod
    def with_control_points(self: "S", control_points: Float[ndarray, "n 3"]) -> "S":
        """The surface of the same T-mesh and weights with other control points."""

    @abstractmethod
    def with_tmesh(self: "S", tmesh: Any, control_points: Float[ndarray, "n 3"], weights: Float[ndarray, " n"]) -> "S":
        """The surface of another T-mesh of the same kind."""


S = TypeVar("S", bound=Surface)
"""A class of surfaces: what is returned is of the class that was given."""
