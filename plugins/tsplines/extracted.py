"""Surfaces that are known by their Bezier elements only (.iga): extraordinary points, T-junctions and any degree.

The elements share no parameters, so triangles of them are joined where they meet in space. Corners at one place are one
vertex; a side is cut where corners of other elements lie on it; what two elements have between the same two
vertices is one piece with the same points in both. Every element is triangulated (Delaunay) in its own square
from its pieces and a grid, made finer where the chord tolerance is missed.
"""

from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Never

import numpy as np
from bonecam_plugins.tsplines.any_degree import ElementsOfDegree
from bonecam_plugins.tsplines.tmesh import outward
from jaxtyping import Bool, Float, Int, Int64
from numpy import ndarray
from scipy.spatial import Delaunay, cKDTree

from bonecam.arrays import dots
from bonecam.errors import SurfaceError
from bonecam.kernels.triangles import triangle_distances
from bonecam.surface import Elements, Tessellation, TSpline, checked_mesh

CUBIC = 16
"""Bernstein coefficients of a function on a bicubic element."""

MARGIN = 0.9
"""Share of the tolerance is kept at the measured places: between them the surface may lie a little farther off."""


@dataclass(frozen=True, eq=False)
class ExtractedTMesh:
    """`size` functions, of which functions[starts[e]:starts[e+1]] live on element e with Bernstein
    coefficients (k, c), s fastest.

    The elements share no chart, so each has a parameter square of its own: element e is [2 e, 2 e + 1] x [0, 1].
    """

    size: int
    starts: Int64[ndarray, " e1"]
    functions: Int64[ndarray, " k"]
    coefficients: Float[ndarray, "k c"]

    poles = (False, False)
    """There is no common direction that could have poles."""

    @cached_property
    def elements(self) -> Elements:
        """The Bezier elements, side by side."""
        low = 2.0 * np.arange(len(self.starts) - 1)
        boxes = np.column_stack([low, low + 1, np.zeros_like(low), np.ones_like(low)])
        kind = Elements if self.coefficients.shape[1] == CUBIC else ElementsOfDegree
        return kind(boxes, self.starts, self.functions, self.coefficients)

    def refine(self, *_: object) -> Never:
        """Raises SurfaceError: what has no T-mesh cannot be refined."""
        raise SurfaceError(
            "Bezier elements without a T-mesh (.iga) cannot be refined: read the surface from a .tsm or .tspline file"
        )

    def tessellate(
        self,
        surface: TSpline["ExtractedTMesh"],
        chord_tolerance: float,
        angle_tolerance: float | None,
        most_vertices: int,
    ) -> Tessellation:
        """The surface over these elements as triangles, as `TSpline.tessellate` wants them."""
        parameters, points, faces, worst = element_mesh(
            surface, MARGIN * chord_tolerance, angle_tolerance, most_vertices
        )
        return outward(Tessellation(checked_mesh(parameters, points, faces), parameters, worst))


SAME = 1e-7
"""Share of the size: corners nearer to each other are one."""


LOOKED = 64
"""Places on a side where a corner is looked for."""


SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


@dataclass(frozen=True, eq=False)
class Piece:
    """A part of a side: the side, its ends there, and which curve between two vertices it is."""

    side: int
    start: float
    end: float
    key: tuple[int, int, int]


@dataclass(eq=False)
class SideVertices:
    """Vertices in the making; `runs` holds those of every piece, from its lower to its higher vertex."""

    surface: TSpline
    parameters: list[ndarray] = field(default_factory=list)
    points: list[ndarray] = field(default_factory=list)
    runs: dict[tuple[int, int, int], ndarray] = field(default_factory=dict)
    count: int = 0
    gap: float = 0.0

    def positions(self, element: int, uv: Float[ndarray, "n 2"]) -> Float[ndarray, "n 3"]:
        """Points of one element at places in its square."""
        elements = self.surface.elements()
        s, t = self._parameters(element, uv).T
        which = np.full(len(uv), element, dtype=np.int32)
        points: ndarray = elements.derivatives(self.surface.patches, which, s, t, 0)[0]
        return points

    def normals(self, element: int, uv: Float[ndarray, "n 2"]) -> Float[ndarray, "n 3"]:
        """Unit normals of one element at places in its square; 0 where it has none."""
        elements = self.surface.elements()
        s, t = self._parameters(element, uv).T
        _, Ss, St = elements.derivatives(self.surface.patches, np.full(len(uv), element, dtype=np.int32), s, t, 1)
        normals = np.cross(Ss, St)
        return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(float).tiny)

    def _parameters(self, element: int, uv: Float[ndarray, "n 2"]) -> Float[ndarray, "n 2"]:
        box = self.surface.elements().boxes[element]
        return box[[0, 2]] + uv * (box[[1, 3]] - box[[0, 2]])

    def added(self, element: int, uv: Float[ndarray, "n 2"], places: Float[ndarray, "n 3"]) -> Int[ndarray, " n"]:
        """Numbers of new vertices."""
        self.parameters.append(self._parameters(element, uv))
        self.points.append(places)
        self.count += len(uv)
        return np.arange(self.count - len(uv), self.count)


def _merge_points(points: Float[ndarray, "n 3"], same: float) -> Int[ndarray, " n"]:
    """Numbers of places, 0, 1, ...: points nearer than `same` share one."""
    first = np.arange(len(points))
    for a, b in sorted(cKDTree(points).query_pairs(same)):
        first[b] = min(first[b], first[a])
    return np.unique(first, return_inverse=True)[1]


def along_side(side: int, x: Float[ndarray, " n"]) -> Float[ndarray, "n 2"]:
    """Places on a side of the square."""
    return SQUARE[side] + x[:, None] * (SQUARE[(side + 1) % 4] - SQUARE[side])


def _corners_on(
    net: SideVertices, e: int, side: int, points: ndarray, tree: cKDTree, ends: set[int], same: float
) -> list[tuple[float, int]]:
    """Where other elements' corners lie inside a side, in order."""
    x = np.linspace(0, 1, LOOKED + 1)
    curve = net.positions(e, along_side(side, x))
    reach = float(np.linalg.norm(np.diff(curve, axis=0), axis=1).max())
    near = {int(k) for hits in tree.query_ball_point(curve, reach) for k in hits} - ends
    corners = []
    for k in sorted(near):
        here = float(x[np.argmin(np.linalg.norm(curve - points[k], axis=1))])
        low, high = max(here - 1 / LOOKED, 0.0), min(here + 1 / LOOKED, 1.0)
        while high - low > 1e-12:  # the nearest place between, by thirds
            thirds = np.array([(2 * low + high) / 3, (low + 2 * high) / 3])
            away = np.linalg.norm(net.positions(e, along_side(side, thirds)) - points[k], axis=1)
            low, high = (low, thirds[1]) if away[0] < away[1] else (thirds[0], high)
        if (
            np.linalg.norm(net.positions(e, along_side(side, np.array([low])))[0] - points[k]) <= same
            and 1e-9 < low < 1 - 1e-9
        ):
            corners.append((low, k))
    return sorted(corners)


FINEST = 256
"""Cells each way in an element."""

SLOWEST = 64
"""What is so many times farther than the tolerance after all halvings that are left, a quarter each, is not
reached."""

MIDDLES = np.array([[0.5, 0.5, 0.0], [0.0, 0.5, 0.5], [0.5, 0.0, 0.5], [1 / 3, 1 / 3, 1 / 3]])


def element_mesh(
    surface: TSpline, tolerance: float, angle: float | None, most_vertices: int
) -> tuple[ndarray, ndarray, ndarray, float]:
    """Parameters and points of the vertices, faces, and the largest measured distance (mm) of the surface
    from them. SurfaceError where the tolerance is not reached with `most_vertices` or so.

    With `angle` (rad) the normals along an edge of one element differ by no more, but for edges shorter than
    the tolerance. Neighbours whose common side differs by more than the tolerance are an error; smaller gaps
    count as distance.
    """
    # The pieces of the four sides of every element, counter-clockwise.
    same = SAME * float(np.ptp(surface.control_points, axis=0).max())
    net = SideVertices(surface)
    count = len(surface.elements().boxes)
    corners = np.concatenate([net.positions(e, SQUARE) for e in range(count)])
    vertex = _merge_points(corners, same)
    points = corners[np.unique(vertex, return_index=True)[1]]
    tree = cKDTree(points)
    raw = []
    middles = []
    for e in range(count):
        for side in range(4):
            a = vertex[4 * e + side]
            b = vertex[4 * e + (side + 1) % 4]
            if a == b and np.ptp(net.positions(e, along_side(side, np.linspace(0, 1, 9))), axis=0).max() <= same:
                continue  # a side that is one point
            cuts = [
                (0.0, int(a)),
                *_corners_on(net, e, side=side, points=points, tree=tree, ends={int(a), int(b)}, same=same),
                (1.0, int(b)),
            ]
            for (x, v), (y, w) in pairwise(cuts):
                raw.append((e, side, x, y, v, w))
                middles.append(net.positions(e, along_side(side, np.array([(x + y) / 2])))[0])
    curve = _merge_points(np.array(middles), 100 * same)
    pieces: list[list[Piece]] = [[] for _ in range(count)]
    for (e, side, x, y, v, w), number in zip(raw, curve):
        pieces[e].append(Piece(side, x, y, (v, w, int(number))))
    cells = np.ones(len(pieces), dtype=np.int64)
    while True:
        net, faces, worst, bent = _triangulate(surface, pieces, cells, tolerance, angle)
        if net.gap > tolerance:
            raise SurfaceError(
                f"elements part by {net.gap:.3g} mm along a common side: ask for a tolerance above that", gap=net.gap
            )
        missed = (worst > tolerance) | bent
        if not missed.any():
            return np.vstack(net.parameters), np.vstack(net.points), faces, max(net.gap, float(worst.max()))
        cells[missed] *= 2
        hopeless = (cells > FINEST) | (worst > tolerance * SLOWEST * (FINEST / cells) ** 2)
        if hopeless.any() or np.sum(cells**2) > most_vertices:
            number = int(np.argmax(hopeless if hopeless.any() else cells))
            asked = f"{tolerance:g} mm" if angle is None else f"{tolerance:g} mm and {angle:g} rad"
            raise SurfaceError(
                f"element {number} cannot be tessellated to {asked}: raise the tolerance", element=number
            )


def _triangulate(
    surface: TSpline, pieces: list[list[Piece]], cells: Int[ndarray, " e"], shortest: float, angle: float | None
) -> tuple[SideVertices, ndarray, Float[ndarray, " e"], Bool[ndarray, " e"]]:
    """The mesh with so many cells in each element, the largest distance in each, and whether an edge in it
    turns by more than the angle."""
    net = SideVertices(surface)
    fine: dict[tuple[int, int, int], int] = {}
    for e, around in enumerate(pieces):
        for piece in around:
            key = _unordered(piece)
            fine[key] = max(fine.get(key, 1), int(cells[e]))
    vertices: dict[int, int] = {}
    faces = []
    worst = np.zeros(len(pieces))
    bent = np.zeros(len(pieces), dtype=bool)
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

        # How far the surface is from the faces, at the middles of their sides and their own
        points = net.positions(e, uv)
        middles = (net.positions(e, np.einsum("c,fcd->fd", share, uv[cut])) for share in MIDDLES)
        worst[e] = np.max([triangle_distances(middle, points, cut.astype(np.int64)) for middle in middles])
        if angle is not None:
            normals = net.normals(e, uv)
            edges = np.vstack([cut[:, [0, 1]], cut[:, [1, 2]], cut[:, [2, 0]]])
            long = np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1) > shortest
            a, b = (normals[edges[long, k]] for k in (0, 1))
            known = a.any(axis=1) & b.any(axis=1)
            bent[e] = (dots(a, b)[known] < np.cos(angle)).any()
        faces.append(ids[cut])
    joined = np.vstack(faces)
    distinct = (joined != np.roll(joined, 1, axis=1)).all(axis=1)
    return net, joined[distinct], worst, bent


def _unordered(piece: Piece) -> tuple[int, int, int]:
    v, w, curve = piece.key
    return (min(v, w), max(v, w), curve)


def _loop(
    net: SideVertices, e: int, around: list[Piece], fine: dict, vertices: dict[int, int]
) -> tuple[ndarray, ndarray]:
    """Places in the square and vertices of an element's border, each corner once for each side that starts
    there."""
    uv = []
    ids = []
    for piece in around:
        key = _unordered(piece)
        n = fine[key]
        share = np.arange(n + 1) / n
        here = along_side(piece.side, piece.start + share * (piece.end - piece.start))
        points = net.positions(e, here)
        if key not in net.runs:
            for end, k in zip(piece.key[:2], (0, -1)):
                if end not in vertices:
                    vertices[end] = int(net.added(e, here[[k]], points[[k]])[0])
            run = np.concatenate(
                [[vertices[piece.key[0]]], net.added(e, here[1:-1], points[1:-1]), [vertices[piece.key[1]]]]
            )
            net.runs[key] = run if piece.key[0] == key[0] else run[::-1]
        run = net.runs[key] if piece.key[0] == key[0] else net.runs[key][::-1]
        net.gap = max(net.gap, float(np.linalg.norm(np.vstack(net.points)[run] - points, axis=1).max()))
        uv.append(here[:-1])
        ids.append(run[:-1])
    missing = [k for k in range(4) if not any(piece.side == k for piece in around)]
    sides = [piece.side for piece in around]
    for k in missing:  # a side that is one point: its first corner is the end of the side before
        if (k + 1) % 4 not in sides:
            raise SurfaceError(f"element {e}: two sides in succession are points: it has no area")
        uv.append(SQUARE[[k]])
        ids.append(np.array([ids[sides.index((k + 1) % 4)][0]]))
    return np.vstack(uv), np.concatenate(ids)
