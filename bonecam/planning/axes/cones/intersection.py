"""The curves in which a cone of tool axes meets a surface, by marching (Xu et al. 2013, section 6).

On the surface S(s, t) the cone's implicit function f is zero on the curve. From a point of it the next one lies a
step along grad f x n and is brought back to f = 0 by Newton's method. Starts lie where f changes its sign between
neighbours of a grid; a curve smaller than the grid's cells is missed. This is for studies and pictures:
whether a tool collides is decided by FCL.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.planning.axes.cones.cone import ObliqueEllipticCone
from bonecam.surface.tspline import TSpline

NEWTON_STEPS = 20
"""Newton's method converges in four or five."""
MAX_POINTS = 100_000
"""No curve has more: a step that is too small for the surface is refused."""
FINEST = 1 / 256
"""Part of a step by which a curve's open end may fall short of the border."""


@dataclass(frozen=True, eq=False)
class IntersectionCurve:
    """Points (mm) on cone and surface, their (s, t), and whether the curve is closed (the first point is not
    repeated)."""

    points: Float[ndarray, "n 3"]
    parameters: Float[ndarray, "n 2"]
    closed: bool


def intersect(
    cone: ObliqueEllipticCone, surface: TSpline, step: float = 0.1, tolerance: float = 1e-6, cells: int = 64
) -> list[IntersectionCurve]:
    """The curves in which the cone, between apex and end, meets the surface; none where they do not meet.

    Points lie `step` mm apart and within `tolerance` (mm) of the cone. `cells` is the number of cells of the grid
    of starts in each direction. ValueError where step or tolerance is not positive.
    """
    if not (step > 0 and tolerance > 0):
        raise ValueError(f"step = {step}, tolerance = {tolerance}: give lengths in mm above 0")
    marching = _Marching(cone, surface, step, tolerance)
    curves: list[IntersectionCurve] = []
    for start in _starts(cone, surface, cells):
        at = marching.on_cone(start)
        if at is None or not marching.within(at) or _is_on(curves, marching.point(at), step):
            continue
        curves.append(marching.curve(at))
    return curves


def _starts(cone: ObliqueEllipticCone, surface: TSpline, cells: int) -> Float[ndarray, "k 2"]:
    """Middles of the grid's edges along which f changes its sign."""
    s, t = (np.linspace(low, high, cells + 1) for low, high in surface.domain)
    grid = np.stack(np.meshgrid(s, t, indexing="ij"), axis=-1)
    inside: Bool[ndarray, "a b"] = cone.implicit(surface.positions(*grid.reshape(-1, 2).T)) < 0
    inside = inside.reshape(grid.shape[:2])
    across, along = inside[1:] != inside[:-1], inside[:, 1:] != inside[:, :-1]
    return np.vstack([((grid[1:] + grid[:-1]) / 2)[across], ((grid[:, 1:] + grid[:, :-1]) / 2)[along]])


def _is_on(curves: list[IntersectionCurve], point: Float[ndarray, "3"], step: float) -> bool:
    """Whether the point lies on a curve that is known."""
    return any(np.linalg.norm(curve.points - point, axis=1).min() < step for curve in curves)


@dataclass(frozen=True, eq=False)
class _Marching:
    """One cone on one surface."""

    cone: ObliqueEllipticCone
    surface: TSpline
    step: float
    tolerance: float

    def curve(self, start: Float[ndarray, "2"]) -> IntersectionCurve:
        """The curve through a point of it: forward until it closes or ends, then backward from the start."""
        ahead, closed = self._march(start, self.step)
        behind = [] if closed else self._march(start, -self.step)[0]
        parameters = np.array([*behind[::-1], start, *ahead])
        return IntersectionCurve(self.surface.positions(*parameters.T), parameters, closed)

    def _march(self, start: Float[ndarray, "2"], step: float) -> tuple[list[ndarray], bool]:
        """The points after the start in one direction, and whether they come back to it."""
        first = self.point(start)
        points: list[ndarray] = []
        at = start
        while abs(step) > FINEST * self.step:
            after = self._next(at, step)
            if after is None or not self.within(after):
                step /= 2
                continue
            if len(points) > 1 and np.linalg.norm(self.point(after) - first) < 0.75 * self.step:
                return points, True
            points.append(after)
            if len(points) > MAX_POINTS:
                raise ValueError(f"a curve has more than {MAX_POINTS} points: give a larger step")
            at = after
        return points, False

    def _next(self, at: Float[ndarray, "2"], step: float) -> Float[ndarray, "2"] | None:
        """The point of the curve a step further; None beyond the border."""
        S, S_s, S_t = self.surface.derivatives(at[:1], at[1:], 1)
        tangent = np.cross(self.cone.gradient(S)[0], np.cross(S_s[0], S_t[0]))
        size = np.linalg.norm(tangent)
        if not size > 0:
            return None
        J = np.column_stack([S_s[0], S_t[0]])
        return self.on_cone(at + np.linalg.lstsq(J, step * tangent / size, rcond=None)[0])

    def on_cone(self, at: Float[ndarray, "2"]) -> Float[ndarray, "2"] | None:
        """The parameters brought to f = 0 by Newton's method along the gradient of f on the surface; None where
        that leaves the surface or does not converge."""
        for _ in range(NEWTON_STEPS):
            if not self._in_domain(at):
                return None
            S, S_s, S_t = self.surface.derivatives(at[:1], at[1:], 1)
            value, gradient = self.cone.implicit(S)[0], self.cone.gradient(S)[0]
            if abs(value) <= self.tolerance * np.linalg.norm(gradient):
                return at
            J = np.column_stack([S_s[0], S_t[0]])
            on_surface = J @ np.linalg.lstsq(J, gradient, rcond=None)[0]
            square = on_surface @ on_surface
            if not square > 0:
                return None
            at = at - np.linalg.lstsq(J, value / square * on_surface, rcond=None)[0]
        return None

    def point(self, at: Float[ndarray, "2"]) -> Float[ndarray, "3"]:
        """The surface point, mm."""
        return np.asarray(self.surface.positions(at[:1], at[1:])[0])

    def within(self, at: Float[ndarray, "2"]) -> bool:
        """Whether the point lies between apex and end."""
        return bool(0 <= self.cone.heights(self.point(at)[None])[0] <= 1)

    def _in_domain(self, at: Float[ndarray, "2"]) -> bool:
        """Inside the domain; a closed direction has no border."""
        low, high = self.surface.domain.T
        closed = np.array(self.surface.elements().period) > 0
        return bool((closed | ((at >= low) & (at <= high))).all())
