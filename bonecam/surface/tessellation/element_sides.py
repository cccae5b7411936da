"""The sides of Bezier elements without common parameters, divided where corners of other elements lie."""

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.spatial import cKDTree

from bonecam.surface.tmesh.surface import Surface

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

    surface: Surface
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
        _, Ss, St = elements.derivatives(
            self.surface.patches, np.full(len(uv), element, dtype=np.int32), s, t, 1
        )
        normals = np.cross(Ss, St)
        return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(float).tiny)

    def _parameters(self, element: int, uv: Float[ndarray, "n 2"]) -> Float[ndarray, "n 2"]:
        box = self.surface.elements().boxes[element]
        return box[[0, 2]] + uv * (box[[1, 3]] - box[[0, 2]])

    def added(
        self, element: int, uv: Float[ndarray, "n 2"], places: Float[ndarray, "n 3"]
    ) -> Int[ndarray, " n"]:
        """Numbers of new vertices."""
        self.parameters.append(self._parameters(element, uv))
        self.points.append(places)
        self.count += len(uv)
        return np.arange(self.count - len(uv), self.count)


def pieces_of_sides(surface: Surface, same: float) -> list[list[Piece]]:
    """The pieces of the four sides of every element, counter-clockwise."""
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
            if (
                a == b
                and np.ptp(net.positions(e, along_side(side, np.linspace(0, 1, 9))), axis=0).max() <= same
            ):
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
    return pieces


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
