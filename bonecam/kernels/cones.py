"""Cones of proven tool axes, compiled.

Tools are proven free for all axes of a cone at once by spheres about points of the cone's axis, one behind the other. A
sphere of radius D about the point of the axis at height u is empty. For every axis within the angle rho of the cone's
it holds the tool's disc of radius r at each height between

    u cos(rho) -+ sqrt(D^2 - (r + u sin(rho))^2);

with rho = 0 these are the spheres of one tool. Where the apex may lie anywhere within `growth` of its place, D is less
by that. A map of proven directions holds the triangles of a subdivided icosahedron whose cones are proven free, each by
itself or in a larger one that holds it. One that is not proven is divided into four, whose proofs begin where its own
ended.

In the chart of a direction w, where a direction is its point in the plane tangent to the unit sphere at w (gnomonic
projection), great circles are straight and cones ellipses. An ellipse that holds w and no point of an edge between
proven leaves and others holds proven directions alone. Sought is, over its centre c, turn and ratio, the most of

    2 ln s + ln(1 - |q|^2) - 3/2 ln(1 + |c|^2),

s^2 being its area over pi, q the place of w in it (0 at its centre, 1 at its rim): it is large, not far off w, and w
lies deep in it. A pattern search finds it, in two parameters at a time: the best lies against several edges.

What a section of the tool sweeps for all axes of an elliptic cone is held by a mesh. A `size` is start and end of the
section above the apex, its radius, both semi-angles of the cone, and the growth: how far the apex may be from its place
(mm, radians; `Sweep` of `planning.axes.cones` tells the bounds). The apex lies in the origin, the axis of the cone
along Z, its largest opening along X. Rows are written number by number: sums, products and copies of whole rows bring
numpy's broadcasting and the texts of its errors, which take longer to compile than all that is computed here.

Such a sweep is told from the triangles of a solid by planes. With n the outward normal of a plane tangent to the cone,
a point x of a section of radius r that begins at h, grown by g, has for its axis a, where h > g,

    out (n . x - r) + down (h - x . a) <= g,    out^2 + down^2 = 1,    out, down >= 0,

and for the highest x . a of an axis of the cone the left side is concave in x. So a triangle is clear where it is more
than g at all three corners, for one n, out and down; and where it is farther away than the section reaches. A tree of
boxes leaves out most triangles.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray

from bonecam.kernels import inner_njit, njit
from bonecam.kernels.closest_points import DEEPEST, squared_triangle_distance
from bonecam.kernels.distances import distance_bound
from bonecam.kernels.vectors import cross, dot, length, minus

SWEEPS = 2000
"""Times that all multipliers of a point are taken anew, at most: walls of a gap of 5 degrees take as many."""
STILL = 1e-7
"""The projection has come to rest when a sweep moves it by less, mm."""


@njit(cache=True, nogil=True)
def project_on_half_spaces(points: ndarray, normals: ndarray, offsets: ndarray, farthest: float) -> ndarray:
    """The place nearest to each point (n, 3) with normals (n, k, 3) . x >= offsets (n, k); the normals have unit length
    (Hildreth 1957: ascent along one multiplier at a time).

    A half-space whose offset is minus infinity counts for nothing. NaN where the place would be `farthest` or more
    away: the half-spaces have nothing in common.
    """
    projections = points.copy()
    multipliers = np.empty(normals.shape[1])
    for i in range(len(points)):
        x, y, z = points[i]
        multipliers[:] = 0.0
        for _ in range(SWEEPS):
            moved = 0.0
            for k in range(normals.shape[1]):
                a, b, c = normals[i, k]
                lacking = offsets[i, k] - (a * x + b * y + c * z)
                change = max(lacking, -multipliers[k])
                if change != 0.0:
                    multipliers[k] += change
                    x, y, z = x + change * a, y + change * b, z + change * c
                    moved = max(moved, abs(change))
            far = (x - points[i, 0]) ** 2 + (y - points[i, 1]) ** 2 + (z - points[i, 2]) ** 2
            if far >= farthest * farthest:
                x, y, z = np.nan, np.nan, np.nan
            if not moved > STILL or not far < farthest * farthest:
                break
        projections[i, 0], projections[i, 1], projections[i, 2] = x, y, z
    return projections


LOOK_AHEAD = (4.0, 1.5, 0.5, 0.0)
"""How far above the proven height spheres are tried, in radii of the section."""
MIN_RISE = 0.01
"""A sphere that raises the proven height by less (mm) proves nothing."""
REJECTED, OPEN, PROVEN = 0, 1, 2
"""Of a cone: every axis in it meets something (as the grids have it), nothing is known, no axis meets anything."""


class Obstacles(NamedTuple):
    """What a tool stays out of. `sections` (s, 9) of the tool from the spindle down: start and end (mm above the ball's
    centre), radius (mm), 1 for the level or 0 for the material, what the solid may reach out of its grids by (mm),
    the first and behind the last of its `columns` (m, 5): radius, top, bottom, x and y (mm), and the first and behind
    the last of its rows in `cells`, which with `values` are those of all Grids."""

    sections: ndarray
    columns: ndarray
    cells: ndarray
    values: ndarray


class Apexes(NamedTuple):
    """Where tools pivot: `places` (k, 3) of ball centres, how far from there they may be (`growth`, mm), and what is
    known of the balls near their contacts: at each of them a ball that is larger by `room` (mm) touches the contact too
    and is empty; contact normals are within `spread` (radians) of `normals`."""

    places: ndarray
    growth: ndarray
    normals: ndarray
    spread: ndarray
    room: ndarray


@inner_njit()
def _distance(o: Obstacles, s: int, x: float, y: float, z: float) -> float:
    """A lower bound of the distance of a point to what section s stays out of, mm."""
    first, end = int(o.sections[s, 7]), int(o.sections[s, 8])
    d = distance_bound(o.cells, o.values, first, end, x, y, z) - o.sections[s, 4]
    for c in range(int(o.sections[s, 5]), int(o.sections[s, 6])):
        up = max(z - o.columns[c, 1], o.columns[c, 2] - z)
        if up >= d:
            continue
        dx, dy = x - o.columns[c, 3], y - o.columns[c, 4]
        out = np.sqrt(dx * dx + dy * dy) - o.columns[c, 0]
        if out > 0 and up > 0:
            d = min(d, np.sqrt(out * out + up * up))
        else:
            d = min(d, max(out, up))
    return d


@inner_njit()
def prove(
    o: Obstacles, p: Apexes, k: int, a: ndarray, angle: float, first: int, proven: float
) -> tuple[int, int, float]:
    """PROVEN where the tool at apex k is free for all axes within `angle` of the unit vector a, REJECTED or OPEN; and
    how far it is proven: the section, and the height in it. What lies before section `first` and the height `proven`
    in that one is known to be free."""
    sine = np.sin(angle)
    cosine = np.cos(angle)
    chord = 2 * np.sin(angle / 2)
    x, y, z = p.places[k, 0], p.places[k, 1], p.places[k, 2]
    for s in range(first, len(o.sections)):
        up, end, r = o.sections[s, 0], o.sections[s, 1], o.sections[s, 2]
        begins = up
        if o.sections[s, 3] > 0:
            n = p.normals[k]
            lean = np.arccos(min(max(dot(a, n), -1.0), 1.0)) + p.spread[k] + angle
            # balls along an axis that leans by this from the normal stay in the larger ball as long
            up = max(up, 2 * p.room[k] * np.cos(min(lean, np.pi / 2)))
            begins = max(begins, 2 * p.room[k])
        if s == first:
            up = max(up, proven)
        last = 0
        while up < end:
            raised = up
            met = False
            for i in range(len(LOOK_AHEAD)):
                ahead = (max(last - 1, 0) + i) % len(LOOK_AHEAD)
                u = up + LOOK_AHEAD[ahead] * r
                d = _distance(o, s, x + u * a[0], y + u * a[1], z + u * a[2]) - p.growth[k]
                side = r + u * sine
                if d > side:
                    half = np.sqrt(d * d - side * side)
                    if u * cosine - half <= up and u * cosine + half > up + MIN_RISE:
                        raised = u * cosine + half
                        last = ahead
                        break
                elif begins <= u <= end and d + chord * u < r:
                    met = True
            if raised == up:
                return (REJECTED if met else OPEN), s, up
            up = raised
    return PROVEN, len(o.sections), 0.0


class SphereTriangles(NamedTuple):
    """The triangles of a subdivided icosahedron on the unit sphere: unit `centres` (t, 3) and `caps` (t,), the angles
    (radians) of the cones about these that hold them, of all levels, coarsest first; level i from `starts[i]` up to
    `starts[i + 1]`. Triangle j of a level is divided into 4 j .. 4 j + 3 of the next. The last level are leaves."""

    centres: ndarray
    caps: ndarray
    starts: ndarray


class AxisLimits(NamedTuple):
    """What the axes of k nodes keep to, radians: polar angles from `least` to `largest` and to `above` (k,) for the
    table, angles up to `tilt` from `normals` (k, 3)."""

    least: float
    largest: float
    above: ndarray
    tilt: float
    normals: ndarray


@njit(cache=True, nogil=True)
def within_limits(limits: AxisLimits, directions: ndarray, band: float) -> ndarray:
    """Which of the unit vectors (l, 3) the axes of each node (k) may have, or miss a limit of by `band` (radians) at
    most: (k, l)."""
    polar = np.arccos(np.minimum(np.maximum(directions[:, 2], -1.0), 1.0))
    allowed = np.empty((len(limits.normals), len(directions)), dtype=np.bool_)
    near = np.cos(min(limits.tilt + band, np.pi))
    for k in range(len(allowed)):
        n = limits.normals[k]
        most = min(limits.largest, limits.above[k]) + band
        for i in range(len(directions)):
            allowed[k, i] = dot(directions[i], n) >= near and limits.least - band <= polar[i] <= most
    return allowed


@njit(cache=True, nogil=True)
def direction_maps(o: Obstacles, p: Apexes, starts: ndarray, asked: ndarray, triangles: SphereTriangles) -> ndarray:
    """For each node (k), which has the apexes from `starts[k]` up to `starts[k + 1]`, the leaves (l) that are proven
    free for all of these apexes; those that are not `asked` (k, l) need not be told."""
    last = len(triangles.starts) - 2
    proven = np.zeros(asked.shape, dtype=np.bool_)
    stack = np.empty((4 * len(triangles.starts) + 4, 2), dtype=np.int64)
    for k in range(len(starts) - 1):
        sections = np.zeros((last + 2, starts[k + 1] - starts[k]), dtype=np.int64)
        heights = np.zeros(sections.shape)
        for root in range(triangles.starts[1]):
            stack[0, 0], stack[0, 1] = 0, root
            height = 1
            while height:
                height -= 1
                level, i = stack[height, 0], stack[height, 1]
                size = 4 ** (last - level)
                wanted = False
                for leaf in range(i * size, (i + 1) * size):
                    wanted = wanted or asked[k, leaf]
                if not wanted:
                    continue
                t = triangles.starts[level] + i
                # how far this triangle is proven for each apex goes on from the larger one that holds it
                verdict = PROVEN
                for apex in range(starts[k + 1] - starts[k]):
                    proof, sections[level + 1, apex], heights[level + 1, apex] = prove(
                        o,
                        p,
                        starts[k] + apex,
                        triangles.centres[t],
                        triangles.caps[t],
                        sections[level, apex],
                        heights[level, apex],
                    )
                    verdict = min(verdict, proof)
                    if verdict == REJECTED:
                        break
                if verdict == PROVEN:
                    proven[k, i * size : (i + 1) * size] = True
                elif verdict == OPEN and level < last:
                    for child in range(4):
                        stack[height, 0], stack[height, 1] = level + 1, 4 * i + child
                        height += 1
    return proven


WIDEST = 1.7
"""No point of an ellipse is further off w than this, in the chart: the tangent of 59.5 degrees."""
LOWEST = 0.2
"""Edges that reach further off w than this cosine are beyond WIDEST."""
RAYS = 96
"""Directions about w in which the nearest edges are found: others lie behind these."""
FIRST_STEPS = (0.4, 0.4, 0.5, 0.35)
"""Of the search: of the centre along both semi-axes, as shares of these; turn (radians), logarithm of the ratio."""
HALVINGS = 4
"""Times that these are halved."""


class LeafMesh(NamedTuple):
    """The leaves of a subdivided icosahedron as a mesh: unit `vertices` (v, 3), `leaves` (l, 3), `edges` (e, 2) by
    vertices, and the leaves (e, 2) `beside` them."""

    vertices: ndarray
    leaves: ndarray
    edges: ndarray
    beside: ndarray


@inner_njit()
def _place_in(mesh: LeafMesh, centres: ndarray, proven: ndarray, w: ndarray) -> int:
    """Whether (-2) w lies in a proven leaf, else the proven leaf whose centre is nearest; -1 where there is none."""
    near, nearest = -1.0, -1
    close, closest = -1.0, -1
    for leaf in range(len(centres)):
        cosine = dot(centres[leaf], w)
        if proven[leaf] and cosine > near:
            near, nearest = cosine, leaf
        if cosine > close:
            close, closest = cosine, leaf
    if nearest != closest:
        return nearest
    for i in range(3):
        a, b = mesh.vertices[mesh.leaves[closest, i]], mesh.vertices[mesh.leaves[closest, (i + 1) % 3]]
        if dot(cross(a, b), w) < 0:
            return nearest
    return -2


@inner_njit()
def _reach(edges: ndarray, count: int, x: float, y: float, turn: float, ratio: float) -> float:
    """The s of the largest ellipse of this centre, turn and ratio that no edge enters."""
    cosine, sine = np.cos(turn), np.sin(turn)
    along, across = np.exp(-ratio), np.exp(ratio)
    least = max((WIDEST - np.hypot(x, y)) / np.exp(abs(ratio)), 0.0) ** 2
    for e in range(count):
        ax, ay, bx, by = edges[e, 0] - x, edges[e, 1] - y, edges[e, 2] - x, edges[e, 3] - y
        ax, ay = (cosine * ax + sine * ay) * along, (cosine * ay - sine * ax) * across
        bx, by = (cosine * bx + sine * by) * along, (cosine * by - sine * bx) * across
        dx, dy = bx - ax, by - ay
        part = min(max(-(ax * dx + ay * dy) / max(dx * dx + dy * dy, 1e-30), 0.0), 1.0)
        ax, ay = ax + part * dx, ay + part * dy
        least = min(least, ax * ax + ay * ay)
    return np.sqrt(least)


@inner_njit()
def _worth(edges: ndarray, count: int, at: ndarray) -> float:
    """What is to be most, of an ellipse `at` its centre, turn and logarithm of the ratio."""
    s = _reach(edges, count, at[0], at[1], at[2], at[3])
    cosine, sine = np.cos(at[2]), np.sin(at[2])
    along = (cosine * at[0] + sine * at[1]) * np.exp(-at[3])
    across = (cosine * at[1] - sine * at[0]) * np.exp(at[3])
    inside = s * s - along * along - across * across
    if not inside > 1e-12:
        return -np.inf
    return np.log(inside) - 1.5 * np.log(1 + at[0] ** 2 + at[1] ** 2)


@inner_njit()
def _seen(edges: ndarray, count: int) -> int:
    """Move the edges that are nearest to the origin in one of RAYS to the front; how many they are."""
    nearest = np.full(RAYS, np.inf)
    which = np.full(RAYS, -1)
    width = 2 * np.pi / RAYS
    for e in range(count):
        ax, ay, bx, by = edges[e, 0], edges[e, 1], edges[e, 2], edges[e, 3]
        cross = ax * by - ay * bx
        if cross < 0:
            ax, ay, bx, by, cross = bx, by, ax, ay, -cross
        begin, end = np.arctan2(ay, ax), np.arctan2(by, bx)
        if end < begin:
            end += 2 * np.pi
        for ray in range(int(np.ceil(begin / width)), int(np.floor(end / width)) + 1):
            cosine, sine = np.cos(ray * width), np.sin(ray * width)
            off = cross / max(cosine * (by - ay) - sine * (bx - ax), 1e-12)
            if off < nearest[ray % RAYS]:
                nearest[ray % RAYS], which[ray % RAYS] = off, e
    seen = np.zeros(count, dtype=np.bool_)
    for e in which:
        if e >= 0:
            seen[e] = True
    kept = 0
    for e in range(count):  # in rising order: none is overwritten before it is moved
        if seen[e]:
            for k in range(4):
                edges[kept, k], edges[e, k] = edges[e, k], edges[kept, k]
            kept += 1
    return kept


@inner_njit()
def _search(edges: ndarray, count: int, at: ndarray, free: int) -> float:
    """Improve an ellipse in its first `free` parameters, one or two at a time; what it is worth."""
    steps = np.array(FIRST_STEPS)
    move, moved = np.zeros((2, 4))
    best = _worth(edges, count, at)
    for _ in range(HALVINGS + 1):
        better = True
        while better:
            better = False
            s = _reach(edges, count, at[0], at[1], at[2], at[3])
            for k in range(4 * free * free):
                i, j = k // 4 // free, k // 4 % free
                if j < i or (j == i and k % 4 > 1):
                    continue
                move[:], move[i] = 0.0, steps[i] * (2 * (k % 2) - 1)
                if j > i:
                    move[j] = steps[j] * (2 * (k // 2 % 2) - 1)
                # the centre by shares of the semi-axes
                cosine, sine = np.cos(at[2]), np.sin(at[2])
                along, across = s * np.exp(at[3]) * move[0], s * np.exp(-at[3]) * move[1]
                moved[0] = at[0] + cosine * along - sine * across
                moved[1] = at[1] + sine * along + cosine * across
                moved[2], moved[3] = at[2] + move[2], at[3] + move[3]
                worth = _worth(edges, count, moved)
                if worth > best + 1e-3:
                    at[:] = moved
                    best = worth
                    better = True
                    s = _reach(edges, count, at[0], at[1], at[2], at[3])
        steps /= 2
    return best


@njit(cache=True, nogil=True)
def largest_ellipses(
    proven: ndarray, wanted: ndarray, mesh: LeafMesh, centres: ndarray, circular: bool
) -> tuple[ndarray, ndarray]:
    """For each map of proven leaves (k, l) the axes D and semi-diameters U and V (k, 3, 3) of a cone of proven
    directions about the unit vector `wanted` (k, 3), or about the nearest proven leaf; and whether there is one.
    `centres` (l, 3) are those of the leaves."""
    frames = np.zeros((len(wanted), 3, 3))
    has_cone = np.zeros(len(wanted), dtype=np.bool_)
    edges = np.empty((len(mesh.edges), 4))
    t1, side = np.empty((2, 3))
    for k in range(len(wanted)):
        leaf = _place_in(mesh, centres, proven[k], wanted[k])
        if leaf == -1:
            continue
        w = wanted[k] if leaf == -2 else centres[leaf]
        # two unit vectors across w, and each other
        smallest = 0
        for d in range(1, 3):
            if abs(w[d]) < abs(w[smallest]):
                smallest = d
        side[:] = 0.0
        side[smallest] = 1.0
        t1[0], t1[1], t1[2] = cross(w, side)
        size = length(t1)
        for d in range(3):
            t1[d] /= size
        t2 = cross(w, t1)

        # the edges between proven leaves and others in the chart of w
        count: Any = np.int64(0)  # a literal compiles what takes it twice
        for e in range(len(mesh.edges)):
            if proven[k, mesh.beside[e, 0]] == proven[k, mesh.beside[e, 1]]:
                continue
            a, b = mesh.vertices[mesh.edges[e, 0]], mesh.vertices[mesh.edges[e, 1]]
            za, zb = dot(a, w), dot(b, w)
            if za > LOWEST and zb > LOWEST:
                edges[count, 0], edges[count, 1] = dot(a, t1) / za, dot(a, t2) / za
                edges[count, 2], edges[count, 3] = dot(b, t1) / zb, dot(b, t2) / zb
                count += 1

        seen = _seen(edges, count)
        best = np.zeros(4)
        _search(edges, seen, best, 2 if circular else 4)
        s = _reach(edges, count, best[0], best[1], best[2], best[3])
        if not _worth(edges, count, best) > -np.inf:
            continue
        cosine, sine = np.cos(best[2]), np.sin(best[2])
        for d in range(3):
            frames[k, 0, d] = w[d] + best[0] * t1[d] + best[1] * t2[d]
            frames[k, 1, d] = s * np.exp(best[3]) * (cosine * t1[d] + sine * t2[d])
            frames[k, 2, d] = s * np.exp(-best[3]) * (cosine * t2[d] - sine * t1[d])
        has_cone[k] = True
    return frames, has_cone


ARC_STEP = np.radians(20.0)
"""Longest edge of those that stand for the spheres below and above, as an angle."""
LEAST_GROWTH = 1e-3
"""Growth is no less (mm), so that no face is without an area."""
RIM_STEPS = 16
"""Planes tangent to the cone for each side, of those that bound how high a point is seen."""
LEAST_ANGLE = np.radians(0.1)
"""No semi-angle is less: a cone is no plane, nor a line."""
TOUCHING = 3
"""Times that the upper facets are laid at least, each time nearer to the sphere that they stand for."""


@inner_njit()
def opening_of(size: ndarray) -> tuple[float, float]:
    """Tangents of the semi-angles."""
    return np.tan(max(size[3], LEAST_ANGLE)), np.tan(max(size[4], LEAST_ANGLE))


@inner_njit()
def _turn(first: float, second: float, number: float, sides: int) -> tuple[float, float]:
    """Cosine and sine of the turn about the axis of a side: somewhat denser where their normals turn faster."""
    even = 2 * np.pi * number / sides
    x, y = first**0.25 * np.cos(even), second**0.25 * np.sin(even)
    long = np.hypot(x, y)
    return x / long, y / long


@inner_njit()
def normals_of(first: float, second: float, sides: int, out: ndarray) -> None:
    """Outward unit normals of the sides."""
    for k in range(sides):
        c, s = _turn(first, second, float(k), sides)
        x, y, z = second * c, first * s, -first * second
        long = np.sqrt(x * x + y * y + z * z)
        out[k, 0], out[k, 1], out[k, 2] = x / long, y / long, z / long


@inner_njit()
def largest_product(rows: ndarray, point: ndarray) -> float:
    """The largest dot product of a row (n, 3) with a point."""
    most = -np.inf
    for k in range(len(rows)):
        most = max(most, dot(rows[k], point))
    return most


@inner_njit()
def _lean(direction: ndarray, share: float, length: float, out: ndarray) -> None:
    """A vector of a length that leans from Z by a share of the angle by which a unit vector does."""
    angle = np.arccos(min(max(direction[2], -1.0), 1.0))
    flat = length * np.sin(share * angle) / max(np.sin(angle), 1e-12)
    out[0], out[1], out[2] = flat * direction[0], flat * direction[1], length * np.cos(share * angle)


@njit(cache=True, nogil=True)
def edges_of(first: float, second: float, sides: int, wide: float, foot: ndarray, along: ndarray) -> None:
    """The edges between each side and the next: the point nearest to the apex, and the unit direction upward."""
    normals = np.empty((sides, 3))
    normals_of(first, second, sides, normals)
    for k in range(sides):
        m, n = normals[k], normals[(k + 1) % sides]
        share = wide / (1.0 + dot(m, n))
        edge = cross(m, n)
        long = length(edge) * np.sign(edge[2])
        for i in range(3):
            along[k, i] = edge[i] / long
            foot[k, i] = share * (m[i] + n[i])


@inner_njit()
def _nearest_of_triangle(a: ndarray, b: ndarray, c: ndarray) -> float:
    """The least distance of a triangle, whose corners are equally far from the origin, from there."""
    u, v = minus(b, a), minus(c, a)
    w = minus(v, u)
    uu, vv, ww = dot(u, u), dot(v, v), dot(w, w)
    most = max(uu, vv, ww)
    if 2 * most >= uu + vv + ww:  # obtuse: the middle of the longest edge is nearest, not that of the plane
        return np.sqrt(dot(a, a) - most / 4)
    n = cross(u, v)
    return abs(dot(n, a)) / length(n)


@inner_njit()
def _upper(top: float, foot: ndarray, along: ndarray) -> tuple[ndarray, float]:
    """The rings from the edges of the sides to the upper pole, and the height of the pole: their facets are nowhere
    nearer than `top`."""
    sides = len(foot)
    directions, pole = np.empty((sides, 3)), np.zeros(3)
    radius = top
    turn = 0
    while True:
        lowest = 1.0
        for k in range(sides):
            up = np.sqrt(radius * radius - dot(foot[k], foot[k]))
            for i in range(3):
                directions[k, i] = (foot[k, i] + up * along[k, i]) / radius
            lowest = min(lowest, directions[k, 2])
        count = 1 + int(np.arccos(lowest) / ARC_STEP)
        rings = np.empty((count, sides, 3))
        for k in range(count):
            for j in range(sides):
                _lean(directions[j], 1.0 - k / count, radius, rings[k, j])
        # the least distance of the facets between rings, and to the pole
        pole[2] = radius
        nearest = np.inf
        for k in range(count):
            for j in range(sides):
                a, b = rings[k, j], rings[k, (j + 1) % sides]
                if k == count - 1:
                    nearest = min(nearest, _nearest_of_triangle(pole, a, b))
                    continue
                c, d = rings[k + 1, (j + 1) % sides], rings[k + 1, j]
                nearest = min(nearest, _nearest_of_triangle(a, b, c), _nearest_of_triangle(a, c, d))
        turn += 1
        if turn >= TOUCHING and nearest >= top:
            return rings, radius
        radius *= 1e-6 + top / nearest


@inner_njit()
def _is_below(point: ndarray, bottom: float, around: ndarray, wide: float, normals: ndarray) -> bool:
    """Whether a point is nowhere above the `bottom` (0 or less) of a section, seen along directions `around` the cone,
    nor beyond one of the sides that are `wide` from the apex."""
    return largest_product(around, point) <= bottom + 1e-9 and largest_product(normals, point) <= wide + 1e-9


@inner_njit()
def _lower_end(bottom: float, foot: ndarray, along: ndarray, normals: ndarray) -> float:
    """How far along an edge between two sides its points are seen no higher than `bottom` (above 0) along axes of the
    cone: without what it has along the outward normal of a plane tangent to the cone a point is seen no lower."""
    end = bottom  # by the normal in the middle between those of both sides, which the foot lies on
    for k in range(len(normals)):
        at, slope = dot(normals[k], foot), dot(normals[k], along)
        square = 1.0 - slope * slope
        half = at * slope
        root = half * half - square * (dot(foot, foot) - at * at - bottom * bottom)
        if square > 0 and root >= 0:
            farther = (half + np.sqrt(root)) / square
            if at + slope * farther >= 0:
                end = max(end, farther)
    return end


@njit(cache=True, nogil=True)
def swept_vertices(size: ndarray, sides: int) -> ndarray:
    """Vertices of the closed mesh with so many sides that holds what is swept, in rings from below and then the lower
    and the upper pole, as `ring_faces` joins them; none where its sides meet before they come to where it ends below,
    as in wide cones whose apex may lie above the begin of the section."""
    first, second = opening_of(size)
    growth = max(size[5], LEAST_GROWTH)
    wide = size[2] + growth
    foot, along = np.empty((sides, 3)), np.empty((sides, 3))
    edges_of(first, second, sides, wide, foot, along)
    normals = np.empty((RIM_STEPS * sides, 3))
    normals_of(first, second, RIM_STEPS * sides, normals)
    # the edges of a pyramid that holds the cone: where none of them leads upward, no axis does
    between, around = np.empty_like(normals), np.empty_like(normals)
    edges_of(first, second, RIM_STEPS * sides, 0.0, between, around)

    bottom = size[0] - growth
    lowest = np.empty(sides)
    top = np.hypot(size[2], size[1]) + growth
    for j in range(sides):
        lowest[j] = np.inf
        if bottom > 0:
            lowest[j] = _lower_end(bottom, foot[j], along[j], normals[RIM_STEPS * j : RIM_STEPS * (j + 1)])
        else:
            for m in range(len(around)):
                slope = dot(along[j], around[m])
                if slope > 0:
                    lowest[j] = min(lowest[j], (bottom - dot(foot[j], around[m])) / slope)
        # of a wide and short section the sphere would meet the edge below where that begins, or nowhere
        above = max(lowest[j], 0.0) + LEAST_GROWTH
        top = max(top, np.sqrt(dot(foot[j], foot[j]) + above * above))
    pole = np.zeros(3)
    pole[2] = bottom if bottom > 0 else bottom / around[:, 2].min()
    ends = np.empty((sides, 3))
    for j in range(sides):
        for i in range(3):
            ends[j, i] = foot[j, i] + lowest[j] * along[j, i]
    if bottom <= 0:
        beside = np.ascontiguousarray(normals[::RIM_STEPS])
        below = _is_below(pole, bottom, around, wide, beside)
        for j in range(sides):
            below = below and _is_below(ends[j], bottom, around, wide, beside)
        if not below:
            return np.empty((0, 3))
    upper, top = _upper(top, foot, along)

    widest = np.arctan(max(first, second))
    arcs = 1 + int(widest / ARC_STEP) if bottom > 0 else 0
    count = arcs + 1 + len(upper)
    vertices = np.zeros((count * sides + 2, 3))
    middle = np.empty(3)
    for j in range(sides):
        # the rim between this side and the next
        cosine, sine = _turn(first, second, j + 0.5, sides)
        x, y = first * cosine, second * sine
        long = np.sqrt(x * x + y * y + 1.0)
        middle[0], middle[1], middle[2] = x / long, y / long, 1.0 / long
        for k in range(arcs):
            _lean(middle, (k + 1) / arcs, bottom, vertices[k * sides + j])
        for i in range(3):
            vertices[arcs * sides + j, i] = ends[j, i]
            for k in range(len(upper)):
                vertices[(arcs + 1 + k) * sides + j, i] = upper[k, j, i]
    vertices[count * sides, 2] = pole[2]
    vertices[count * sides + 1, 2] = top
    return vertices


PLANES = 12
"""So many planes about a solid are tried on each facet."""


@njit(cache=True, nogil=True)
def swept_hold(sizes: ndarray, sides: int, points: ndarray) -> ndarray:
    """Whether each point (n, 3) lies within the bounds that the mesh of its size (n, 6) with so many sides has."""
    held = np.zeros(len(points), np.bool_)
    normals = np.empty((RIM_STEPS * sides, 3))
    between, around = np.empty_like(normals), np.empty_like(normals)
    for k in range(len(points)):
        size, point = sizes[k], points[k]
        first, second = opening_of(size)
        growth = max(size[5], LEAST_GROWTH)
        away, bottom = length(point), size[0] - growth
        if away > np.hypot(size[2], size[1]) + growth or away < bottom:
            continue
        normals_of(first, second, RIM_STEPS * sides, normals)
        beyond = normals @ point
        if beyond[::RIM_STEPS].max() > size[2] + growth:
            continue
        if point[2] > 0 and np.hypot(point[0] / first, point[1] / second) <= point[2]:
            held[k] = True
        elif bottom > 0:
            held[k] = away * away - max(beyond.max(), 0.0) ** 2 >= bottom * bottom
        else:
            edges_of(first, second, RIM_STEPS * sides, 0.0, between, around)
            held[k] = (around @ point).max() >= bottom
    return held


@njit(cache=True, nogil=True)
def facets_below(
    vertices: ndarray, faces: ndarray, place: ndarray, turn: ndarray, directions: ndarray, supports: ndarray
) -> tuple[ndarray, ndarray]:
    """The vertices and faces of a mesh, turned (3, 3) to a place, that may touch a solid, which reaches to `supports`
    (d) along unit `directions` (d, 3): of the planes there, those that the place is highest above leave out what lies
    beyond them."""
    away = directions @ place - supports
    planes = np.argsort(-away)[:PLANES]
    beyond = np.empty((len(planes), len(vertices)), np.bool_)
    for p in range(len(planes)):
        seen = turn.T @ directions[planes[p]]
        for v in range(len(vertices)):
            beyond[p, v] = dot(seen, vertices[v]) + away[planes[p]] > 0
    number = np.full(len(vertices), -1)
    kept = np.empty_like(faces)
    count, used = 0, 0
    for face in faces:
        off = False
        for p in range(len(planes)):
            if beyond[p, face[0]] and beyond[p, face[1]] and beyond[p, face[2]]:
                off = True
                break
        if off:
            continue
        for i in range(3):
            if number[face[i]] < 0:
                number[face[i]] = used
                used += 1
            kept[count, i] = number[face[i]]
        count += 1
    corners = np.empty((used, 3))
    for v in range(len(vertices)):
        if number[v] >= 0:
            corners[number[v]] = vertices[v]
    return corners, kept[:count]


TILTS = ((0.75**0.5, 0.5), (0.5**0.5, 0.5**0.5), (0.5, 0.75**0.5))
"""`out` and `down` between a plane beside the sweep (1, 0) and one below it (0, 1)."""


class Bounds(NamedTuple):
    """Bounds of what a section sweeps, the apex in the origin and the cone's axis along Z: planes beside it have these
    `normals` and are `wide` away; it reaches as far as `top`; along an axis of the cone, which is in a circular one of
    an angle with this `sine` and `cosine`, each of its points is at `least` above the apex; `growth` is in all of
    these; mm."""

    normals: ndarray
    wide: float
    top: float
    least: float
    growth: float
    sine: float
    cosine: float


@inner_njit()
def _height(b: Bounds, x: float, y: float, z: float, beyond: float) -> float:
    """How high above the apex a point is at most, seen along axes of the cone; it is `beyond` the tangent planes (0
    inside all of them). Without what it has along the outward normal of one it is seen no lower."""
    out = np.sqrt(x * x + y * y)
    square = x * x + y * y + z * z
    across = np.sqrt(max(square - beyond * beyond, 0.0))
    return across if z * b.sine >= out * b.cosine else min(across, z * b.cosine + out * b.sine)


@inner_njit()
def _box_is_clear(b: Bounds, middle: ndarray, half: ndarray) -> bool:
    """Whether a box, turned into the frame of the sweep, is told: its middle, and its half edges (rows)."""
    radius = np.sqrt((half * half).sum())
    if length(middle) - radius > b.top:
        return True
    beyond = 0.0
    for j in range(len(b.normals)):
        least = dot(b.normals[j], middle)
        beyond = max(beyond, least)
        for i in range(3):
            least -= abs(dot(b.normals[j], half[i]))
        if least > b.wide:
            return True
    return _height(b, middle[0], middle[1], middle[2], beyond) + radius < b.least


@inner_njit()
def _triangle_is_clear(b: Bounds, corners: ndarray, beyond: ndarray) -> bool:
    """Whether a triangle (9), turned into the frame of the sweep, is told; `beyond` (3) is room for that."""
    beyond[:] = 0.0
    for j in range(len(b.normals)):
        x, y, z = b.normals[j, 0], b.normals[j, 1], b.normals[j, 2]
        lowest = np.inf
        for i in range(3):
            up = x * corners[3 * i] + y * corners[3 * i + 1] + z * corners[3 * i + 2]
            beyond[i] = max(beyond[i], up)
            lowest = min(lowest, up)
        if lowest > b.wide:
            return True
    highest = -np.inf
    for i in range(3):
        beyond[i] = _height(b, corners[3 * i], corners[3 * i + 1], corners[3 * i + 2], beyond[i])
        highest = max(highest, beyond[i])
    if highest < b.least or squared_triangle_distance((0.0, 0.0, 0.0), corners) > b.top * b.top:
        return True
    # else by a tilted plane, from the lower edge of the section
    for j in range(len(b.normals) if b.least > 0.0 else 0):
        x, y, z = b.normals[j, 0], b.normals[j, 1], b.normals[j, 2]
        for out, down in TILTS:
            lowest = np.inf
            for i in range(3):
                beside = x * corners[3 * i] + y * corners[3 * i + 1] + z * corners[3 * i + 2] - b.wide + b.growth
                lowest = min(lowest, out * beside + down * (b.least + b.growth - beyond[i]))
            if lowest > b.growth:
                return True
    return False


@njit(cache=True, nogil=True)
def swept_clear(
    sizes: ndarray, sides: int, places: ndarray, turns: ndarray, triangles: ndarray, boxes: ndarray
) -> ndarray:
    """Which of the sweeps (n, 6), with their apexes at `places` and turned (n, 3, 3), are told from all triangles of a
    tree by planes of so many sides."""
    clear = np.ones(len(sizes), np.bool_)
    count = len(triangles)
    leaves = (len(boxes) + 1) // 2
    stack = np.empty(DEEPEST, np.int64)
    middle = np.empty(3)
    half = np.empty((3, 3))
    corners, beyond = np.empty(9), np.empty(3)
    normals = np.empty((sides, 3))
    for k in range(len(sizes)):
        size = sizes[k]
        first, second = opening_of(size)
        growth = max(size[5], LEAST_GROWTH)
        normals_of(first, second, sides, normals)
        widest = np.arctan(max(first, second))
        reach = np.hypot(size[2], size[1]) + growth
        bounds = Bounds(normals, size[2] + growth, reach, size[0] - growth, growth, np.sin(widest), np.cos(widest))
        turn = turns[k]
        place = places[k]
        stack[0], height = 0, 1
        while height and clear[k]:
            height -= 1
            node = stack[height]
            middle[:] = 0.0
            for d in range(3):
                low, high = boxes[node, d] - place[d], boxes[node, 3 + d] - place[d]
                for i in range(3):
                    middle[i] += turn[d, i] * (low + high) / 2
                    half[d, i] = turn[d, i] * (high - low) / 2
            if boxes[node, 0] > boxes[node, 3] or _box_is_clear(bounds, middle, half):
                continue
            if node < leaves - 1:
                stack[height], stack[height + 1] = 2 * node + 1, 2 * node + 2
                height += 2
                continue
            leaf = node - leaves + 1
            for t in range(leaf * count // leaves, (leaf + 1) * count // leaves):
                corners[:] = 0.0
                for d in range(9):
                    off = triangles[t, d] - place[d % 3]
                    for i in range(3):
                        corners[d - d % 3 + i] += turn[d % 3, i] * off
                if not _triangle_is_clear(bounds, corners, beyond):
                    clear[k] = False
                    break
    return clear
