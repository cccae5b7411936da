"""What holds everywhere on the levels, also between the points that `measure_cut.py` measures at: depth, nesting
and stock, by convex hulls.

A level is a bicubic polynomial patch on every element of the T-mesh (its weights are all one), and so is each
half of a patch. A patch lies in the hull of its 16 Bezier control points, so a convex function is nowhere on
it larger than at one of them.

- *Depth*: no point of level k is farther from level k - 1 than `depth`, and none of level k - 1 from level k.
  A piece of the one is compared with the other along the bilinear map of parameters that leads the piece's
  corners to their feet (`kernels/hull_depth.py`). Any map gives a true bound, this one a tight one: where it
  slides by e the bound is e^2 / 2d too large.
- *Stock*: the signed distance of a convex body is convex, so its largest value at control points bounds how
  far level k leaves the stock. (A stock given as a mesh may be off convex by 1e-5 of its diagonal, and the
  bound by as much.)
- *Nesting*: no point of level k - 1 is farther outside level k than -`nesting`. Let A be level k - 1 moved
  inwards by tau N, N a spline over the same blending functions with |N_i| = 1, so that A is within tau of
  level k - 1. Where the hulls of all pieces of A are g > 0 apart from those of level k the two do not meet. A
  is connected, so the winding number of level k is the same round all of A; it is found to be one round one
  point far from level k. So A is g deep inside level k, and `nesting` is g - tau. "Inside" is winding number
  one: the solid itself while level k does not cut itself, which `measure_cut.py` looks for in its tessellation.
- *The last cut* (`certificate_of_last`) goes to the stock itself: every point of its surface is the nearest
  one to a point of its mesh, no farther from it than the mesh's faces are deep; the faces are bounded as
  patches are. Patches of level K - 1 are bounded by planes.

Sums are in floating point; ROUNDING is added for it. What cannot be bounded within a tolerance has the bound
that was found.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial import cKDTree

from bonecam.arrays import dots, lengths
from bonecam.errors import place_name
from bonecam.kernels import hull_depth, hulls
from bonecam.levels.problem.tolerances import DEPTH_TOLERANCE, NESTING_TOLERANCE, STOCK_TOLERANCE
from bonecam.progress import Progress, report, silent
from bonecam.setup.stock import Stock
from bonecam.surface.tmesh.rows import RowTMesh
from bonecam.surface.tspline import TSpline

CLOSE = 1e-4
"""A depth bound is good enough up to so many mm over the limit of the cut."""
ACCURACY = 1e-4
"""A bound is good enough up to so many mm over a distance that is reached at some point."""
SMALLEST = 1e-4
"""Pieces of patches no larger than this (mm) are not halved again."""
ROUNDING = 1e-8
"""Added to every bound (mm) for the rounding of floating point sums."""
INWARDS = (0.001, 0.0015, 0.003, 0.01, 0.03)
"""How far (mm) a level is moved inwards before it must not meet the next; the first that does it is taken."""
SMALL = 0.02
"""Pieces of this size (mm) need not be a whole move apart."""
MOST_PAIRS = 4_000_000
"""Most pairs of pieces that are compared for one move inwards."""
SEEDS = 5
"""Points each way on an element that searches for feet start from."""
GRID = 7
"""Points each way on an element whose triangles the winding number is summed over."""
HALVINGS = 20
"""Most passes over the patches in which the doubtful ones are halved both ways."""
WHOLE = 0.1
"""How far a winding number summed over triangles may be off one."""
SAGITTAS = (0.02, 0.005, 0.001)
"""Chord tolerances (mm) of the stock's mesh, tried in this order until the last cut is certified."""
FARTHEST = 50
"""So many faces of the stock's mesh, those farthest from the level, are bounded first."""
HALVES = (
    np.array(
        [
            [[8, 0, 0, 0], [4, 4, 0, 0], [2, 4, 2, 0], [1, 3, 3, 1]],
            [[1, 3, 3, 1], [0, 2, 4, 2], [0, 0, 4, 4], [0, 0, 0, 8]],
        ]
    )
    / 8
)
"""Two 4 x 4 matrices that lead the control points of a cubic Bezier curve to those of its first and second half
(de Casteljau's algorithm at 1/2)."""


@dataclass(frozen=True, eq=False)
class Certificate:
    """What holds everywhere on one cut, mm, and where that is worst: no point of either level is farther than
    `depth` from the other, no point of the inner farther than -`nesting` outside the outer (-inf where that is
    not known), no point of the outer farther than `outside` out of the stock. `too_deep` are parameters of
    pieces of either that may be deeper than allowed."""

    depth: float
    nesting: float
    outside: float
    depth_place: Float[ndarray, "3"]
    nesting_place: Float[ndarray, "3"]
    outside_place: Float[ndarray, "3"]
    too_deep: Float[ndarray, "k 2"]
    pieces: int

    def shortfalls(self, limit: float) -> tuple[str, ...]:
        """What is not certain to be within the tolerances of the check, and where; nothing where the cut is
        certified."""
        found = []
        if self.depth > limit + DEPTH_TOLERANCE:
            found.append(
                f"may be {self.depth:.4f} mm deep, more than {limit:g} mm, at {place_name(self.depth_place)}"
            )
        if self.nesting < -NESTING_TOLERANCE:
            behind = f"may fall behind the level before by {-self.nesting:.4f} mm"
            found.append(
                f"{behind if np.isfinite(self.nesting) else 'is not proven to hold the level before'} at {place_name(self.nesting_place)}"
            )
        if self.outside > STOCK_TOLERANCE:
            found.append(f"may leave the stock by {self.outside:.4f} mm at {place_name(self.outside_place)}")
        return tuple(found)


def certify(
    surfaces: Sequence[TSpline], stock: Stock, limits: Sequence[float], *, progress: Progress = silent
) -> tuple[Certificate, ...]:
    """One certificate for each cut: between levels 0 to K - 1 (`surfaces`), and from the last of them to the
    stock; limits in mm.

    Raises ValueError for surfaces that are not closed row-structured T-splines with poles and weights of one.
    """
    if len(limits) != len(surfaces):
        raise ValueError(f"{len(surfaces)} levels and the stock need as many limits, not {len(limits)}")
    found = []
    for k, (inner, limit) in enumerate(zip(surfaces, limits), start=1):
        report(progress, k / len(surfaces), f"certifying level {k}")
        last = k == len(surfaces)
        found.append(
            certificate_of_last(inner, stock, limit)
            if last
            else certificate(inner, surfaces[k], stock, limit)
        )
    return tuple(found)


def certificate(inner: TSpline, outer: TSpline, stock: Stock, limit: float) -> Certificate:
    """The cut from level k (`outer`) down to level k - 1 (`inner`)."""
    nets = _nets(outer)
    there, back = _apart(outer, inner, limit), _apart(inner, outer, limit)
    gap, hindmost = _gap(inner, nets)
    outside, outermost = _outside(nets, stock)
    depth, deepest = max(there[:2], back[:2], key=lambda one: one[0])
    return Certificate(
        depth, gap, outside, deepest, hindmost, outermost, np.vstack([there[2], back[2]]), there[3] + back[3]
    )


def _apart(
    level: TSpline, other: TSpline, limit: float
) -> tuple[float, Float[ndarray, "3"], Float[ndarray, "k 2"], int]:
    """How far points of a level are from another over the same T-mesh at most; where; parameters of pieces
    that may be farther than `limit`; how many pieces that took."""
    boxes = level.elements().boxes
    corners = boxes[:, [[0, 2], [1, 2], [0, 3], [1, 3]]]
    goal, alarm = limit + CLOSE, limit + DEPTH_TOLERANCE
    bound, deepest, over, pieces = hull_depth.depth_bound(
        _nets(level), corners, _target(other), goal, alarm, ACCURACY, SMALLEST
    )
    place, too_deep = (_parameters(boxes, some) for some in (deepest[None], over))
    return bound + ROUNDING, level.positions(*place.T)[0], too_deep, pieces


def certificate_of_last(inner: TSpline, stock: Stock, limit: float) -> Certificate:
    """The last cut, from the stock down to level K - 1 (`inner`); finer meshes of the stock decide where
    coarse ones leave doubt."""
    on = _target(inner)
    for chord_tolerance in SAGITTAS:
        depth, place, pieces = _depth_of_stock(on, *_faces(stock, chord_tolerance))
        if depth <= limit + DEPTH_TOLERANCE:
            break
    nets = _nets(inner)
    outside, outermost = _outside(nets, stock)
    depth, place = max((depth, place), _farthest_inside(nets, stock, limit), key=lambda one: one[0])
    return Certificate(depth, -outside, 0.0, place, outermost, place, np.empty((0, 2)), pieces)


def _farthest_inside(
    pieces: Float[ndarray, "e 16 3"], stock: Stock, limit: float
) -> tuple[float, Float[ndarray, "3"]]:
    """How far inside the stock patches are at most, and about where; better than `limit` only where that is
    in doubt.

    The signed distance is convex: it lies above its tangent plane in the middle of a patch.
    """
    worst, place, reached = 0.0, np.zeros(3), 0.0
    for halving in range(HALVINGS):
        middles, corners = pieces.mean(1), pieces[:, [0, 3, 12, 15]]
        distance, out = stock.distances_and_normals(middles)
        most = -distance - np.einsum("nkx,nx->nk", pieces - middles[:, None], out).min(1)
        reached = max(reached, float(-stock.signed_distance(corners.reshape(-1, 3)).min()))
        doubtful = (most > max(limit, reached + ACCURACY)) & (halving < HALVINGS - 1)
        if not doubtful.all() and (bound := float(most[~doubtful].max())) > worst:
            worst, place = bound, middles[np.flatnonzero(~doubtful)[np.argmax(most[~doubtful])]]
        if not doubtful.any():
            break
        pieces = _quarters(pieces[doubtful])
    return worst + ROUNDING, place


def _depth_of_stock(
    on: hull_depth.Target, faces: Float[ndarray, "f 3 3"], sagitta: float
) -> tuple[float, Float[ndarray, "3"], int]:
    """How far the stock's surface, `sagitta` over these faces at most, is from a level; where; how many
    pieces that took."""
    middles = faces.mean(1)
    seeds = on.seeds.reshape(-1, 5)
    near, which = (np.asarray(found) for found in cKDTree(seeds[:, 2:]).query(middles))
    order = np.argsort(-near, kind="stable")
    reach = near + np.linalg.norm(faces - middles[:, None], axis=2).max(1)
    depth, place, pieces = 0.0, middles[order[0]], 0
    for part in (order[:FARTHEST], order[FARTHEST:]):  # how far those few are does for most of the others
        part = part[reach[part] > depth]
        nets, starts = _raised(faces[part]), np.repeat(seeds[which[part], None, :2], 4, axis=1)
        bound, (face, _, _), _, count = hull_depth.depth_bound(
            nets, starts, on, depth, np.inf, sagitta / 5, SMALLEST
        )
        pieces += count
        if bound > depth:
            depth, place = bound, middles[part[int(face)]]
    return depth + sagitta + ROUNDING, place, pieces


def certifiable(surface: TSpline) -> bool:
    """Whether it is a closed row-structured T-spline with poles and weights of one."""
    return (
        isinstance(surface.tmesh, RowTMesh)
        and surface.poles == (True, True)
        and bool((surface.weights == 1).all())
    )


def _nets(surface: TSpline) -> Float[ndarray, "e 16 3"]:
    """Bezier control points of every element."""
    if not certifiable(surface):
        raise ValueError(
            "certificates are for row-structured T-splines that are closed, with two poles, and have weights of one"
        )
    return np.ascontiguousarray(surface.patches[:, :, :3])


def _parameters(boxes: ndarray, pieces: ndarray) -> Float[ndarray, "k 2"]:
    """(s, t) of the middles of pieces (element, u, v)."""
    box = boxes[pieces[:, 0].astype(int)]
    return np.column_stack([box[:, i] + pieces[:, 1 + i // 2] * (box[:, i + 1] - box[:, i]) for i in (0, 2)])


def _target(surface: TSpline) -> hull_depth.Target:
    """The surface that depths are measured to."""
    elements, domain, nets = surface.elements(), surface.domain, _nets(surface)
    part = (np.arange(SEEDS) + 0.5) / SEEDS
    u, v = np.tile(part, SEEDS), np.repeat(part, SEEDS)
    low, size = elements.boxes[:, ::2, None], np.diff(elements.boxes.reshape(-1, 2, 2), axis=2)
    s, t = low[:, 0] + size[:, 0] * u, low[:, 1] + size[:, 1] * v
    points = surface.positions(s.ravel(), t.ravel()).reshape(*s.shape, 3)
    longest = np.array([0.02, 0.05]) * np.diff(domain)[:, 0]
    ends = (np.array(elements.period), np.array(surface.poles), longest)
    around = np.hstack([nets.min(1), nets.max(1)])
    return hull_depth.Target(
        surface.patches, elements.boxes, elements.strips, domain, *ends, np.dstack([s, t, points]), around
    )


def _gap(inner: TSpline, outer: Float[ndarray, "e 16 3"]) -> tuple[float, Float[ndarray, "3"]]:
    """How far inside the outer level the inner one is at least, and about where it is least."""
    boxes = inner.elements().boxes
    s, t = boxes[:, :2].mean(1), boxes[:, 2:].mean(1)
    _, S_s, S_t = inner.derivatives(s, t, 1)
    N = inner.basis(s, t)[0].T @ np.cross(S_s, S_t)
    N /= np.maximum(np.linalg.norm(N, axis=1), np.finfo(float).tiny)[:, None]
    place = np.zeros(3)
    for move in INWARDS:
        moved = inner.with_control_points(inner.control_points - move * N)
        apart, place, _ = hulls.separation(
            _nets(moved), outer, move, move - INWARDS[0], SMALL, SMALLEST, MOST_PAIRS
        )
        if apart > ROUNDING and _inside(moved.positions(s, t), outer):
            return apart - move - ROUNDING, place
    return -np.inf, place


def _inside(points: Float[ndarray, "n 3"], nets: Float[ndarray, "e 16 3"]) -> bool:
    """Whether the winding number is one round that of the points that is farthest from the surface: a sum of
    solid angles."""
    x = np.arange(GRID) / (GRID - 1)
    B = np.column_stack([(1 - x) ** 3, 3 * x * (1 - x) ** 2, 3 * x**2 * (1 - x), x**3])
    grid = np.einsum("ai,bj,nijx->nabx", B, B, nets.reshape(-1, 4, 4, 3))
    around = grid - points[np.argmax(cKDTree(grid.reshape(-1, 3)).query(points)[0])]
    a, b, c, d = (
        around[:, i : GRID - 1 + i, j : GRID - 1 + j].reshape(-1, 3)
        for i, j in ((0, 0), (0, 1), (1, 1), (1, 0))
    )
    winding = (_solid_angles(a, b, c).sum() + _solid_angles(a, c, d).sum()) / (4 * np.pi)
    return bool(abs(winding - 1) < WHOLE)


def _solid_angles(a: ndarray, b: ndarray, c: ndarray) -> ndarray:
    """Signed solid angles (steradians) of triangles with corners a, b, c (n, 3) seen from the origin (van Oosterom &
    Strackee 1983)."""
    p, q, r = lengths(a), lengths(b), lengths(c)
    return np.asarray(
        2 * np.arctan2(dots(a, np.cross(b, c)), p * q * r + dots(a, b) * r + dots(b, c) * p + dots(c, a) * q)
    )


def _outside(pieces: Float[ndarray, "e 16 3"], stock: Stock) -> tuple[float, Float[ndarray, "3"]]:
    """How far patches leave the stock at most (negative: inside), about where; better than nought only where
    nought is in doubt."""
    worst, place, reached = -np.inf, np.zeros(3), -np.inf
    for halving in range(HALVINGS):
        values = stock.signed_distance(pieces.reshape(-1, 3)).reshape(-1, 16)
        most, reached = values.max(1), max(reached, float(values[:, [0, 3, 12, 15]].max()))
        doubtful = (
            most > max(0.0, reached + ACCURACY) if halving < HALVINGS - 1 else np.zeros(len(most), dtype=bool)
        )
        if not doubtful.all() and (bound := float(most[~doubtful].max())) > worst:
            piece = np.flatnonzero(~doubtful)[np.argmax(most[~doubtful])]
            worst, place = bound, pieces[piece, np.argmax(values[piece])]
        if not doubtful.any():
            break
        pieces = _quarters(pieces[doubtful])
    return worst + ROUNDING, place


def _quarters(pieces: Float[ndarray, "e 16 3"]) -> Float[ndarray, "f 16 3"]:
    """Every patch cut in four."""
    quarters = np.einsum("aik,bjl,nklx->nabijx", HALVES, HALVES, pieces.reshape(-1, 4, 4, 3))
    return np.ascontiguousarray(quarters.reshape(-1, 16, 3))


def _faces(stock: Stock, chord_tolerance: float) -> tuple[Float[ndarray, "f 3 3"], float]:
    """The corners of the faces of the stock's mesh, and how deep inside the stock they are at most (the
    signed distance is convex, so over a face it stays above its tangent plane in the middle)."""
    mesh = stock.mesh(chord_tolerance)
    faces = mesh.vertices[mesh.faces]
    middles = faces.mean(1)
    distance, out = stock.distances_and_normals(middles)
    slope = np.einsum("fcx,fx->fc", faces - middles[:, None], out).min(1)
    return faces, max(0.0, float(-(distance + slope).min()))


def _raised(faces: Float[ndarray, "f 3 3"]) -> Float[ndarray, "f 16 3"]:
    """Triangles as bicubic nets, one side of which is a point."""
    third = np.arange(4) / 3
    low = faces[:, :1] + third[:, None] * (faces[:, 1:2] - faces[:, :1])
    return np.ascontiguousarray(
        (low[:, None] + third[:, None, None] * (faces[:, 2][:, None, None] - low[:, None])).reshape(-1, 16, 3)
    )
