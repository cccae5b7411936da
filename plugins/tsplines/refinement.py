"""Exact local refinement: faces of a general T-mesh cut, the same surface (exact knot insertion).

Sederberg, Cardon, Finnigan, North, Zheng & Lyche 2004, section 4. Faces are cut on a draft of the T-mesh. A cut runs
through its face to the edges on either side and puts a vertex there; empty intervals beyond (the lines of a clamped
border) are cut as well, so that a border stays clamped. A row that passes all round a closed direction is given four
knots at least.

A term is a blending function on five s- and five t-lines of the new T-mesh with its coefficients over the old
functions. Terms and T-mesh are made to agree: a term that lacks a knot its vertex sees (violation 1) is split
there by knot insertion; a term with a knot that its vertex does not see (violation 2) gets an edge or vertex
there; a term without vertex (violation 3) gets one. Lines are finite in number, so this ends. New control
points are the terms' combinations of the old ones in homogeneous form: weights take part like coordinates,
and nothing is assumed of the functions' sum, so the surface stays what it was for any model.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from bonecam_plugins.tsplines.tmesh import TMesh, sight
from jaxtyping import Bool, Float, Int64
from numpy import ndarray

from bonecam.errors import SurfaceError
from bonecam.surface import TSpline

FEWEST = 4
"""Knots of a row all round a closed direction."""


def _place(axis: int, line: int, row: int) -> tuple[int, int]:
    """Where `line` of `axis` meets `row` of the other, in arrays over s and t."""
    return (line, row) if axis == 0 else (row, line)


@dataclass(eq=False)
class Draft:
    """A T-mesh that is being changed: the fields of `TMesh`, with a grid of vertex numbers (`crossings`, -1:
    none) instead of the vertices. Axis 0 is s, axis 1 is t; an edge on an s-line runs along t."""

    knots: list[Float[ndarray, " _"]]
    edges: list[Bool[ndarray, "_ _"]]
    inside: Bool[ndarray, "_ _"]
    crossings: Int64[ndarray, "_ _"]
    period: tuple[float, float]

    def tmesh(self) -> TMesh:
        """The finished T-mesh; vertices keep their numbers."""
        # Each row that passes all round a closed direction with vertices but too few knots is a ring with more
        for axis, (hits, passes) in enumerate(sight(self.crossings >= 0, self.edges, self.inside, self.period)):
            vertex = self.crossings >= 0 if axis == 0 else self.crossings.T >= 0
            short = (hits.sum(axis=0) < FEWEST) & vertex.any(axis=0) & passes.all(axis=0)
            for row in np.flatnonzero(short).tolist() if self.period[axis] else ():
                self.edges[axis][(slice(None), row) if axis == 0 else (row, slice(None))] = True
                for line in (k * len(hits) // FEWEST for k in range(FEWEST)):
                    if not hits[line, row]:
                        self.crossings[_place(axis, line, row)] = self.crossings.max() + 1
        i, j = np.nonzero(self.crossings >= 0)
        order = np.argsort(self.crossings[i, j])
        vertices = np.column_stack([i, j])[order]
        (s, t), (along_s, along_t) = self.knots, self.edges
        return TMesh(s, t, vertices, along_s=along_s, along_t=along_t, inside=self.inside, period=self.period)

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
        through empty intervals, with a vertex where it meets an edge."""
        count = self.inside.shape[1 - axis]
        if not self._has_domain_beside(axis, line, piece):
            return
        self.edges[1 - axis][_place(axis, line, piece)] = True
        for sign in (-1, 1):
            k = piece
            for _ in range(count):
                row = (k if sign < 0 else k + 1) % self.crossings.shape[1 - axis]
                place = _place(axis, line, row)
                if self.crossings[place] < 0 and self._edge_passes(1 - axis, row, line):
                    self.crossings[place] = self.crossings.max() + 1
                k += sign
                if self.period[1 - axis]:
                    k %= count
                elif not 0 <= k < count:
                    break
                stopped = self.crossings[place] >= 0 and self._length(1 - axis, k) > 0
                if stopped or not self._has_domain_beside(axis, line, k):
                    break
                self.edges[1 - axis][_place(axis, line, k)] = True

    def add_vertex(self, axis: int, line: int, row: int) -> None:
        """A vertex where `line` of `axis` meets the other axis' line `row`, on an edge there or by cutting
        the face along `line`."""
        place = _place(axis, line, row)
        if self.crossings[place] >= 0:
            return
        count = self.inside.shape[1 - axis]
        if self._edge_passes(1 - axis, row, line) or self._edge_passes(axis, line, row):
            self.crossings[place] = self.crossings.max() + 1
            # Cut the empty intervals on both sides of a new vertex, so that all lines of a clamped border have it
            for piece in (row - 1, row):
                inside = self.period[1 - axis] or 0 <= piece < count
                if inside and self._length(1 - axis, piece % count) == 0:
                    self.cut(axis, line, piece % count)
        else:
            self.cut(axis, line, row % count)

    def _length(self, axis: int, piece: int) -> float:
        """The knot interval of a piece between two lines of `axis`."""
        knots = self.knots[axis]
        after = knots[piece + 1] if piece + 1 < len(knots) else knots[0] + self.period[axis]
        return float(after - knots[piece])

    def _has_domain_beside(self, axis: int, line: int, piece: int) -> bool:
        """Whether a piece of a line has the domain on both sides."""
        cells = self.inside if axis == 0 else self.inside.T
        sides = [k % cells.shape[0] if self.period[axis] else k for k in (line - 1, line)]
        return all(0 <= k < cells.shape[0] and bool(cells[k, piece]) for k in sides)

    def _edge_passes(self, axis: int, line: int, row: int) -> bool:
        """Whether an edge on `line` of `axis` runs through its crossing with `row`."""
        pieces = self.edges[1 - axis] if axis == 0 else self.edges[0].T
        count = pieces.shape[1]
        before = (row - 1) % count if self.period[1 - axis] else row - 1
        return before >= 0 and row < count and bool(pieces[line, before] and pieces[line, row])


Lines = tuple[int, ...]


Terms = dict[tuple[Lines, Lines], dict[int, float]]


TURNS = 4
"""Round a closed direction: more than any function and what lies beside it reach."""


Lack = tuple[int, bool] | None  # a line that a term lacks, and whether it only repeats the end of the domain


@dataclass(eq=False)
class Sight:
    """The lines that the vertices of a drafted T-mesh see, as plain lists. knots[axis][line] holds for line
    numbers up to TURNS times round a closed direction, both ways.
    """

    crossings: ndarray
    lines: list[list[list[int]]]
    counts: list[int]
    knots: list[list[float]]
    period: tuple[float, float]


def split_at_lack(s: Lines, t: Lines, s_lack: Lack, t_lack: Lack, sight: Sight) -> list[tuple[Lines, Lines, float]]:
    """The term split at a line that it lacks; nothing where it lacks none.

    Lines that the domain's end repeats come last: by then the term has been split from what lies beside that
    end.
    """
    if s_lack is None and t_lack is None:
        return []
    if t_lack is None or (s_lack is not None and s_lack[1] <= t_lack[1]):
        assert s_lack is not None
        terms = [(part, t, factor) for part, factor in _split(s, s_lack[0], sight, 0)]
    else:
        terms = [(s, part, factor) for part, factor in _split(t, t_lack[0], sight, 1)]
    if any(
        _knots(a, sight, 0) == _knots(s, sight, 0) and _knots(b, sight, 1) == _knots(t, sight, 1) for a, b, _ in terms
    ):
        place = (sight.knots[0][s[2]], sight.knots[1][t[2]])
        raise SurfaceError(
            f"a function at (s, t) = {place} reaches over a gap of the domain: it cannot be refined there", place=place
        )
    return terms


def first_turn(lines: Lines, sight: Sight, axis: int) -> Lines:
    """The function moved by whole periods, so that its middle knot lies in the first one."""
    count = sight.counts[axis]
    turn = lines[2] // count
    return tuple(k - turn * count for k in lines) if turn else lines


def compare(own: Lines, seen: Sequence[int], sight: Sight, axis: int) -> tuple[Lines, Lack]:
    """The term's lines, those with equal knots renamed to what the vertex sees; and what it lacks."""
    lines = list(own)
    lacks = []
    for sign in (-1, 1):
        for k in (2 + sign, 2 + 2 * sign):
            mine, its = sight.knots[axis][lines[k]], sight.knots[axis][seen[k]]
            if mine == its:
                lines[k] = seen[k]
            else:
                if sign * its < sign * mine:
                    lacks.append((seen[k], seen[k] == seen[k - sign]))
                break
    return tuple(lines), min(lacks, key=lambda lack: lack[1], default=None)


def _knots(lines: Lines, sight: Sight, axis: int) -> list[float]:
    return [sight.knots[axis][k] for k in lines]


def unseen_lines(own: Lines, seen: Sequence[int], sight: Sight, axis: int) -> list[int]:
    """Lines that the vertex has to see so that it sees the term's knots; of a repeated knot one that it does
    not see yet."""
    lines = []
    for sign in (-1, 1):
        for k in (2 + sign, 2 + 2 * sign):
            knot = sight.knots[axis][own[k]]
            if knot != sight.knots[axis][seen[k]]:
                near = [
                    line
                    for line in (own[k], own[k] - 1, own[k] + 1, own[k] - 2, own[k] + 2)
                    if sight.knots[axis][line] == knot
                ]
                unseen = [line for line in near if line not in seen]
                if not unseen:
                    raise SurfaceError(
                        f"knot {knot} of {'st'[axis]} is repeated more often than the T-mesh has lines for it",
                        knot=knot,
                    )
                lines.append(unseen[0])
                break
    return lines


def _split(lines: Lines, new: int, sight: Sight, axis: int) -> list[tuple[Lines, float]]:
    """Knot insertion (Boehm 1980): one cubic as the sum of two with the knot of line `new`, and their
    factors."""
    x = _knots(lines, sight, axis)
    y = sight.knots[axis][new]
    place = next(
        n
        for n in range(1, 5)
        if lines[n - 1] <= new <= lines[n] and x[n - 1] <= y <= x[n] and (new > lines[2]) == (n > 2)
    )
    six = (*lines[:place], new, *lines[place:])
    left = 1.0 if y >= x[3] else (y - x[0]) / (x[3] - x[0])
    right = 1.0 if y <= x[1] else (x[4] - y) / (x[4] - x[1])
    return [(part, factor) for part, factor in ((six[:5], left), (six[1:], right)) if factor > 0]


def reaches_domain(s: Lines, t: Lines, sight: Sight, faces: ndarray) -> bool:
    """Whether the function is not zero everywhere on the domain."""
    s_low = sight.knots[0][s[0]]
    s_high = sight.knots[0][s[4]]
    t_low = sight.knots[1][t[0]]
    t_high = sight.knots[1][t[4]]
    if s_low == s_high or t_low == t_high:
        return False
    for a in (-sight.period[0], 0.0, sight.period[0]):
        for b in (-sight.period[1], 0.0, sight.period[1]):
            meet = (
                (s_low + a < faces[:, 1])
                & (s_high + a > faces[:, 0])
                & (t_low + b < faces[:, 3])
                & (t_high + b > faces[:, 2])
            )
            if meet.any():
                return True
    return False


def refine_locally(surface: TSpline[TMesh], draft: Draft, lines: list[Int64[ndarray, " _"]]) -> TSpline[TMesh]:
    """The unchanged surface over the drafted T-mesh, which is refined further where blending functions need
    it.

    `lines` are the new numbers of the old T-mesh's s-lines and t-lines. Raises SurfaceError where a function cannot be
    represented (its support reaches over a gap of the domain that ends inside it).
    """
    # Every old function as a term of its own
    numbers = []
    for axis in (0, 1):
        turn, k = np.divmod(surface.tmesh.knot_lines[axis], len(lines[axis]))
        numbers.append((lines[axis][k] + turn * len(draft.knots[axis])).tolist())
    terms: Terms = {(tuple(s), tuple(t)): {n: 1.0} for n, (s, t) in enumerate(zip(*numbers))}

    turns = np.append(np.arange(TURNS + 1), np.arange(-TURNS, 0))
    for _ in range(draft.crossings.size):
        tmesh = draft.tmesh()
        knots = (tmesh.s_lines, tmesh.t_lines)
        sight = Sight(
            crossings=tmesh.crossings,
            lines=[seen.tolist() for seen in tmesh.knot_lines],
            counts=[len(values) for values in knots],
            knots=[(turns[:, None] * period + k).ravel().tolist() for k, period in zip(knots, tmesh.period)],
            period=tmesh.period,
        )
        terms, wanted = _settle_terms(terms, sight, tmesh.face_boxes)
        if not wanted:
            break
        for axis, line, row in sorted(wanted):
            draft.add_vertex(axis, line, row)
    else:
        raise AssertionError("local refinement did not end")

    # New control points from old ones: row n of the matrix holds the coefficients of the term at vertex n
    rows: list[int] = []
    columns: list[int] = []
    values: list[float] = []
    for (s, t), coefficients in terms.items():
        rows += [int(tmesh.crossings[s[2], t[2]])] * len(coefficients)
        columns += coefficients.keys()
        values += coefficients.values()
    matrix = sp.csr_array((values, (rows, columns)), shape=(tmesh.size, surface.tmesh.size))
    weights = matrix @ surface.weights
    if not weights.min() > 0:
        vertex = int(np.argmin(weights))
        i, j = tmesh.vertices[vertex]
        raise SurfaceError(
            f"no function reaches the new vertex at s = {tmesh.s_lines[i]}, t = {tmesh.t_lines[j]}", vertex=vertex
        )
    points = matrix @ (surface.control_points * surface.weights[:, None]) / weights[:, None]
    return type(surface)(tmesh, points, weights)


def _settle_terms(terms: Terms, sight: Sight, faces: Float[ndarray, "f 4"]) -> tuple[Terms, set[tuple[int, int, int]]]:
    """Terms split until none lacks a knot, and the vertices that others want: (axis, line, row)."""
    stack = [(s, t, coefficients) for (s, t), coefficients in terms.items()]
    done: Terms = {}
    wanted: set[tuple[int, int, int]] = set()
    while stack:
        s, t, coefficients = stack.pop()
        s, t = first_turn(s, sight, 0), first_turn(t, sight, 1)
        vertex = int(sight.crossings[s[2], t[2]])
        if vertex < 0:
            if reaches_domain(s, t, sight, faces):
                wanted.add((0, s[2], t[2]))
                _add(done, s, t, coefficients)
            continue
        s, s_lack = compare(s, sight.lines[0][vertex], sight, 0)
        t, t_lack = compare(t, sight.lines[1][vertex], sight, 1)
        pieces = split_at_lack(s, t, s_lack, t_lack, sight)
        if pieces:
            stack += [
                (a, b, {n: f * c for n, c in coefficients.items()})
                for a, b, f in pieces
                if reaches_domain(a, b, sight, faces)
            ]
            continue
        for axis, own, row in ((0, s, t[2]), (1, t, s[2])):
            wanted.update(
                (axis, k % sight.counts[axis], row) for k in unseen_lines(own, sight.lines[axis][vertex], sight, axis)
            )
        _add(done, s, t, coefficients)
    return done, wanted


def _add(terms: Terms, s: Lines, t: Lines, coefficients: dict[int, float]) -> None:
    target = terms.setdefault((s, t), {})
    for n, c in coefficients.items():
        target[n] = target.get(n, 0.0) + c


SNAP = 1e-9
"""Share of the knots' range: a middle as near as this to a knot is that knot."""


def cut_faces(
    surface: TSpline[TMesh], s: Float[ndarray, " n"], t: Float[ndarray, " n"], directions: str
) -> TSpline[TMesh]:
    """The unchanged surface with each face that holds a sample cut in its middle, across s ("s"), across t ("t") or
    both; old control points keep their numbers."""
    place, s, t = surface.elements().place(s, t)
    tmesh = surface.tmesh
    boxes = surface.elements().boxes[place]
    faces = tmesh.face_boxes
    chosen = set()
    for s_middle, t_middle in zip(boxes[:, :2].mean(axis=1), boxes[:, 2:].mean(axis=1)):
        in_s = (faces[:, 0] < s_middle) & (s_middle < faces[:, 1])
        chosen.add(int(np.flatnonzero(in_s & (faces[:, 2] < t_middle) & (t_middle < faces[:, 3]))[0]))
    boxes = faces[sorted(chosen)]

    knots = [tmesh.s_lines, tmesh.t_lines]
    edges = [tmesh.along_s.copy(), tmesh.along_t.copy()]
    draft = Draft(knots, edges, tmesh.inside.copy(), tmesh.crossings.copy(), tmesh.period)
    middles = [boxes[:, :2].mean(axis=1), boxes[:, 2:].mean(axis=1)]
    numbers = [np.arange(len(tmesh.s_lines)), np.arange(len(tmesh.t_lines))]
    for axis in (0, 1):
        if "st"[axis] in directions:
            # Knots for values that differ from them by rounding only; values that equal one another likewise become
            # one
            own = draft.knots[axis]
            for k, x in enumerate(middles[axis]):
                known = np.concatenate([own, middles[axis][:k]])
                nearest = known[np.argmin(np.abs(known - x))]
                if abs(nearest - x) <= SNAP * np.ptp(own):
                    middles[axis][k] = nearest
            numbers[axis] = draft.insert_lines(axis, np.setdiff1d(middles[axis], own))
    for at_s, at_t in zip(*(values.tolist() for values in middles)):
        if "s" in directions:
            draft.cut(0, draft.line_at(0, at_s), _piece(draft.knots[1], at_t, upper=False))
        if "t" in directions:
            for piece in {_piece(draft.knots[0], at_s, upper=upper) for upper in (False, True)}:
                draft.cut(1, draft.line_at(1, at_t), piece)
        if directions in ("st", "ts"):
            draft.cut(0, draft.line_at(0, at_s), _piece(draft.knots[1], at_t, upper=True))
    return refine_locally(surface, draft, numbers)


def _piece(knots: ndarray, middle: float, upper: bool) -> int:
    """A piece that is not empty inside a face, below its middle or above."""
    k = int(np.searchsorted(knots, middle, side="left"))
    return k if upper and k < len(knots) and knots[k] == middle else k - 1
