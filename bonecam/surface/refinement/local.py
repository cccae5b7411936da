"""Local refinement of a general T-spline without changing it (Sederberg, Cardon, Finnigan, North, Zheng &
Lyche 2004, section 4).

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
from jaxtyping import Float, Int64
from numpy import ndarray

from bonecam.errors import SurfaceError
from bonecam.surface.tmesh.cutting import Draft
from bonecam.surface.tmesh.general import TMesh
from bonecam.surface.tmesh.surface import S

Lines = tuple[int, ...]
Terms = dict[tuple[Lines, Lines], dict[int, float]]
TURNS = 4  # round a closed direction: more than any function and what lies beside it reach
Lack = tuple[int, bool] | None  # a line that a term lacks, and whether it only repeats the end of the domain


@dataclass(eq=False)
class _Sight:
    """What the vertices of the T-mesh as drafted see, in plain lists; knots[axis][line] holds for lines up to
    TURNS round, -TURNS too."""

    crossings: ndarray
    lines: tuple[list[list[int]], list[list[int]]]
    counts: tuple[int, int]
    knots: tuple[list[float], list[float]]
    period: tuple[float, float]

    @classmethod
    def of(cls, tmesh: TMesh) -> "_Sight":
        """What they see."""
        lines, turns = (
            (tmesh.knot_lines[0].tolist(), tmesh.knot_lines[1].tolist()),
            np.append(np.arange(TURNS + 1), np.arange(-TURNS, 0)),
        )
        pairs = zip((tmesh.s_lines, tmesh.t_lines), tmesh.period)
        s_knots, t_knots = ((turns[:, None] * period + knots).ravel().tolist() for knots, period in pairs)
        return cls(
            tmesh.crossings, lines, (len(tmesh.s_lines), len(tmesh.t_lines)), (s_knots, t_knots), tmesh.period
        )


def refine_locally(surface: S, draft: Draft, lines: tuple[Int64[ndarray, " a"], Int64[ndarray, " b"]]) -> S:
    """The same surface over the drafted T-mesh, which is refined further where it has to be.

    `lines` are the new numbers of the old T-mesh's lines. Raises SurfaceError where a function cannot be
    represented (its support reaches over a gap of the domain that ends inside it).
    """
    terms = _old_terms(surface.tmesh, draft, lines)
    for _ in range(draft.crossings.size):
        tmesh = draft.tmesh()
        terms, wanted = _settled(terms, _Sight.of(tmesh), tmesh.face_boxes)
        if not wanted:
            return _combined(surface, tmesh, terms)
        for axis, line, row in sorted(wanted):
            draft.add_vertex(axis, line, row)
    raise AssertionError("local refinement did not end")


def insertion_matrix(terms: Terms, crossings: ndarray, size: tuple[int, int]) -> sp.csr_array:
    """New control points from old ones: row n holds the coefficients of the term at vertex n."""
    rows, columns, values = [], [], []
    for (s, t), coefficients in terms.items():
        rows += [int(crossings[s[2], t[2]])] * len(coefficients)
        columns += list(coefficients.keys())
        values += list(coefficients.values())
    return sp.csr_array((values, (rows, columns)), shape=size)


def _combined(surface: S, tmesh: TMesh, terms: Terms) -> S:
    matrix = insertion_matrix(terms, tmesh.crossings, (tmesh.size, surface.tmesh.size))
    weights = matrix @ surface.weights
    if not weights.min() > 0:
        i, j = tmesh.vertices[int(np.argmin(weights))]
        raise SurfaceError(
            f"no function reaches the new vertex at s = {tmesh.s_lines[i]}, t = {tmesh.t_lines[j]}",
            vertex=int(np.argmin(weights)),
        )
    points = matrix @ (surface.control_points * surface.weights[:, None]) / weights[:, None]
    return surface.with_tmesh(tmesh, points, weights)


def _old_terms(tmesh: TMesh, draft: Draft, lines: tuple[ndarray, ndarray]) -> Terms:
    """Every old function as a term of its own."""
    numbers = []
    for axis in (0, 1):
        turn, k = np.divmod(tmesh.knot_lines[axis], len(lines[axis]))
        numbers.append((lines[axis][k] + turn * len(draft.knots[axis])).tolist())
    return {(tuple(s), tuple(t)): {n: 1.0} for n, (s, t) in enumerate(zip(*numbers))}


def _settled(
    terms: Terms, sight: _Sight, faces: Float[ndarray, "f 4"]
) -> tuple[Terms, set[tuple[int, int, int]]]:
    """Terms split until none lacks a knot, and the vertices that others want: (axis, line, row)."""
    stack = [(s, t, coefficients) for (s, t), coefficients in terms.items()]
    done: Terms = {}
    wanted: set[tuple[int, int, int]] = set()
    while stack:
        s, t, coefficients = stack.pop()
        s, t = _first_turn(s, sight, 0), _first_turn(t, sight, 1)
        vertex = int(sight.crossings[s[2], t[2]])
        if vertex < 0:
            if _reaches(s, t, sight, faces):
                wanted.add((0, s[2], t[2]))
                _add(done, s, t, coefficients)
            continue
        s, s_lack = _compared(s, sight.lines[0][vertex], sight, 0)
        t, t_lack = _compared(t, sight.lines[1][vertex], sight, 1)
        pieces = _pieces(s, t, s_lack, t_lack, sight)
        if pieces:
            stack += [
                (a, b, {n: f * c for n, c in coefficients.items()})
                for a, b, f in pieces
                if _reaches(a, b, sight, faces)
            ]
            continue
        for axis, own, row in ((0, s, t[2]), (1, t, s[2])):
            wanted.update(
                (axis, k % sight.counts[axis], row)
                for k in _unseen(own, sight.lines[axis][vertex], sight, axis)
            )
        _add(done, s, t, coefficients)
    return done, wanted


def _pieces(
    s: Lines, t: Lines, s_lack: Lack, t_lack: Lack, sight: _Sight
) -> list[tuple[Lines, Lines, float]]:
    """The term split at a line that it lacks; nothing where it lacks none.

    Lines that the domain's end repeats come last: by then the term has been split from what lies beside that
    end.
    """
    if s_lack is None and t_lack is None:
        return []
    if t_lack is None or (s_lack is not None and s_lack[1] <= t_lack[1]):
        assert s_lack is not None
        found = [(part, t, factor) for part, factor in _split(s, s_lack[0], sight, 0)]
    else:
        found = [(s, part, factor) for part, factor in _split(t, t_lack[0], sight, 1)]
    if any(
        _knots(a, sight, 0) == _knots(s, sight, 0) and _knots(b, sight, 1) == _knots(t, sight, 1)
        for a, b, _ in found
    ):
        place = (sight.knots[0][s[2]], sight.knots[1][t[2]])
        raise SurfaceError(
            f"a function at (s, t) = {place} reaches over a gap of the domain: it cannot be refined there",
            place=place,
        )
    return found


def _add(terms: Terms, s: Lines, t: Lines, coefficients: dict[int, float]) -> None:
    target = terms.setdefault((s, t), {})
    for n, c in coefficients.items():
        target[n] = target.get(n, 0.0) + c


def _first_turn(lines: Lines, sight: _Sight, axis: int) -> Lines:
    """The same function with its middle knot within the first turn."""
    count = sight.counts[axis]
    turn = lines[2] // count
    return tuple(k - turn * count for k in lines) if turn else lines


def _compared(own: Lines, seen: Sequence[int], sight: _Sight, axis: int) -> tuple[Lines, Lack]:
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


def _knots(lines: Lines, sight: _Sight, axis: int) -> list[float]:
    return [sight.knots[axis][k] for k in lines]


def _unseen(own: Lines, seen: Sequence[int], sight: _Sight, axis: int) -> list[int]:
    """Lines that the vertex has to see so that it sees the term's knots; of a repeated knot one that it does
    not see yet."""
    found = []
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
                found.append(unseen[0])
                break
    return found


def _split(lines: Lines, new: int, sight: _Sight, axis: int) -> list[tuple[Lines, float]]:
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


def _reaches(s: Lines, t: Lines, sight: _Sight, faces: ndarray) -> bool:
    """Whether the function is not zero everywhere on the domain."""
    s_low, s_high, t_low, t_high = (
        sight.knots[0][s[0]],
        sight.knots[0][s[4]],
        sight.knots[1][t[0]],
        sight.knots[1][t[4]],
    )
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
