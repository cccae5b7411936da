"""T-splines as tensor-product B-splines, and back.

One bicubic tensor-product B-spline surface: knots with multiplicities, poles and weights.

A T-spline as one tensor-product B-spline on the union of its knots: exact, rational where weights differ.

Any T-spline over a rectangle of parameters is one: its homogeneous coordinates are bicubic on every cell of
the grid that all element edges, prolonged, make. So the Bezier elements are cut along that grid (convex
combinations), the continuity across each grid line gives the knot's multiplicity, and each pole is the
blossom of the cell next to it (Ramshaw 1989): for knots a <= b <= c inside its support, with the wider of [a,
b] and [b, c] as cell, pole = (1 - x) b_1 + x b_2 with |x| <= 2. Nothing is solved and nothing fitted; what
comes out is compared with what went in before it is returned.

A closed direction stays periodic (no repeated end knots), and the seam is at its start; a pole of the
T-spline becomes a row of equal poles. A domain that is no rectangle has no such form: SurfaceError.

A B-spline surface of a CAD system as a T-spline: the same surface, with all of its knots in every row.

CAD systems write a surface that closes on itself with repeated end knots (IGES knows no other way); where its
ends meet C2 it becomes periodic again. Rows that are one point with one weight become poles. Parameters are
moved to [0, 1].
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int64
from numpy import ndarray

from bonecam.arrays import frozen
from bonecam.errors import SurfaceError
from bonecam.surface.basis import FEWEST, Elements, bernstein_coefficients, distinct, span_functions
from bonecam.surface.tmesh import OpenRowTMesh, RowTMesh
from bonecam.surface.tspline import TSpline


@dataclass(frozen=True, eq=False)
class Knots:
    """Cubic knots of one direction: distinct `values` (k,) with `multiplicities` (k,); closed: the last one
    is the first again.

    Open ends have multiplicity 4. In a closed direction pole 0 belongs to the function whose last support
    interval but one begins at the first knot (as OpenCASCADE counts them).
    """

    values: Float[ndarray, " k"]
    multiplicities: Int64[ndarray, " k"]
    closed: bool

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", frozen(self.values))
        object.__setattr__(self, "multiplicities", frozen(self.multiplicities, np.int64))

    @property
    def poles(self) -> int:
        """Number of poles in this direction."""
        return int(self.multiplicities[:-1].sum()) if self.closed else int(self.multiplicities.sum()) - 4

    @property
    def places(self) -> Int64[ndarray, " f"]:
        """Which knot each of the poles + 4 flat knots is; beyond the ends of a closed direction they go on
        counting."""
        if not self.closed:
            return np.repeat(np.arange(len(self.values)), self.multiplicities)
        cells = len(self.values) - 1
        once = np.repeat(np.arange(cells), self.multiplicities[:-1])
        turn, index = np.divmod(np.arange(self.poles + 4) + self.multiplicities[0] - 4, len(once))
        return once[index] + cells * turn

    @property
    def flat(self) -> Float[ndarray, " f"]:
        """The poles + 4 flat knots: pole i acts on [flat[i], flat[i + 4]]."""
        cells = len(self.values) - 1
        if not self.closed:
            return self.values[self.places]
        turn, index = np.divmod(self.places, cells)
        return self.values[index] + (self.values[-1] - self.values[0]) * turn

    def functions(self, x: Float[ndarray, " n"]) -> tuple[Float[ndarray, "n 4"], Int64[ndarray, "n 4"]]:
        """The four functions that live at each x inside [values[0], values[-1]], and the poles they belong
        to."""
        low, high = self.values[0], self.values[-1]
        period = high - low
        flat = self.flat
        count = self.poles
        if self.closed:
            x = low + np.mod(x - low, period)
            flat = np.concatenate([flat, flat[4:8] + period]) if count >= 4 else _unroll(flat, count, period)
        last = np.searchsorted(flat, high, side="left") - 1
        span = np.clip(np.searchsorted(flat, x, side="right") - 1, 3, last)
        values = span_functions(flat[span[:, None] + np.arange(-3, 5)], x, 0)[0]
        return values, (span[:, None] + np.arange(-3, 1)) % count


def _unroll(flat: ndarray, count: int, period: float) -> ndarray:
    """Flat knots of a closed direction with fewer than four poles, prolonged by four."""
    more = np.arange(len(flat), len(flat) + 4)
    return np.concatenate([flat, flat[more % count] + period * (more // count)])


@dataclass(frozen=True, eq=False)
class BSplineSurface:
    """One bicubic B-spline: poles (a, b, 3) in mm and weights (a, b), the first index along s."""

    s_knots: Knots
    t_knots: Knots
    poles: Float[ndarray, "a b 3"]
    weights: Float[ndarray, "a b"]

    def __post_init__(self) -> None:
        object.__setattr__(self, "poles", frozen(self.poles))
        object.__setattr__(self, "weights", frozen(self.weights))
        wanted = (self.s_knots.poles, self.t_knots.poles)
        if self.poles.shape != (*wanted, 3) or self.weights.shape != wanted:
            raise ValueError(
                f"the knots need {wanted} poles and weights, not {self.poles.shape[:2]} and {self.weights.shape}"
            )

    @property
    def rational(self) -> bool:
        """Whether the weights differ."""
        return bool(np.ptp(self.weights) > 0)

    @property
    def size(self) -> float:
        """Diagonal of the box round the poles, mm."""
        return float(np.linalg.norm(np.ptp(self.poles.reshape(-1, 3), axis=0)))

    @property
    def collapsed(self) -> tuple[bool, bool]:
        """Whether the first and the last row of poles along t is one point."""
        return bool(np.ptp(self.poles[:, 0], axis=0).max() == 0), bool(np.ptp(self.poles[:, -1], axis=0).max() == 0)

    @property
    def watertight(self) -> bool:
        """Whether the surface encloses a volume: closed in s, and at both ends of t closed or collapsed."""
        return self.s_knots.closed and (self.t_knots.closed or all(self.collapsed))

    def evaluate(self, s: Float[ndarray, " n"], t: Float[ndarray, " n"]) -> Float[ndarray, "n 3"]:
        """S at parameters inside the domain (mm); a closed direction wraps."""
        around, i = self.s_knots.functions(s)
        along, j = self.t_knots.functions(t)
        share = around[:, :, None] * along[:, None, :] * self.weights[i[:, :, None], j[:, None, :]]
        points: ndarray = (
            np.einsum("nij,nijc->nc", share, self.poles[i[:, :, None], j[:, None, :]]) / share.sum(axis=(1, 2))[:, None]
        )
        return points


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
    # SurfaceError where the two differ in the middle of a cell
    s, t = (
        a.ravel() for a in np.meshgrid(*[(k.values[1:] + k.values[:-1]) / 2 for k in (result.s_knots, result.t_knots)])
    )
    error = np.abs(result.evaluate(s, t) - surface.positions(s, t)).max()
    if not error <= EXACT * np.abs(result.poles).max():
        raise SurfaceError(
            f"the B-spline departs from the T-spline by {error:.1e} mm: write Bezier faces instead", error=float(error)
        )
    return result


def join_elements(elements: Elements, patches: Float[ndarray, "e 16 4"], closed: tuple[bool, bool]) -> BSplineSurface:
    """Bezier elements that fill a rectangle as one B-spline, closed in s, in t; with as few knots as their
    continuity allows.

    Raises SurfaceError where they fill none, or are torn along a line (the seam of a closed direction too).
    """
    s_breaks, t_breaks, grid = bezier_grid(elements, patches)
    largest = np.abs(grid).reshape(-1, 4).max(axis=0)
    scale = np.array([*[largest[:3].max()] * 3, largest[3]])
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


SAME = 1e-12
"""Share of the size: control points and weights that differ by less are one."""


def from_bspline(spline: BSplineSurface) -> TSpline:
    """The B-spline surface as a row-structured T-spline with s and t in [0, 1], exactly equal to it.

    Raises SurfaceError where it is closed in t, or closed in s with repeated knots or fewer than four: no
    T-mesh here holds these.
    """
    if spline.t_knots.closed:
        raise SurfaceError("the surface is closed along t: exchange its parameters, or cut it open")
    t_knots = _unit(spline.t_knots, spline.t_knots.flat)
    if not spline.s_knots.closed:
        rows = [_unit(spline.s_knots, spline.s_knots.flat)] * spline.t_knots.poles
        surface = TSpline(
            OpenRowTMesh.from_rows(t_knots, rows), spline.poles.swapaxes(0, 1).reshape(-1, 3), spline.weights.T.ravel()
        )
        # The surface, periodic where its first and last columns meet C2.
        if not (_near(spline.poles[[0, -1]], spline.size) and _near(spline.weights[[0, -1]], spline.weights.max())):
            return surface
        closed = join_elements(surface.elements(), surface.patches, (True, False))
        simple = closed.s_knots.multiplicities.max() == 1 and closed.s_knots.poles >= FEWEST
        return from_bspline(closed) if simple else surface
    if spline.s_knots.multiplicities.max() > 1 or spline.s_knots.poles < FEWEST:
        raise SurfaceError(
            "the surface is closed along s with repeated knots, or fewer than four: open it or smooth its knots first"
        )
    knots = _unit(spline.s_knots, spline.s_knots.values[:-1])
    points, weights = (np.roll(values, -1, axis=0) for values in (spline.poles, spline.weights))
    last = spline.t_knots.poles - 1
    single = [
        j in (0, last) and _near(points[:, j], spline.size) and _near(weights[:, j], weights.max())
        for j in range(last + 1)
    ]
    tmesh = RowTMesh.from_rows(t_knots, [knots[:1] * 0 if point else knots for point in single])
    kept = [slice(0, 1) if point else slice(None) for point in single]
    return TSpline(
        tmesh,
        np.vstack([points[here, j] for j, here in enumerate(kept)]),
        np.concatenate([weights[here, j] for j, here in enumerate(kept)]),
    )


def _near(values: ndarray, size: float) -> bool:
    return bool(np.ptp(values, axis=0).max() <= SAME * size)


def _unit(knots: Knots, values: ndarray) -> ndarray:
    """Values moved so that the domain of the knots is [0, 1]."""
    low, high = knots.values[0], knots.values[-1]
    return (values - low) / (high - low)
