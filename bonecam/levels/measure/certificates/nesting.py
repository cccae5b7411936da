"""How far a level lies inside the next one at least.

Let A be level k - 1 moved inwards by tau N, N a spline over the same blending functions with |N_i| = 1, so
that A is within tau of level k - 1. Where the hulls of all pieces of A are g > 0 apart from those of level k
the two do not meet. A is connected, so the winding number of level k is the same round all of A; it is found
to be one round one point far from level k. So A is g deep inside level k, and level k - 1 is g - tau inside.
"Inside" is winding number one: the solid itself while level k does not cut itself, which
`levels.measure.measure_cut` looks for in its tessellation.
"""

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial import cKDTree

from bonecam.arrays import dots, lengths
from bonecam.kernels.hulls.separation import separation
from bonecam.levels.measure.certificates.certificate import ROUNDING, SMALLEST
from bonecam.levels.measure.certificates.nets import bezier_nets
from bonecam.surface.tspline import TSpline

MOVES = (0.001, 0.0015, 0.003, 0.01, 0.03)
"""How far (mm) a level is moved inwards before it must not meet the next; the first that does it is taken."""

SMALL = 0.02
"""Pieces of this size (mm) need not be a whole move apart."""

MOST_PAIRS = 4_000_000
"""Most pairs of pieces that are compared for one move inwards."""

SAMPLES = 7
"""Points each way on an element whose triangles the winding number is summed over."""

WINDING_TOLERANCE = 0.1
"""How far a winding number summed over triangles may be off one."""


def bound_nesting(inner: TSpline, outer: Float[ndarray, "e 16 3"]) -> tuple[float, Float[ndarray, "3"]]:
    """How far inside the outer level, given by its nets, the inner one is at least (mm, -inf where that is
    not known), and about where it is least."""
    boxes = inner.elements().boxes
    s = boxes[:, :2].mean(1)
    t = boxes[:, 2:].mean(1)
    _, S_s, S_t = inner.derivatives(s, t, 1)
    N = inner.basis(s, t)[0].T @ np.cross(S_s, S_t)
    N /= np.maximum(np.linalg.norm(N, axis=1), np.finfo(float).tiny)[:, None]
    place = np.zeros(3)
    for move in MOVES:
        moved = inner.with_control_points(inner.control_points - move * N)
        gap, place, _ = separation(
            bezier_nets(moved),
            outer,
            goal=move,
            enough=move - MOVES[0],
            small=SMALL,
            smallest=SMALLEST,
            most=MOST_PAIRS,
        )
        if gap > ROUNDING and _encloses(outer, moved.positions(s, t)):
            return gap - move - ROUNDING, place
    return -np.inf, place


def _encloses(nets: Float[ndarray, "e 16 3"], points: Float[ndarray, "n 3"]) -> bool:
    """Whether the winding number of the patches is one round the point that is farthest from them: the sum of
    the solid angles of triangles on them."""
    x = np.arange(SAMPLES) / (SAMPLES - 1)
    B = np.column_stack([(1 - x) ** 3, 3 * x * (1 - x) ** 2, 3 * x**2 * (1 - x), x**3])
    grid = np.einsum("ai,bj,nijx->nabx", B, B, nets.reshape(-1, 4, 4, 3))
    around = grid - points[np.argmax(cKDTree(grid.reshape(-1, 3)).query(points)[0])]
    a, b, c, d = (
        around[:, i : SAMPLES - 1 + i, j : SAMPLES - 1 + j].reshape(-1, 3)
        for i, j in ((0, 0), (0, 1), (1, 1), (1, 0))
    )
    winding = (_solid_angles(a, b, c).sum() + _solid_angles(a, c, d).sum()) / (4 * np.pi)
    return bool(abs(winding - 1) < WINDING_TOLERANCE)


def _solid_angles(
    a: Float[ndarray, "n 3"], b: Float[ndarray, "n 3"], c: Float[ndarray, "n 3"]
) -> Float[ndarray, "n"]:
    """Signed solid angles (steradians) of triangles with corners a, b, c seen from the origin (van Oosterom &
    Strackee 1983)."""
    p, q, r = lengths(a), lengths(b), lengths(c)
    return 2 * np.arctan2(
        dots(a, np.cross(b, c)), p * q * r + dots(a, b) * r + dots(b, c) * p + dots(c, a) * q
    )
