"""Cutting faces of a general T-mesh: new lines, edges and vertices on its index grid.

A cut runs through its face to the edges on either side and puts a vertex there; empty intervals beyond (the
lines of a clamped border) are cut as well, so that a border stays clamped. A row that passes all round a
closed direction is given four knots at least.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int64
from numpy import ndarray

from bonecam.surface.tmesh.general import TMesh, sight

FEWEST = 4
"""Knots of a row all round a closed direction."""


@dataclass(eq=False)
class Draft:
    """A T-mesh that is being changed: the fields of `TMesh`, with a grid of vertex numbers (`crossings`, -1:
    none) instead of the vertices. Axis 0 is s, axis 1 is t."""

    knots: list[Float[ndarray, " _"]]
    edges: list[Bool[ndarray, "_ _"]]
    inside: Bool[ndarray, "_ _"]
    crossings: Int64[ndarray, "_ _"]
    period: tuple[float, float]

    @classmethod
    def of(cls, tmesh: TMesh) -> "Draft":
        """A draft of the T-mesh as it is."""
        edges = [tmesh.along_s.copy(), tmesh.along_t.copy()]
        return cls([tmesh.s_lines, tmesh.t_lines], edges, tmesh.inside.copy(), tmesh.crossings.copy(), tmesh.period)

    def tmesh(self) -> TMesh:
        """The finished T-mesh; vertices keep their numbers."""
        self._fill_rings()
        i, j = np.nonzero(self.crossings >= 0)
        order = np.argsort(self.crossings[i, j])
        (s, t), (along_s, along_t) = self.knots, self.edges
        return TMesh(
            s_lines=s,
            t_lines=t,
            vertices=np.column_stack([i, j])[order],
            along_s=along_s,
            along_t=along_t,
            inside=self.inside,
            period=self.period,
        )

    def insert_lines(self, axis: int, knots: Float[ndarray, " k"]) -> Int64[ndarray, " _"]:
        """Add lines without edges at knots that no line has; the new number of every old line."""
        old = self.knots[axis]
        before = np.searchsorted(old, knots, side="right")
        self.knots[axis] = np.insert(old, before, knots)
        pieces = before - 1
        self.edges[axis] = np.insert(self.edges[axis], before, self.edges[axis].take(pieces, axis=axis), axis=axis)
        self.edges[1 - axis] = np.insert(self.edges[1 - axis], before, False, axis=axis)
        self.inside = np.insert(self.inside, before, self.inside.take(pieces, axis=axis), axis=axis)
        self.crossings = np.insert(self.crossings, before, -1, axis=axis)
        numbers = np.arange(len(old))
        return numbers + np.searchsorted(np.sort(before), numbers, side="right")

    def line_at(self, axis: int, knot: float) -> int:
        """The line with this knot, where several have it the one with most vertices."""
        lines = np.flatnonzero(self.knots[axis] == knot)
        vertices = (self.crossings >= 0).sum(axis=1 - axis)[lines]
        return int(lines[np.argmax(vertices)])

    def cut(self, axis: int, line: int, piece: int) -> None:
        """Draw an edge on `line` of `axis` (0: s = const) from its piece `piece` to the next edges, and on
        through empty intervals."""
        count = self.inside.shape[1 - axis]
        closed = bool(self.period[1 - axis])
        if not self._has_domain_beside(axis, line, piece):
            return
        self._add_edge(axis, line, piece)
        for sign in (-1, 1):
            k = piece
            walked = 0
            while walked < count:
                end = (k if sign < 0 else k + 1) % self.crossings.shape[1 - axis]
                stopped = self._join_edge(axis, line, end)
                k = k + sign
                walked += 1
                if closed:
                    k %= count
                elif not 0 <= k < count:
                    break
                if not self._has_domain_beside(axis, line, k) or (stopped and self._length(1 - axis, k) > 0):
                    break
                self._add_edge(axis, line, k)

    def add_vertex(self, axis: int, line: int, row: int) -> None:
        """A vertex where `line` of `axis` meets the other axis' line `row`, on an edge there or by cutting
        the face along `line`."""
        place = (line, row) if axis == 0 else (row, line)
        if self.crossings[place] >= 0:
            return
        if self._edge_passes(1 - axis, row, line) or self._edge_passes(axis, line, row):
            self._number_vertex(place)

            # Cut the empty intervals on both sides of a new vertex, so that all lines of a clamped border have it
            count = self.inside.shape[1 - axis]
            closed = bool(self.period[1 - axis])
            for piece in (row - 1, row):
                if (closed or 0 <= piece < count) and self._length(1 - axis, piece % count) == 0:
                    self.cut(axis, line, piece % count)
        else:
            self.cut(axis, line, row % self.inside.shape[1 - axis])

    def _fill_rings(self) -> None:
        """Draw each row that passes all round a closed direction with vertices but too few knots as a ring
        with more."""
        for axis, (hits, passes) in enumerate(sight(self.crossings >= 0, self.edges, self.inside, self.period)):
            vertex = self.crossings >= 0 if axis == 0 else self.crossings.T >= 0
            short = (hits.sum(axis=0) < FEWEST) & vertex.any(axis=0) & passes.all(axis=0)
            for row in np.flatnonzero(short).tolist() if self.period[axis] else ():
                self.edges[axis][(slice(None), row) if axis == 0 else (row, slice(None))] = True
                for line in (k * len(hits) // FEWEST for k in range(FEWEST)):
                    if not hits[line, row]:
                        self._number_vertex((line, row) if axis == 0 else (row, line))

    def _length(self, axis: int, piece: int) -> float:
        """The knot interval of a piece between two lines of `axis`."""
        knots = self.knots[axis]
        after = knots[piece + 1] if piece + 1 < len(knots) else knots[0] + self.period[axis]
        return float(after - knots[piece])

    def _has_domain_beside(self, axis: int, line: int, piece: int) -> bool:
        """Whether a piece of a line has the domain on either side."""
        cells = self.inside if axis == 0 else self.inside.T
        beside = [k % cells.shape[0] if self.period[axis] else k for k in (line - 1, line)]
        return all(0 <= k < cells.shape[0] and bool(cells[k, piece]) for k in beside)

    def _add_edge(self, axis: int, line: int, piece: int) -> None:
        """Add the edge on a piece of `line` of `axis`: one on an s-line runs along t, one on a t-line along
        s."""
        self.edges[1 - axis][(line, piece) if axis == 0 else (piece, line)] = True

    def _join_edge(self, axis: int, line: int, row: int) -> bool:
        """Add a vertex where a cut along `line` meets an edge on the other axis' line `row`; whether it
        does."""
        place = (line, row) if axis == 0 else (row, line)
        if self.crossings[place] >= 0:
            return True
        if self._edge_passes(1 - axis, row, line):
            self._number_vertex(place)
            return True
        return False

    def _edge_passes(self, axis: int, line: int, row: int) -> bool:
        """Whether an edge on `line` of `axis` runs through its crossing with `row`."""
        pieces = self.edges[1 - axis] if axis == 0 else self.edges[0].T
        count = pieces.shape[1]
        before = (row - 1) % count if self.period[1 - axis] else row - 1
        after = row
        return before >= 0 and after < count and bool(pieces[line, before] and pieces[line, after])

    def _number_vertex(self, place: Sequence[int]) -> None:
        """Add a vertex at a crossing, with the next number."""
        self.crossings[place[0], place[1]] = self.crossings.max() + 1
