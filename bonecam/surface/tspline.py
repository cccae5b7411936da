"""The T-spline surface S(s, t) = sum_i w_i B_i P_i / sum_i w_i B_i (Gan et al. 2014, Definitions 1 and 3)."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import frozen
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.surface.tmesh import RowTMesh


@dataclass(frozen=True, eq=False)
class TSpline:
    """Control points (n, 3) in mm and positive weights (n,) over a T-mesh."""

    tmesh: RowTMesh
    control_points: Float[ndarray, "n 3"]
    weights: Float[ndarray, "n"]

    def __post_init__(self) -> None:
        object.__setattr__(self, "control_points", frozen(self.control_points))
        object.__setattr__(self, "weights", frozen(self.weights))
        if self.control_points.shape != (self.tmesh.size, 3) or self.weights.shape != (self.tmesh.size,):
            raise ValueError(f"the T-mesh has {self.tmesh.size} vertices: give as many control points and weights")
        if not (self.weights > 0).all():
            raise ValueError(f"weight {int(np.argmin(self.weights))} is not positive")

    @cached_property
    def domain(self) -> Float[ndarray, "2 2"]:
        """[[s_low, s_high], [t_low, t_high]]; s is periodic where the surface is closed."""
        return self.tmesh.domain

    def with_control_points(self, control_points: Float[ndarray, "n 3"]) -> "TSpline":
        """The same T-mesh and weights with other control points."""
        return TSpline(self.tmesh, control_points, self.weights)

    def basis(self, s: Float[ndarray, "n"], t: Float[ndarray, "n"], order: int = 0) -> tuple[sp.csr_array, ...]:
        """R, then R_s, R_t (order 1), then R_ss, R_st, R_tt (order 2): sparse (n, control points)."""
        B = self.tmesh.blending(s, t, order)
        w = sp.diags_array(self.weights)
        W = [np.asarray(b @ self.weights) for b in B]
        inverse = sp.diags_array(1 / W[0])

        def minus(values: ndarray, matrix: sp.csr_array) -> sp.csr_array:
            return sp.diags_array(values) @ matrix

        R = inverse @ (B[0] @ w)
        if order == 0:
            return (sp.csr_array(R),)
        Rs = inverse @ (B[1] @ w - minus(W[1], R))
        Rt = inverse @ (B[2] @ w - minus(W[2], R))
        if order == 1:
            return tuple(sp.csr_array(m) for m in (R, Rs, Rt))
        Rss = inverse @ (B[3] @ w - 2 * minus(W[1], Rs) - minus(W[3], R))
        Rst = inverse @ (B[4] @ w - minus(W[1], Rt) - minus(W[2], Rs) - minus(W[4], R))
        Rtt = inverse @ (B[5] @ w - 2 * minus(W[2], Rt) - minus(W[5], R))
        return tuple(sp.csr_array(m) for m in (R, Rs, Rt, Rss, Rst, Rtt))

    def evaluate(self, s: Float[ndarray, "n"], t: Float[ndarray, "n"], order: int = 0) -> Float[ndarray, "n 3"] | tuple[ndarray, ...]:
        """S (n, 3) for order 0; the tuple S, S_s, S_t for order 1; S, S_s, S_t, S_ss, S_st, S_tt for order 2."""
        found = tuple(matrix @ self.control_points for matrix in self.basis(s, t, order))
        return found[0] if order == 0 else found

    def normals(self, s: Float[ndarray, "n"], t: Float[ndarray, "n"]) -> Float[ndarray, "n 3"]:
        """Outward unit normals; just beside a pole, the limit from there."""
        low, high = self.domain[1]
        inside = np.clip(t, low + 1e-6 * (high - low), high - 1e-6 * (high - low))
        _, Ss, St = self.evaluate(s, inside, 1)
        n = np.cross(Ss, St)
        return n / np.linalg.norm(n, axis=1, keepdims=True)

    def tessellate(self, chord_tolerance: float) -> TriangleMesh:
        """A closed mesh, outward, within about `chord_tolerance` of the surface."""
        return self._grid(*self._counts(chord_tolerance))

    def _counts(self, chord_tolerance: float) -> tuple[int, int]:
        low, high = self.domain[1]
        s, t = (v.ravel() for v in np.meshgrid(np.linspace(0, 1, 97)[:-1], np.linspace(low, high, 97)[1:-1]))
        _, _, _, Sss, _, Stt = self.evaluate(s, t, 2)
        around, along = (float(np.linalg.norm(v, axis=1).max()) for v in (Sss, Stt))
        return max(16, int(np.ceil(np.sqrt(around / (4 * chord_tolerance))))), max(
            8, int(np.ceil((high - low) * np.sqrt(along / (4 * chord_tolerance))))
        )

    def _grid(self, around: int, along: int) -> TriangleMesh:
        low, high = self.domain[1]
        rings = np.linspace(low, high, along + 1)[1:-1]
        s, t = (v.ravel() for v in np.meshgrid(np.arange(around) / around, rings))
        points = np.vstack([self.evaluate(s, t), self.evaluate(np.zeros(2), np.array([low, high]))])
        index = np.arange(len(s)).reshape(len(rings), around)
        a, b = index[:-1].ravel(), np.roll(index, -1, axis=1)[:-1].ravel()
        c, d = np.roll(index, -1, axis=1)[1:].ravel(), index[1:].ravel()
        first, last = len(s), len(s) + 1
        bottom = np.column_stack([np.full(around, first), np.roll(index[0], -1), index[0]])
        top = np.column_stack([np.full(around, last), index[-1], np.roll(index[-1], -1)])
        faces = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d]), bottom, top])
        return TriangleMesh(points, faces.astype(np.int32))
