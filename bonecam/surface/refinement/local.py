"""Local refinement of a general T-spline without changing it (Sederberg, Cardon, Finnigan, North, Zheng &
Lyche 2004, section 4).

A term is a blending function on five s- and five t-lines of the new T-mesh with its coefficients over the old
functions. Terms and T-mesh are made to agree: a term that lacks a knot its vertex sees (violation 1) is split
there by knot insertion; a term with a knot that its vertex does not see (violation 2) gets an edge or vertex
there; a term without vertex (violation 3) gets one. Lines are finite in number, so this ends. New control
points are the terms' combinations of the old ones in homogeneous form: weights take part like coordinates,
and nothing is assumed of the functions' sum, so the surface stays what it was for any model.
"""

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float, Int64
from numpy import ndarray

from bonecam.errors import SurfaceError
from bonecam.surface.refinement.terms import (
    Lines,
    Sight,
    Terms,
    compare,
    first_turn,
    reaches_domain,
    split_at_lack,
    unseen_lines,
)
from bonecam.surface.tmesh.cutting import Draft
from bonecam.surface.tmesh.general import TMesh
from bonecam.surface.tmesh.surface import S


def refine_locally(surface: S, draft: Draft, lines: tuple[Int64[ndarray, " a"], Int64[ndarray, " b"]]) -> S:
    """The unchanged surface over the drafted T-mesh, which is refined further where blending functions need
    it.

    `lines` are the new numbers of the old T-mesh's lines. Raises SurfaceError where a function cannot be
    represented (its support reaches over a gap of the domain that ends inside it).
    """
    terms = _old_terms(surface.tmesh, draft, lines)
    for _ in range(draft.crossings.size):
        tmesh = draft.tmesh()
        terms, wanted = _settle_terms(terms, Sight.of(tmesh), tmesh.face_boxes)
        if not wanted:
            return _combine(surface, tmesh, terms)
        for axis, line, row in sorted(wanted):
            draft.add_vertex(axis, line, row)
    raise AssertionError("local refinement did not end")


def insertion_matrix(terms: Terms, crossings: ndarray, size: tuple[int, int]) -> sp.csr_array:
    """New control points from old ones: row n holds the coefficients of the term at vertex n."""
    rows = []
    columns = []
    values = []
    for (s, t), coefficients in terms.items():
        rows += [int(crossings[s[2], t[2]])] * len(coefficients)
        columns += list(coefficients.keys())
        values += list(coefficients.values())
    return sp.csr_array((values, (rows, columns)), shape=size)


def _combine(surface: S, tmesh: TMesh, terms: Terms) -> S:
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


def _settle_terms(
    terms: Terms, sight: Sight, faces: Float[ndarray, "f 4"]
) -> tuple[Terms, set[tuple[int, int, int]]]:
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
                (axis, k % sight.counts[axis], row)
                for k in unseen_lines(own, sight.lines[axis][vertex], sight, axis)
            )
        _add(done, s, t, coefficients)
    return done, wanted


def _add(terms: Terms, s: Lines, t: Lines, coefficients: dict[int, float]) -> None:
    target = terms.setdefault((s, t), {})
    for n, c in coefficients.items():
        target[n] = target.get(n, 0.0) + c
