"""A T-spline as one tensor-product B-spline on the union of its knots: exact, rational where weights differ.

Any T-spline over a rectangle of parameters is one: its homogeneous coordinates are bicubic on every cell of
the grid that all element edges, prolonged, make. So the Bezier elements are cut along that grid (convex
combinations), the continuity across each grid line gives the knot's multiplicity, and each pole is the
blossom of the cell next to it (Ramshaw 1989): for knots a <= b <= c inside its support, with the wider of [a,
b] and [b, c] as cell, pole = (1 - x) b_1 + x b_2 with |x| <= 2. Nothing is solved and nothing fitted; what
comes out is compared with what went in before it is returned.

A closed direction stays periodic (no repeated end knots), and the seam is at its start; a pole of the
T-spline becomes a row of equal poles. A domain that is no rectangle has no such form: SurfaceError.
"""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import SurfaceError
from bonecam.surface.basis.elements import Elements
from bonecam.surface.basis.knots import bernstein_coefficients, distinct
from bonecam.surface.files.bspline.bspline_surface import BSplineSurface, Knots
from bonecam.surface.tspline import TSpline

SMOOTH = 1e-11
"""Share of the size: a jump below this in the next cell's Bezier points is rounding."""


ROUNDING = 1e-14
"""Share of the size: equal poles and weights that differ by less are made equal."""


EXACT = 1e-12
"""Share of the size: more between T-spline and B-spline is an error."""


def to_bspline(surface: TSpline) -> BSplineSurface:
    """The T-spline as one B-spline with the same parameters, equal to it up to rounding (measured).

    Raises SurfaceError where the domain is no rectangle or the surface is torn along a line.
    """
    period = surface.elements().period
    result = join_elements(surface.elements(), surface.patches, (period[0] > 0, period[1] > 0))
    _prove(result, surface)
    return result


def join_elements(elements: Elements, patches: Float[ndarray, "e 16 4"], closed: tuple[bool, bool]) -> BSplineSurface:
    """Bezier elements that fill a rectangle as one B-spline, closed in s, in t; with as few knots as their
    continuity allows.

    Raises SurfaceError where they fill none, or are torn along a line (the seam of a closed direction too).
    """
    s_breaks, t_breaks, grid = bezier_grid(elements, patches)
    scale = _scale(grid)
    s_knots = _knots(s_breaks, grid, closed[0], scale)
    t_knots = _knots(t_breaks, grid.transpose(1, 0, 3, 2, 4), closed[1], scale)
    homogeneous = _poles(t_knots, _poles(s_knots, grid).swapaxes(0, 1)).swapaxes(0, 1)
    weights = homogeneous[..., 3]
    poles = homogeneous[..., :3] / weights[..., None]
    if np.ptp(weights) <= ROUNDING * weights.max():
        weights = np.ones_like(weights)
    for end in (poles[:, 0], poles[:, -1]):
        if np.ptp(end, axis=0).max() <= ROUNDING * scale[0]:
            end[:] = end[0]
    return BSplineSurface(s_knots, t_knots, poles, weights)


def bezier_grid(
    elements: Elements, patches: Float[ndarray, "e 16 4"]
) -> tuple[Float[ndarray, " s"], Float[ndarray, " t"], Float[ndarray, "a b 4 4 4"]]:
    """The breaks of both directions and the homogeneous Bezier points [s cell, t cell, s index, t index] of
    every cell of their grid."""
    breaks = distinct(elements.boxes[:, :2].ravel()), distinct(elements.boxes[:, 2:].ravel())
    first = [_nearest(b, elements.boxes[:, 2 * k]) for k, b in enumerate(breaks)]
    last = [_nearest(b, elements.boxes[:, 2 * k + 1]) for k, b in enumerate(breaks)]
    wide, tall = (last[k] - first[k] for k in (0, 1))
    element = np.repeat(np.arange(len(wide)), wide * tall)
    index = np.arange(len(element)) - np.repeat(np.cumsum(wide * tall) - wide * tall, wide * tall)
    cell = [first[0][element] + index % wide[element], first[1][element] + index // wide[element]]
    shape = len(breaks[0]) - 1, len(breaks[1]) - 1
    if len(element) != shape[0] * shape[1] or len(np.unique(cell[0] * shape[1] + cell[1])) != len(element):
        covered = len(np.unique(cell[0] * shape[1] + cell[1]))
        raise SurfaceError(
            f"the domain is no rectangle ({covered} of {shape[0] * shape[1]} cells): write Bezier faces instead"
        )
    cuts = [_cut(breaks[k], cell[k], first[k][element], last[k][element]) for k in (0, 1)]
    grid = np.empty((*shape, 4, 4, 4))
    corners = patches[element].reshape(-1, 4, 4, 4)  # [t, s, coordinate]
    grid[cell[0], cell[1]] = np.einsum("nfi,ngj,ngfc->nijc", *cuts, corners, optimize=True)
    return breaks[0], breaks[1], grid


def _nearest(breaks: ndarray, values: ndarray) -> ndarray:
    """Index of the break nearest to each value."""
    return np.searchsorted((breaks[1:] + breaks[:-1]) / 2, values)


def _cut(breaks: ndarray, cell: ndarray, first: ndarray, last: ndarray) -> Float[ndarray, "n 4 4"]:
    """Matrices (n, from, to) that take the Bezier points of the interval first..last to those of one cell
    of it.
    """
    length = breaks[last] - breaks[first]
    low, high = ((breaks[cell + k] - breaks[first]) / length for k in (0, 1))
    return bernstein_coefficients(np.broadcast_to(np.repeat([0.0, 1.0], 4), (len(cell), 8)), low, high)


def _scale(grid: Float[ndarray, "a b 4 4 4"]) -> Float[ndarray, "4"]:
    """Largest of each homogeneous coordinate; the three of space share theirs."""
    largest = np.abs(grid).reshape(-1, 4).max(axis=0)
    return np.array([*[largest[:3].max()] * 3, largest[3]])


def _knots(breaks: ndarray, grid: Float[ndarray, "a b 4 4 4"], closed: bool, scale: Float[ndarray, "4"]) -> Knots:
    """Multiplicity 1 where the grid is C2 across a line of its first index, 2 where C1, 3 where C0; 4 at open
    ends."""
    cells = len(breaks) - 1
    width = np.diff(breaks)
    lines = range(cells) if closed else range(1, cells)
    inner = [_multiplicity(grid[k - 1], grid[k], width[k - 1], width[k], scale) for k in lines]
    for k, multiplicity in zip(lines, inner):
        if multiplicity > 3:
            raise SurfaceError(
                f"the surface is torn along parameter {breaks[k]}: write Bezier faces instead",
                parameter=float(breaks[k]),
            )
    return Knots(breaks, np.array([*inner, inner[0]] if closed else [4, *inner, 4]), closed)


def _multiplicity(
    left: Float[ndarray, "b 4 4 4"],
    right: Float[ndarray, "b 4 4 4"],
    h_left: float,
    h_right: float,
    scale: Float[ndarray, "4"],
) -> int:
    """4 less the number of the narrower cell's Bezier points that continue the wider one's polynomial, at
    least 1."""
    wide, narrow, r = (
        (left[:, ::-1], right, h_right / h_left) if h_left >= h_right else (right, left[:, ::-1], h_left / h_right)
    )
    w0, w1, w2 = (wide[:, k] for k in range(3))
    continued = (w0, w0 + r * (w0 - w1), w0 + 2 * r * (w0 - w1) + r * r * (w0 - 2 * w1 + w2))
    for k in range(3):
        if (np.abs(narrow[:, k] - continued[k]) > SMOOTH * scale).any():
            return 4 - k
    return 1


def _poles(knots: Knots, grid: ndarray) -> ndarray:
    """Poles [pole, other, ...] of Bezier points [cell, other, index, ...]."""
    places = knots.places
    flat = knots.flat
    cells = len(knots.values) - 1
    i = np.arange(knots.poles)
    a, b, c = (flat[i + k] for k in (1, 2, 3))
    first = b - a >= c - b
    cell = np.where(first, places[i + 1], places[i + 2])
    single = places[i + 1] == places[i + 3]
    length = np.where(single, 1.0, np.where(first, b - a, c - b))
    x = np.where(first, c - a, a - b) / length
    last = single & (cell == cells)
    low = np.where(single, np.where(last, 3, 0), 1)
    high = np.where(single, np.where(last, 3, 0), 2)
    cell = np.where(last, cells - 1, cell) % cells
    share = x.reshape(-1, *[1] * (grid.ndim - 2))
    poles: ndarray = (1 - share) * grid[cell, :, low] + share * grid[cell, :, high]
    return poles


def _prove(result: BSplineSurface, surface: TSpline) -> None:
    """SurfaceError where the two differ in the middle of a cell."""
    s, t = (
        a.ravel() for a in np.meshgrid(*[(k.values[1:] + k.values[:-1]) / 2 for k in (result.s_knots, result.t_knots)])
    )
    error = np.abs(result.evaluate(s, t) - surface.positions(s, t)).max()
    if not error <= EXACT * np.abs(result.poles).max():
        raise SurfaceError(
            f"the B-spline departs from the T-spline by {error:.1e} mm: write Bezier faces instead", error=float(error)
        )
