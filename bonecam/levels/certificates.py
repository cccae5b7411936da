"""The certificate of one cut: the bounds that hold everywhere on it.

The patches that certificates bound: their nets of Bezier control points, and the nets of their
quarters.

How deep a cut is at most, between two levels.

No point of level k is farther from level k - 1 than the depth, and none of level k - 1 from level k. A piece
of the one is compared with the other along the bilinear map of parameters that leads the piece's corners to
their footpoints (`kernels.hulls.mapped_distance`). Any map gives a true bound, this one a tight one: where
the footpoint of a point at the distance d is off by e, the bound is e^2 / 2d too large.

Certify the cuts of a sequence of levels, one by one.

How deep the last cut is at most, from the stock down to a level.

Every point of the stock's surface is the nearest one to a point of its mesh, and no farther from it than the
mesh's faces are inside the stock. The faces are bounded as patches are (`kernels.hulls.depth`); finer meshes
decide where coarse ones leave doubt.

How far a level is out of the stock at most, and how far inside it.

The signed distance of a convex body is convex. So its largest value at control points bounds it from above on
their patch, and its tangent plane at one point bounds it from below. (A stock given as a mesh may be off
convex by 1e-5 of its diagonal, and the bounds by as much.)

How far a level lies inside the next one at least.

Let A be level k - 1 moved inwards by tau N, N a spline over the same blending functions with |N_i| = 1, so
that A is within tau of level k - 1. Where the hulls of all pieces of A are g > 0 apart from those of level k
the two do not meet. A is connected, so the winding number of level k is the same round all of A; it is found
to be one round one point far from level k. So A is g deep inside level k, and level k - 1 is g - tau inside.
"Inside" is winding number one: the solid itself while level k does not cut itself, which
`levels.measure.inspection` looks for in its tessellation.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial import cKDTree

from bonecam.arrays import dots, lengths
from bonecam.errors import place_name
from bonecam.kernels.hulls import DepthTarget, depth_bound, separation
from bonecam.levels.problem import DEPTH_TOLERANCE, NESTING_TOLERANCE, STOCK_TOLERANCE
from bonecam.progress import Progress, report, silent
from bonecam.setup.stock import Stock
from bonecam.surface.tmesh import RowTMesh
from bonecam.surface.tspline import TSpline

ACCURACY = 1e-4
"""A bound is good enough up to so many mm over a distance that is reached at some point."""

SMALLEST = 1e-4
"""Pieces of patches no larger than this (mm) are not halved again."""

ROUNDING = 1e-8
"""Added to every bound (mm) for the rounding of floating point sums."""

MAX_HALVINGS = 20
"""Most passes over the patches in which those that are bounded too loosely are halved both ways."""


@dataclass(frozen=True, eq=False)
class Certificate:
    """What holds everywhere on one cut, mm, and where that is worst: no point of either level is farther than
    `depth` from the other, no point of the inner farther than -`nesting` outside the outer (-inf where that
    is not known), no point of the outer farther than `outside` out of the stock. `too_deep` are parameters
    (s, t) of pieces of either level that may be deeper than allowed; `pieces` is how many were bounded."""

    depth: float
    nesting: float
    outside: float
    depth_place: Float[ndarray, "3"]
    nesting_place: Float[ndarray, "3"]
    outside_place: Float[ndarray, "3"]
    too_deep: Float[ndarray, "k 2"]
    pieces: int

    def shortfalls(self, limit: float) -> tuple[str, ...]:
        """What is not certain to be within the tolerances of the check, and where, for a cut of at most
        `limit` mm; nothing where the cut is certified."""
        shortfalls = []
        if self.depth > limit + DEPTH_TOLERANCE:
            place = place_name(self.depth_place)
            shortfalls.append(f"may be {self.depth:.4f} mm deep, more than {limit:g} mm, at {place}")

        if self.nesting < -NESTING_TOLERANCE:
            known = np.isfinite(self.nesting)
            behind = f"may fall behind the level before by {-self.nesting:.4f} mm"
            shortfall = behind if known else "is not proven to hold the level before"
            shortfalls.append(f"{shortfall} at {place_name(self.nesting_place)}")

        if self.outside > STOCK_TOLERANCE:
            place = place_name(self.outside_place)
            shortfalls.append(f"may leave the stock by {self.outside:.4f} mm at {place}")
        return tuple(shortfalls)


HALVES = (
    np.array(
        [
            [[8, 0, 0, 0], [4, 4, 0, 0], [2, 4, 2, 0], [1, 3, 3, 1]],
            [[1, 3, 3, 1], [0, 2, 4, 2], [0, 0, 4, 4], [0, 0, 0, 8]],
        ]
    )
    / 8
)
"""Two 4 x 4 matrices that lead the control points of a cubic Bezier curve to those of its first and second
half (de Casteljau's algorithm at 1/2)."""

CORNERS = [0, 3, 12, 15]
"""Control points of a net at the corners of its patch."""


def certifiable(surface: TSpline) -> bool:
    """Whether it is a closed row-structured T-spline with poles and weights of one."""
    return isinstance(surface.tmesh, RowTMesh) and surface.poles == (True, True) and bool((surface.weights == 1).all())


def bezier_nets(surface: TSpline) -> Float[ndarray, "e 16 3"]:
    """Bezier control points of every element, s fastest.

    Raises ValueError for a surface that is not `certifiable`.
    """
    if not certifiable(surface):
        raise ValueError(
            "certificates are for row-structured T-splines that are closed, with two poles, and have weights of one"
        )
    return np.ascontiguousarray(surface.patches[:, :, :3])


def quarter_nets(nets: Float[ndarray, "e 16 3"]) -> Float[ndarray, "f 16 3"]:
    """The nets of the four quarters of every patch."""
    quarters = np.einsum("aik,bjl,nklx->nabijx", HALVES, HALVES, nets.reshape(-1, 4, 4, 3))
    return np.ascontiguousarray(quarters.reshape(-1, 16, 3))


MARGIN = 1e-4
"""A depth bound is good enough up to so many mm over the limit of the cut."""

SEEDS = 5
"""Points each way on an element that searches for footpoints start from."""

LONGEST_STEPS = (0.02, 0.05)
"""Longest step of a search for a footpoint in s and in t, shares of the domain."""


def bound_depth(
    level: TSpline, other: TSpline, limit: float
) -> tuple[float, Float[ndarray, "3"], Float[ndarray, "k 2"], int]:
    """How far points of a level are at most from another one over the same T-mesh, mm, good enough where it is within
    `limit`; where the bound is largest; parameters (s, t) of pieces that may be deeper than allowed; and how many were
    bounded."""
    boxes = level.elements().boxes
    corners = np.ascontiguousarray(boxes[:, [[0, 2], [1, 2], [0, 3], [1, 3]]])
    distance, deepest, too_deep, pieces = depth_bound(
        bezier_nets(level),
        corners,
        on=depth_target(other),
        goal=limit + MARGIN,
        alarm=limit + DEPTH_TOLERANCE,
        accuracy=ACCURACY,
        smallest=SMALLEST,
    )
    place = level.positions(*_parameters(boxes, deepest[None]).T)[0]
    return distance + ROUNDING, place, _parameters(boxes, too_deep), pieces


def depth_target(surface: TSpline) -> DepthTarget:
    """The surface that depths are measured to, with points on it that searches for footpoints start from."""
    elements = surface.elements()
    domain = surface.domain
    nets = bezier_nets(surface)

    share = (np.arange(SEEDS) + 0.5) / SEEDS
    low = elements.boxes[:, ::2, None]
    size = np.diff(elements.boxes.reshape(-1, 2, 2), axis=2)
    s = low[:, 0] + size[:, 0] * np.tile(share, SEEDS)
    t = low[:, 1] + size[:, 1] * np.repeat(share, SEEDS)
    points = surface.positions(s.ravel(), t.ravel()).reshape(*s.shape, 3)

    return DepthTarget(
        patches=surface.patches,
        boxes=elements.boxes,
        strips=elements.strips,
        domain=domain,
        period=np.array(elements.period),
        poles=np.array(surface.poles),
        limit=np.array(LONGEST_STEPS) * np.diff(domain)[:, 0],
        seeds=np.dstack([s, t, points]),
        hulls=np.hstack([nets.min(1), nets.max(1)]),
    )


def _parameters(boxes: Float[ndarray, "e 4"], pieces: Float[ndarray, "k 3"]) -> Float[ndarray, "k 2"]:
    """(s, t) of the middles of pieces, each given by its element and the parameters (u, v) on it."""
    box = boxes[pieces[:, 0].astype(int)]
    return np.column_stack([box[:, i] + pieces[:, 1 + i // 2] * (box[:, i + 1] - box[:, i]) for i in (0, 2)])


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
        around[:, i : SAMPLES - 1 + i, j : SAMPLES - 1 + j].reshape(-1, 3) for i, j in ((0, 0), (0, 1), (1, 1), (1, 0))
    )
    winding = (_solid_angles(a, b, c).sum() + _solid_angles(a, c, d).sum()) / (4 * np.pi)
    return bool(abs(winding - 1) < WINDING_TOLERANCE)


def _solid_angles(a: Float[ndarray, "n 3"], b: Float[ndarray, "n 3"], c: Float[ndarray, "n 3"]) -> Float[ndarray, "n"]:
    """Signed solid angles (steradians) of triangles with corners a, b, c seen from the origin (van Oosterom &
    Strackee 1983)."""
    p, q, r = lengths(a), lengths(b), lengths(c)
    return 2 * np.arctan2(dots(a, np.cross(b, c)), p * q * r + dots(a, b) * r + dots(b, c) * p + dots(c, a) * q)


def bound_outside(nets: Float[ndarray, "e 16 3"], stock: Stock) -> tuple[float, Float[ndarray, "3"]]:
    """How far patches leave the stock at most (mm, negative: inside) and about where; better than zero only
    where zero is in doubt."""
    worst = reached = -np.inf
    place = np.zeros(3)
    for halving in range(MAX_HALVINGS):
        values = stock.signed_distance(nets.reshape(-1, 3)).reshape(-1, 16)
        bounds = values.max(1)
        reached = max(reached, float(values[:, CORNERS].max()))
        doubtful = (bounds > max(0.0, reached + ACCURACY)) & (halving < MAX_HALVINGS - 1)
        patch = np.argmax(np.where(doubtful, -np.inf, bounds))
        if not doubtful[patch] and bounds[patch] > worst:
            worst = float(bounds[patch])
            place = nets[patch, np.argmax(values[patch])]
        if not doubtful.any():
            break
        nets = quarter_nets(nets[doubtful])
    return worst + ROUNDING, place


def bound_inside(nets: Float[ndarray, "e 16 3"], stock: Stock, limit: float) -> tuple[float, Float[ndarray, "3"]]:
    """How far inside the stock points of patches are at most (mm) and about where; better than `limit` only
    where that is in doubt."""
    worst = reached = 0.0
    place = np.zeros(3)
    for halving in range(MAX_HALVINGS):
        middles = nets.mean(1)
        corners = nets[:, CORNERS]
        distance, out = stock.distances_and_normals(middles)
        bounds = -distance - np.einsum("nkx,nx->nk", nets - middles[:, None], out).min(1)
        reached = max(reached, float(-stock.signed_distance(corners.reshape(-1, 3)).min()))
        doubtful = (bounds > max(limit, reached + ACCURACY)) & (halving < MAX_HALVINGS - 1)
        patch = np.argmax(np.where(doubtful, -np.inf, bounds))
        if not doubtful[patch] and bounds[patch] > worst:
            worst = float(bounds[patch])
            place = middles[patch]
        if not doubtful.any():
            break
        nets = quarter_nets(nets[doubtful])
    return worst + ROUNDING, place


CHORD_TOLERANCES = (0.02, 0.005, 0.001)
"""Chord tolerances (mm) of the stock's mesh, tried in this order until the last cut is certified."""

BOUNDED_FIRST = 50
"""So many faces of the stock's mesh, those farthest from the level, are bounded first."""

SAGITTA_PARTS = 5
"""A bound of the faces is good enough up to the sagitta divided by this; the whole sagitta is added to it."""


def bound_mesh_depth(
    target: DepthTarget, faces: Float[ndarray, "f 3 3"], sagitta: float
) -> tuple[float, Float[ndarray, "3"], int]:
    """How far the stock's surface, at most `sagitta` mm over these faces, is from a level at most, mm; about
    where; how many pieces were bounded."""
    middles = faces.mean(1)
    seeds = target.seeds.reshape(-1, 5)
    near, nearest_seed = (np.asarray(values) for values in cKDTree(seeds[:, 2:]).query(middles))
    order = np.argsort(-near, kind="stable")
    reach = near + np.linalg.norm(faces - middles[:, None], axis=2).max(1)
    depth = 0.0
    place = middles[order[0]]
    pieces = 0
    for part in (order[:BOUNDED_FIRST], order[BOUNDED_FIRST:]):  # the bound of the first few suffices for most others
        part = part[reach[part] > depth]
        starts = np.repeat(seeds[nearest_seed[part], None, :2], 4, axis=1)
        bound, (face, _, _), _, count = depth_bound(
            triangle_nets(faces[part]),
            starts,
            on=target,
            goal=depth,
            alarm=np.inf,
            accuracy=sagitta / SAGITTA_PARTS,
            smallest=SMALLEST,
        )
        pieces += count
        if bound > depth:
            depth = bound
            place = middles[part[int(face)]]
    return depth + sagitta + ROUNDING, place, pieces


def faces_of_stock(stock: Stock, chord_tolerance: float) -> tuple[Float[ndarray, "f 3 3"], float]:
    """The corners of the faces of the stock's mesh, and how far inside the stock they are at most, mm.

    The signed distance is convex: over a face it lies above its tangent plane in the middle of the face.
    """
    mesh = stock.mesh(chord_tolerance)
    faces = mesh.vertices[mesh.faces]
    middles = faces.mean(1)
    distance, out = stock.distances_and_normals(middles)
    slope = np.einsum("fcx,fx->fc", faces - middles[:, None], out).min(1)
    return faces, max(0.0, float(-(distance + slope).min()))


def triangle_nets(faces: Float[ndarray, "f 3 3"]) -> Float[ndarray, "f 16 3"]:
    """Bicubic nets of triangles, one side of which is a point."""
    third = np.arange(4) / 3
    base = faces[:, :1] + third[:, None] * (faces[:, 1:2] - faces[:, :1])
    rows = base[:, None] + third[:, None, None] * (faces[:, 2][:, None, None] - base[:, None])
    return np.ascontiguousarray(rows.reshape(-1, 16, 3))


def certify(
    surfaces: Sequence[TSpline], stock: Stock, limits: Sequence[float], *, progress: Progress = silent
) -> tuple[Certificate, ...]:
    """One certificate for each cut: between levels 0 to K - 1 (`surfaces`), and from the last of them to the
    stock; limits in mm.

    Raises ValueError for surfaces that are not closed row-structured T-splines with poles and weights of one.
    """
    if len(limits) != len(surfaces):
        raise ValueError(f"{len(surfaces)} levels and the stock need as many limits, not {len(limits)}")
    certificates = []
    for k, (inner, limit) in enumerate(zip(surfaces, limits), start=1):
        report(progress, k / len(surfaces), f"certifying level {k}")
        if k < len(surfaces):
            certificates.append(certify_cut(inner, surfaces[k], stock, limit))
        else:
            certificates.append(certify_last_cut(inner, stock, limit))
    return tuple(certificates)


def certify_cut(inner: TSpline, outer: TSpline, stock: Stock, limit: float) -> Certificate:
    """The certificate of the cut from level k (`outer`) down to level k - 1 (`inner`), at most `limit` mm
    deep."""
    nets = bezier_nets(outer)
    depth, depth_place, outer_deep, outer_pieces = bound_depth(outer, inner, limit)
    reverse_depth, reverse_place, inner_deep, inner_pieces = bound_depth(inner, outer, limit)
    nesting, nesting_place = bound_nesting(inner, nets)
    outside, outside_place = bound_outside(nets, stock)
    return Certificate(
        depth=max(depth, reverse_depth),
        nesting=nesting,
        outside=outside,
        depth_place=reverse_place if reverse_depth > depth else depth_place,
        nesting_place=nesting_place,
        outside_place=outside_place,
        too_deep=np.vstack([outer_deep, inner_deep]),
        pieces=outer_pieces + inner_pieces,
    )


def certify_last_cut(inner: TSpline, stock: Stock, limit: float) -> Certificate:
    """The certificate of the last cut, from the stock down to level K - 1 (`inner`), at most `limit` mm
    deep."""
    nets = bezier_nets(inner)
    target = depth_target(inner)
    for chord_tolerance in CHORD_TOLERANCES:
        stock_depth, stock_place, pieces = bound_mesh_depth(target, *faces_of_stock(stock, chord_tolerance))
        if stock_depth <= limit + DEPTH_TOLERANCE:
            break
    inside, inside_place = bound_inside(nets, stock, limit)
    outside, outside_place = bound_outside(nets, stock)
    depth_place = inside_place if inside > stock_depth else stock_place
    return Certificate(
        depth=max(stock_depth, inside),
        nesting=-outside,
        outside=0.0,
        depth_place=depth_place,
        nesting_place=outside_place,
        outside_place=depth_place,
        too_deep=np.empty((0, 2)),
        pieces=pieces,
    )
