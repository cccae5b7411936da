"""Triangles of a surface that is known by its Bezier elements only (.iga): extraordinary points, T-junctions
and any degree.

The elements share no parameters, so they are joined where they meet in space. Corners at one place are one
vertex; a side is cut where corners of other elements lie on it; what two elements have between the same two
vertices is one piece with the same points in both. Every element is triangulated (Delaunay) in its own square
from its pieces and a grid, made finer where the chord tolerance is missed.
"""

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.spatial import Delaunay, cKDTree

from bonecam.arrays import dots
from bonecam.errors import SurfaceError
from bonecam.kernels import triangles
from bonecam.surface.tmesh.surface import Surface

SAME = 1e-7  # of the size: corners nearer to each other are one
FINEST = 256  # cells each way in an element
SLOWEST = 64  # what is so many times farther than the tolerance after all halvings that are left, a quarter each, is not reached
LOOKED = 64  # places on a side where a corner is looked for
SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
MIDDLES = np.array([[0.5, 0.5, 0.0], [0.0, 0.5, 0.5], [0.5, 0.0, 0.5], [1 / 3, 1 / 3, 1 / 3]])


@dataclass(frozen=True, eq=False)
class Piece:
    """A part of a side: the side, its ends there, and which curve between two vertices it is."""

    side: int
    start: float
    end: float
    key: tuple[int, int, int]


@dataclass(eq=False)
class Net:
    """Vertices in the making; `runs` holds those of every piece, from its lower to its higher vertex."""

    surface: Surface
    parameters: list[ndarray] = field(default_factory=list)
    points: list[ndarray] = field(default_factory=list)
    runs: dict[tuple[int, int, int], ndarray] = field(default_factory=dict)
    count: int = 0
    gap: float = 0.0

    def positions(self, element: int, uv: Float[ndarray, "n 2"]) -> Float[ndarray, "n 3"]:
        """Points of one element at places in its square."""
        elements, (s, t) = self.surface.elements(), self._parameters(element, uv).T
        which = np.full(len(uv), element, dtype=np.int32)
        found: ndarray = elements.derivatives(self.surface.patches, which, s, t, 0)[0]
        return found

    def normals(self, element: int, uv: Float[ndarray, "n 2"]) -> Float[ndarray, "n 3"]:
        """Unit normals of one element at places in its square; 0 where it has none."""
        elements = self.surface.elements()
        s, t = self._parameters(element, uv).T
        _, Ss, St = elements.derivatives(
            self.surface.patches, np.full(len(uv), element, dtype=np.int32), s, t, 1
        )
        found = np.cross(Ss, St)
        return np.asarray(
            found / np.maximum(np.linalg.norm(found, axis=1, keepdims=True), np.finfo(float).tiny)
        )

    def _parameters(self, element: int, uv: Float[ndarray, "n 2"]) -> Float[ndarray, "n 2"]:
        box = self.surface.elements().boxes[element]
        return np.asarray(box[[0, 2]] + uv * (box[[1, 3]] - box[[0, 2]]))

    def added(
        self, element: int, uv: Float[ndarray, "n 2"], places: Float[ndarray, "n 3"]
    ) -> Int[ndarray, " n"]:
        """Numbers of new vertices."""
        self.parameters.append(self._parameters(element, uv))
        self.points.append(places)
        self.count += len(uv)
        return np.arange(self.count - len(uv), self.count)


def element_mesh(
    surface: Surface, tolerance: float, angle: float | None = None
) -> tuple[ndarray, ndarray, ndarray, float]:
    """Parameters and points of the vertices, faces, and the largest measured distance (mm) of the surface
    from them.

    With `angle` (rad) the normals along an edge of one element differ by no more, but for edges shorter than
    the tolerance. Neighbours whose common side differs by more than the tolerance are an error; smaller gaps
    count as distance.
    """
    pieces = _pieces(surface, SAME * float(np.ptp(surface.control_points, axis=0).max()))
    cells = np.ones(len(pieces), dtype=np.int64)
    while True:
        net, faces, worst, bent = _meshed(surface, pieces, cells, tolerance, angle)
        if net.gap > tolerance:
            raise SurfaceError(
                f"elements part by {net.gap:.3g} mm along a common side: ask for a tolerance above that",
                gap=net.gap,
            )
        missed = (worst > tolerance) | bent
        if not missed.any():
            return np.vstack(net.parameters), np.vstack(net.points), faces, max(net.gap, float(worst.max()))
        cells[missed] *= 2
        hopeless = (cells > FINEST) | (worst > tolerance * SLOWEST * (FINEST / cells) ** 2)
        if hopeless.any():
            number = int(np.argmax(hopeless))
            asked = f"{tolerance:g} mm" if angle is None else f"{tolerance:g} mm and {angle:g} rad"
            raise SurfaceError(
                f"element {number} cannot be tessellated to {asked}: raise the tolerance", element=number
            )


def _pieces(surface: Surface, same: float) -> list[list[Piece]]:
    """The pieces of the four sides of every element, counter-clockwise."""
    net, count = Net(surface), len(surface.elements().boxes)
    corners = np.concatenate([net.positions(e, SQUARE) for e in range(count)])
    vertex = _merged(corners, same)
    places = corners[np.unique(vertex, return_index=True)[1]]
    tree, raw, middles = cKDTree(places), [], []
    for e in range(count):
        for side in range(4):
            a, b = vertex[4 * e + side], vertex[4 * e + (side + 1) % 4]
            if a == b and np.ptp(net.positions(e, _along(side, np.linspace(0, 1, 9))), axis=0).max() <= same:
                continue  # a side that is one point
            cuts = [
                (0.0, int(a)),
                *_corners_on(net, e, side, places, tree, {int(a), int(b)}, same),
                (1.0, int(b)),
            ]
            for (x, v), (y, w) in pairwise(cuts):
                raw.append((e, side, x, y, v, w))
                middles.append(net.positions(e, _along(side, np.array([(x + y) / 2])))[0])
    curve = _merged(np.array(middles), 100 * same)
    found: list[list[Piece]] = [[] for _ in range(count)]
    for (e, side, x, y, v, w), number in zip(raw, curve):
        found[e].append(Piece(side, x, y, (v, w, int(number))))
    return found


def _merged(points: Float[ndarray, "n 3"], same: float) -> Int[ndarray, " n"]:
    """Numbers of places, 0, 1, ...: points nearer than `same` share one."""
    first = np.arange(len(points))
    for a, b in sorted(cKDTree(points).query_pairs(same)):
        first[b] = min(first[b], first[a])
    return np.asarray(np.unique(first, return_inverse=True)[1])


def _along(side: int, x: Float[ndarray, " n"]) -> Float[ndarray, "n 2"]:
    """Places on a side of the square."""
    return np.asarray(SQUARE[side] + x[:, None] * (SQUARE[(side + 1) % 4] - SQUARE[side]))


def _corners_on(
    net: Net, e: int, side: int, places: ndarray, tree: cKDTree, ends: set[int], same: float
) -> list[tuple[float, int]]:
    """Where other elements' corners lie inside a side, in order."""
    x = np.linspace(0, 1, LOOKED + 1)
    curve = net.positions(e, _along(side, x))
    reach = float(np.linalg.norm(np.diff(curve, axis=0), axis=1).max())
    near = {int(k) for hits in tree.query_ball_point(curve, reach) for k in hits} - ends
    found = []
    for k in sorted(near):
        here = float(x[np.argmin(np.linalg.norm(curve - places[k], axis=1))])
        low, high = max(here - 1 / LOOKED, 0.0), min(here + 1 / LOOKED, 1.0)
        while high - low > 1e-12:  # the nearest place between, by thirds
            thirds = np.array([(2 * low + high) / 3, (low + 2 * high) / 3])
            away = np.linalg.norm(net.positions(e, _along(side, thirds)) - places[k], axis=1)
            low, high = (low, thirds[1]) if away[0] < away[1] else (thirds[0], high)
        if (
            np.linalg.norm(net.positions(e, _along(side, np.array([low])))[0] - places[k]) <= same
            and 1e-9 < low < 1 - 1e-9
        ):
            found.append((low, k))
    return sorted(found)


def _meshed(
    surface: Surface,
    pieces: list[list[Piece]],
    cells: Int[ndarray, " e"],
    shortest: float,
    angle: float | None,
) -> tuple[Net, ndarray, Float[ndarray, " e"], Bool[ndarray, " e"]]:
    """The mesh with so many cells in each element, the largest distance in each, and whether an edge in it
    turns by more than the angle."""
    net = Net(surface)
    fine: dict[tuple[int, int, int], int] = {}
    for e, around in enumerate(pieces):
        for piece in around:
            key = _unordered(piece)
            fine[key] = max(fine.get(key, 1), int(cells[e]))
    vertices: dict[int, int] = {}
    faces, worst, bent = [], np.zeros(len(pieces)), np.zeros(len(pieces), dtype=bool)
    for e, around in enumerate(pieces):
        uv, ids = _loop(net, e, around, fine, vertices)
        inner = np.arange(1, cells[e]) / cells[e]
        grid = np.stack(np.meshgrid(inner, inner), axis=2).reshape(-1, 2)
        ids = np.concatenate([ids, net.added(e, grid, net.positions(e, grid))])
        uv = np.vstack([uv, grid])
        cut = Delaunay(uv).simplices
        one, two = uv[cut[:, 1]] - uv[cut[:, 0]], uv[cut[:, 2]] - uv[cut[:, 0]]
        area = one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]
        cut = np.where((area < 0)[:, None], cut[:, ::-1], cut)[np.abs(area) > 1e-12]
        worst[e] = _distance(net, e, uv, cut)
        bent[e] = angle is not None and _bent(net, e, uv, cut, shortest, angle)
        faces.append(ids[cut])
    joined = np.vstack(faces)
    distinct = (joined != np.roll(joined, 1, axis=1)).all(axis=1)
    return net, joined[distinct], worst, bent


def _unordered(piece: Piece) -> tuple[int, int, int]:
    v, w, curve = piece.key
    return (min(v, w), max(v, w), curve)


def _loop(
    net: Net, e: int, around: list[Piece], fine: dict, vertices: dict[int, int]
) -> tuple[ndarray, ndarray]:
    """Places in the square and vertices of an element's border, each corner once for each side that starts
    there."""
    uv, ids = [], []
    for piece in around:
        key, n = _unordered(piece), fine[_unordered(piece)]
        share = np.arange(n + 1) / n
        here = _along(piece.side, piece.start + share * (piece.end - piece.start))
        places = net.positions(e, here)
        if key not in net.runs:
            for end, k in zip(piece.key[:2], (0, -1)):
                if end not in vertices:
                    vertices[end] = int(net.added(e, here[[k]], places[[k]])[0])
            run = np.concatenate(
                [[vertices[piece.key[0]]], net.added(e, here[1:-1], places[1:-1]), [vertices[piece.key[1]]]]
            )
            net.runs[key] = run if piece.key[0] == key[0] else run[::-1]
        run = net.runs[key] if piece.key[0] == key[0] else net.runs[key][::-1]
        net.gap = max(net.gap, float(np.linalg.norm(np.vstack(net.points)[run] - places, axis=1).max()))
        uv.append(here[:-1])
        ids.append(run[:-1])
    missing = [k for k in range(4) if not any(piece.side == k for piece in around)]
    for k in missing:  # a side that is one point: its first corner is the end of the side before
        uv.append(SQUARE[[k]])
        ids.append(np.array([ids[[piece.side for piece in around].index((k + 1) % 4)][0]]))
    return np.vstack(uv), np.concatenate(ids)


def _distance(net: Net, e: int, uv: ndarray, cut: ndarray) -> float:
    """How far the surface is from the faces, at the middles of their sides and their own."""
    points, faces = net.positions(e, uv), cut.astype(np.int32)
    found = [
        triangles.triangle_distances(net.positions(e, np.einsum("c,fcd->fd", share, uv[cut])), points, faces)
        for share in MIDDLES
    ]
    return float(np.max(found))


def _bent(net: Net, e: int, uv: ndarray, cut: ndarray, shortest: float, angle: float) -> bool:
    """Whether the normals at the ends of an edge longer than `shortest` part by more than the angle."""
    edges = np.vstack([cut[:, [0, 1]], cut[:, [1, 2]], cut[:, [2, 0]]])
    points, normals = net.positions(e, uv), net.normals(e, uv)
    long = np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1) > shortest
    a, b = (normals[edges[long, k]] for k in (0, 1))
    known = a.any(axis=1) & b.any(axis=1)
    return bool((dots(a, b)[known] < np.cos(angle)).any())
