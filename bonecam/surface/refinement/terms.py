"""Terms of a local refinement: blending functions on lines of the new T-mesh, compared with what their vertices
see, and split by knot insertion.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy import ndarray

from bonecam.errors import SurfaceError
from bonecam.surface.tmesh.general import TMesh

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
    lines: tuple[list[list[int]], list[list[int]]]
    counts: tuple[int, int]
    knots: tuple[list[float], list[float]]
    period: tuple[float, float]

    @classmethod
    def of(cls, tmesh: TMesh) -> "Sight":
        """The lines that the vertices of this T-mesh see."""
        lines = (tmesh.knot_lines[0].tolist(), tmesh.knot_lines[1].tolist())
        turns = np.append(np.arange(TURNS + 1), np.arange(-TURNS, 0))
        pairs = zip((tmesh.s_lines, tmesh.t_lines), tmesh.period)
        s_knots, t_knots = ((turns[:, None] * period + knots).ravel().tolist() for knots, period in pairs)
        return cls(
            tmesh.crossings, lines, (len(tmesh.s_lines), len(tmesh.t_lines)), (s_knots, t_knots), tmesh.period
        )


def split_at_lack(
    s: Lines, t: Lines, s_lack: Lack, t_lack: Lack, sight: Sight
) -> list[tuple[Lines, Lines, float]]:
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
        _knots(a, sight, 0) == _knots(s, sight, 0) and _knots(b, sight, 1) == _knots(t, sight, 1)
        for a, b, _ in terms
    ):
        place = (sight.knots[0][s[2]], sight.knots[1][t[2]])
        raise SurfaceError(
            f"a function at (s, t) = {place} reaches over a gap of the domain: it cannot be refined there",
            place=place,
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
                        f"knot {knot} of {'st'[axis]} is repeated more often than the T-mesh has lines "
                        "for it",
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
