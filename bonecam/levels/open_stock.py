"""The stock of an open surface: as given, an offset or a mesh on one side of the part, and fitted over the
part's T-mesh.

The fit is by least squares, each Gauss point of the part going to its place on the stock as given: so far
along its normal, or the nearest. Both are looked at over many points of the part and, of a mesh, at the
vertices that stand above the part within its edges. A T-spline over the part's own T-mesh is the stock as it
is, each point of the part going to the one with its parameters. A mesh must lie on one side (where the edges
are fixed it
may touch the part), and the fit must not turn over. An offset is all that lies just so far from the part: its
places nearer to another part of it do not belong to it. What lies between these points is not seen.
"""

from dataclasses import dataclass
from numbers import Real

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import dots, lengths
from bonecam.errors import StockError, place_name
from bonecam.levels.measure.measure_open_cut import distances_to
from bonecam.levels.problem.element_matrices import ElementMatrices
from bonecam.levels.problem.factorisation import factorise
from bonecam.levels.problem.tolerances import NESTING_TOLERANCE
from bonecam.mesh.distance import exact_closest
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.surface.query.closest_point import Projection
from bonecam.surface.tspline import TSpline

FIT_STIFFNESS = 1e-16
"""Weight of the thin-plate energy in the fit of the stock: only what no Gauss
point shapes follows it."""

CHORD = 0.01
"""Chord tolerance (mm) of the tessellations on which part and stock are compared, the default of levels."""

ABOVE = 1 - 1e-6
"""Least cosine of the angle between a normal of the part and the direction to a point straight above it."""


@dataclass(frozen=True, eq=False)
class OpenStock:
    """The stock of an open surface: its `surface` over the part's T-mesh; the `side` of the part on which it
    lies (1: where the normals point); `points` of the stock as given (bent to the edges where they are fixed)
    and the `parameters` of their footpoints; the distance (mm) of the stock as given from the part where it
    is `farthest`; and the largest distance (mm) of the two stocks, the `deviation`, at `place`."""

    surface: TSpline
    side: float
    points: Float[ndarray, "n 3"]
    parameters: Float[ndarray, "n 2"]
    farthest: float
    deviation: float
    place: Float[ndarray, "3"]


def open_stock(surface: TSpline, matrices: ElementMatrices, stock: object, fixed: bool) -> OpenStock:
    """The stock as given (an offset in mm, a mesh or a T-spline) fitted over the T-mesh of the part, with the
    part's edges `fixed` or not; StockError where it is no stock, or not on one side of the part."""
    given = _given(stock)
    over = stock if isinstance(stock, TSpline) and stock.tmesh is surface.tmesh else None
    at = np.vstack([surface.seeds.parameters, surface.tessellate_with_parameters(CHORD).parameters])
    points, normals = surface.positions(*at.T), surface.normals(*at.T)
    wanted = _wanted(given, points, normals) if over is None else over.positions(*at.T)
    side = float(np.sign(np.median(dots(wanted - points, normals)))) or 1.0
    if isinstance(given, float):
        known = wanted[distances_to(surface, wanted, at) >= abs(given) - NESTING_TOLERANCE]
    else:
        vertices, footpoints = _above(surface, given.vertices)
        known = np.vstack([wanted, vertices])
        places = np.vstack([points, vertices])
        ahead = dots(
            known - np.vstack([points, footpoints.points]),
            np.vstack([normals, surface.normals(*footpoints.parameters.T)]),
        )
        _require_ahead(side * ahead, places, -NESTING_TOLERANCE if fixed else NESTING_TOLERANCE)
    free = _fit(surface, matrices, given) if over is None else over
    held = (matrices.edge & fixed)[:, None]
    bent = free.with_control_points(np.where(held, surface.control_points, free.control_points))
    fitted = free.positions(*at.T)
    reached = bent.positions(*at.T)

    # StockError where the fit faces against the part
    _, S_s, S_t = bent.derivatives(at[:, 0], at[:, 1], 1)
    upright = dots(np.cross(S_s, S_t), normals)
    if upright.min() <= 0:
        place = bent.positions(*at[[np.argmin(upright)]].T)[0]
        remedy = "give one that reaches over all of the part, nearer to it than its radii of curvature"
        message = f"the stock turns over at {place_name(place)}: {remedy}"
        raise StockError(message, place=place)

    _require_ahead(side * dots(reached - points, normals), points, -NESTING_TOLERANCE)
    known, footpoints = _above(free, known)
    off = (
        distances_to(surface, fitted, at) - abs(given)
        if isinstance(given, float)
        else lengths(fitted - exact_closest(given, fitted)[0])
    )
    off = np.append(np.abs(off), footpoints.distances)
    places = np.vstack([fitted, known])
    worst = int(np.argmax(off))
    moved, moved_footpoints = (
        free.basis(*which.T)[0] @ (matrices.edge & fixed) > 0 for which in (at, footpoints.parameters)
    )
    return OpenStock(
        surface=bent,
        side=side,
        points=np.vstack([known[~moved_footpoints], reached[moved]]),
        parameters=np.vstack([footpoints.parameters[~moved_footpoints], at[moved]]),
        farthest=float(distances_to(surface, known, footpoints.parameters).max(initial=0.0)),
        deviation=float(off[worst]),
        place=places[worst],
    )


def _given(stock: object) -> float | TriangleMesh:
    """The stock as given, as an offset in mm or as a mesh; StockError where it is neither."""
    if isinstance(stock, Real):
        if not (np.isfinite(float(stock)) and stock != 0):
            raise StockError(
                f"an offset of {stock} mm is no stock: give a distance above or below zero",
                distance=float(stock),
            )
        return float(stock)
    mesh = stock.tessellate(CHORD) if isinstance(stock, TSpline) else stock
    if not isinstance(mesh, TriangleMesh) or not len(mesh.faces):
        message = "a mesh without faces" if isinstance(mesh, TriangleMesh) else f"a {type(stock).__name__}"
        raise StockError(
            f"{message} is no stock of an open surface: give an offset in mm, a TriangleMesh or a TSpline"
        )
    return mesh


def _wanted(given: float | TriangleMesh, points: ndarray, normals: ndarray) -> Float[ndarray, "n 3"]:
    """Where points of the part go on the stock as given."""
    return (
        np.asarray(points + given * normals) if isinstance(given, float) else exact_closest(given, points)[0]
    )


def _above(surface: TSpline, points: ndarray) -> tuple[Float[ndarray, "n 3"], Projection]:
    """The points that stand straight above or below the surface, and their closest points on it: a point
    beyond its edges does not."""
    projection = surface.project(points)
    heights = np.abs(dots(points - projection.points, surface.normals(*projection.parameters.T)))
    kept = heights >= ABOVE * projection.distances
    return points[kept], Projection(*(each[kept] for each in projection))


def _require_ahead(ahead: ndarray, points: ndarray, least: float) -> None:
    """StockError where the stock lies less than `least` mm ahead of the part."""
    worst = int(np.argmin(ahead))
    if ahead[worst] < least:
        how = f"lies {-ahead[worst]:.3f} mm behind" if ahead[worst] < -NESTING_TOLERANCE else "touches"
        message = f"the stock {how} the part at {place_name(points[worst])}: give one on one side of it"
        raise StockError(message, distance=float(-ahead[worst]), place=points[worst])


def _fit(surface: TSpline, matrices: ElementMatrices, given: float | TriangleMesh) -> TSpline:
    """The stock over the part's T-mesh, with free edges."""
    points = matrices.R @ surface.control_points
    ways = matrices.weights[:, None] * (_wanted(given, points, matrices.normals) - points)
    way = factorise(matrices.N + FIT_STIFFNESS * matrices.M).solve(np.asarray(matrices.R.T @ ways))
    return surface.with_control_points(surface.control_points + way)
