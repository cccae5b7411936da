"""The kind of a T-spline, measured from its blending functions.

standard: the blending functions sum to one; semi-standard: they do with some positive weights; non-
standard: with none, so only the division by W = sum w B makes the surface follow its control points
(Sederberg et al. 2004, section 3). All are looked for in Bernstein coefficients: sum_i x_i C_i = 1 on every
element is a linear system, and its rank tells whether the functions are independent.

A T-junction of a general T-mesh is a vertex with three edges inside the domain. Its extension runs against the missing
edge to the first knot (edge extension) and through the missing edge to the second (face extension). A T-mesh in which
no extension along s meets one along t is analysis-suitable: its blending functions are linearly independent and sum to
one for some weights (Scott, Li, Sederberg & Hughes 2012, Definition 1).
"""

import math
from dataclasses import dataclass
from itertools import product

import numpy as np
import scipy.sparse as sp
from bonecam_plugins.tsplines.tmesh import TMesh, beside
from jaxtyping import Float, Int64
from numpy import ndarray

from bonecam.surface import TSpline

ONE = 1e-10
"""How near a sum must come to one."""

RANK = 1e-12
"""Share of the largest eigenvalue: below this a combination of functions is zero."""

GRID = 17
"""Places along an element at which the sum is measured."""

STEPS = ((1, 0), (0, 1), (-1, 0), (0, -1))
"""Steps in lines of s and t of the directions 0 +s, 1 +t, 2 -s, 3 -t."""


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """`kind`, the evidence for it, and how T-junction extensions meet.

    sum_error is the largest |sum B - 1|; sums_to_one counts the faces (elements, where rows have no faces) on
    which it is below 1e-10; unit_weights make the sum one where there are such weights. crossing and touching
    hold pairs of T-junctions.
    """

    kind: str
    sum_error: float
    sums_to_one: int
    faces: int
    unit_weights: Float[ndarray, " n"] | None
    nullity: int
    junctions: int
    crossing: Int64[ndarray, "c 2"]
    touching: Int64[ndarray, "d 2"]

    @property
    def standard(self) -> bool:
        """The functions sum to one."""
        return self.kind == "standard"

    @property
    def semi_standard(self) -> bool:
        """The functions sum to one with some positive weights (a standard T-spline is semi-standard, too)."""
        return self.kind != "non-standard"

    @property
    def meeting(self) -> int:
        """Pairs of closed extensions that meet, crossing or touching."""
        return len(self.crossing) + len(self.touching)

    @property
    def analysis_suitable(self) -> bool:
        """No extension meets another, not even at an end (Li & Scott's closed extensions)."""
        return self.meeting == 0

    @property
    def linearly_independent(self) -> bool:
        """No blending function is a combination of the others."""
        return self.nullity == 0


def diagnose(surface: TSpline) -> Diagnosis:
    """Measure what kind of T-spline the surface is; weights and control points play no part."""
    elements = surface.elements()
    tmesh = surface.tmesh

    # Row 16 e + c (cubic elements): the c-th Bernstein coefficients on element e of all functions
    element = np.repeat(np.arange(len(elements.boxes)), np.diff(elements.starts))
    count = elements.coefficients.shape[1]
    rows = (count * element[:, None] + np.arange(count)).ravel()
    columns = np.repeat(elements.functions, count)
    matrix = sp.csr_array(
        (elements.coefficients.ravel(), (rows, columns)), shape=(count * len(elements.boxes), tmesh.size)
    )

    # Largest |sum - 1| on each element, on a grid of places
    sums = matrix @ np.ones(tmesh.size)
    x = np.linspace(0, 1, GRID)
    d = elements.degree
    bernstein = np.array([math.comb(d, k) * x**k * (1 - x) ** (d - k) for k in range(d + 1)])
    values = np.einsum("eji,jn,im->enm", sums.reshape(-1, d + 1, d + 1), bernstein, bernstein)
    errors: ndarray = np.abs(values - 1).max(axis=(1, 2))

    gram = (matrix.T @ matrix).toarray()

    # Positive weights that make the functions sum to one; None where there are none
    one = np.ones(matrix.shape[0])
    solved: ndarray = np.linalg.lstsq(gram, matrix.T @ one, rcond=None)[0]
    weights = solved if np.abs(matrix @ solved - one).max() <= ONE and solved.min() > 0 else None

    values = np.linalg.eigvalsh(gram)
    nullity = int((values <= RANK * values[-1]).sum())
    kind = "standard" if errors.max() <= ONE else "non-standard" if weights is None else "semi-standard"
    general = isinstance(tmesh, TMesh)
    face = np.arange(len(elements.boxes))
    crossing = touching = np.zeros((0, 2), dtype=np.int64)
    if general:  # the face each element lies in
        s, t = elements.boxes[:, :2].mean(axis=1), elements.boxes[:, 2:].mean(axis=1)
        for k, (s_low, s_high, t_low, t_high) in enumerate(tmesh.face_boxes):
            face[(s_low < s) & (s < s_high) & (t_low < t) & (t < t_high)] = k
        crossing, touching = _meetings(tmesh)
    worst = np.zeros(int(face.max()) + 1)
    np.maximum.at(worst, face, errors)
    return Diagnosis(
        kind=kind,
        sum_error=float(errors.max()),
        sums_to_one=int((worst <= ONE).sum()),
        faces=len(worst),
        unit_weights=weights,
        nullity=nullity,
        junctions=len(junctions(tmesh)[0]) if general else 0,
        crossing=crossing,
        touching=touching,
    )


def _around(tmesh: TMesh, pieces_s: ndarray, pieces_t: ndarray) -> ndarray:
    """The values of the pieces between crossings on the four sides of each vertex, (n, 4); False where there
    is no piece. `pieces_s` run along s, `pieces_t` along t."""
    sides = np.zeros((tmesh.size, 4), dtype=bool)
    for direction, step in enumerate(STEPS):
        pieces = (pieces_s, pieces_t)[direction % 2]
        place = tmesh.vertices + np.minimum(step, 0)
        for axis in (0, 1):
            if tmesh.period[axis]:
                place[:, axis] %= pieces.shape[axis]
        there = ((place >= 0) & (place < pieces.shape)).all(axis=1)
        sides[there, direction] = pieces[tuple(place[there].T)]
    return sides


def junctions(tmesh: TMesh) -> tuple[Int64[ndarray, " j"], Int64[ndarray, " j"]]:
    """All T-junctions: vertices, and the direction of the missing edge, 0 +s, 1 +t, 2 -s, 3 -t. Vertices with the same
    two knots are one: an edge that goes on from any of them is not missing."""
    edges = _around(tmesh, tmesh.along_s, tmesh.along_t)  # whether one leaves each vertex in each direction
    inside = _around(
        tmesh, beside(tmesh.inside, bool(tmesh.period[1])), beside(tmesh.inside.T, bool(tmesh.period[0])).T
    )
    s_long, t_long = (interval > 0 for interval in tmesh.intervals)
    long = _around(
        tmesh,
        np.repeat(s_long[:, None], len(tmesh.t_lines), axis=1),
        np.repeat(t_long[None], len(tmesh.s_lines), axis=0),
    )
    s, t = tmesh.s_lines[tmesh.vertices[:, 0]], tmesh.t_lines[tmesh.vertices[:, 1]]
    place = np.unique(np.column_stack([s, t]), axis=0, return_inverse=True)[1].ravel()
    leaving = np.zeros((int(place.max()) + 1, 4), dtype=bool)
    np.logical_or.at(leaving, place, edges & long)
    missing = ~edges & inside & (edges.sum(axis=1) == 3)[:, None] & ~leaving[place]
    vertices, directions = np.nonzero(missing)
    first = np.sort(np.unique(4 * place[vertices] + directions, return_index=True)[1])
    return vertices[first], directions[first]


def _meetings(tmesh: TMesh) -> tuple[Int64[ndarray, "c 2"], Int64[ndarray, "d 2"]]:
    """Pairs of T-junctions whose extensions cross inside both, and pairs whose extensions only touch at an
    end of one; the extension along s comes first."""
    vertices, directions = junctions(tmesh)

    # Extensions along s and those along t: T-junctions, knots of the line across, of the lower and of the higher end
    extensions = []
    for axis in (0, 1):
        here = directions % 2 == axis
        v = vertices[here]
        forward = directions[here] < 2
        knots = tmesh.local_knots[axis][v]
        low = np.where(forward, knots[:, 1], knots[:, 0])
        high = np.where(forward, knots[:, 4], knots[:, 3])
        extensions.append((v, tmesh.local_knots[1 - axis][v][:, 2], low, high))
    (s_vertices, y, low, high), (t_vertices, x, below, above) = extensions
    y, low, high = y[:, None], low[:, None], high[:, None]

    crossing = [np.zeros((0, 2), dtype=np.int64)]
    touching = [np.zeros((0, 2), dtype=np.int64)]
    # In a closed direction extensions may meet one period on
    for ds, dt in product(*((-period, 0.0, period) if period else (0.0,) for period in tmesh.period)):
        meet = (low <= x + ds) & (x + ds <= high) & (below + dt <= y) & (y <= above + dt)
        inner = (low < x + ds) & (x + ds < high) & (below + dt < y) & (y < above + dt)
        for pairs, which in ((crossing, inner), (touching, meet & ~inner)):
            i, j = np.nonzero(which)
            pairs.append(np.column_stack([s_vertices[i], t_vertices[j]]))
    return np.concatenate(crossing), np.concatenate(touching)
