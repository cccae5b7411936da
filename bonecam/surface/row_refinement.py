"""Exact knot insertion in row-structured surfaces (Boehm 1980): knots in single rows, and new rows.

In t a new row is a combination of two old ones, S = sum_j N_j(t) Q_j(s); both are first brought to the knots of either. All points are
homogeneous, so weights take part like coordinates.
"""

from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.surface.tmesh import RowTMesh

if TYPE_CHECKING:
    from bonecam.surface.tspline import TSpline

Row = tuple[ndarray, ndarray]  # knots (r,) and homogeneous control points (r, 4); one of each: a pole


def refined_rows(surface: "TSpline[RowTMesh]", s: Float[ndarray, " n"], t: Float[ndarray, " n"], directions: str) -> "TSpline[RowTMesh]":
    """A knot in the middle of the interval that holds s in each of the rows that act at t ("s"), and of the t-span ("t")."""
    tmesh = surface.tmesh
    rows = _rows(surface)
    span = np.clip(np.searchsorted(tmesh.t_knots, t, side="right") - 1, 3, len(tmesh.t_knots) - 5)
    if "s" in directions:
        for j in range(len(rows)):
            acting = (span - 3 <= j) & (j <= span)
            if len(rows[j][0]) > 1 and acting.any():
                rows[j] = with_knots(rows[j], _middles(rows[j][0], s[acting]))
    t_knots = tmesh.t_knots
    if "t" in directions:
        for x in np.unique((tmesh.t_knots[span] + tmesh.t_knots[span + 1]) / 2):
            t_knots, rows = with_t_knot(t_knots, rows, float(x))
    points = np.vstack([row[1] for row in rows])
    return type(surface)(RowTMesh.from_rows(t_knots, [row[0] for row in rows]), points[:, :3] / points[:, 3:], points[:, 3])


def _rows(surface: "TSpline[RowTMesh]") -> list[Row]:
    starts, weights = surface.tmesh.row_starts, surface.weights[:, None]
    points = np.hstack([surface.control_points * weights, weights])
    return [(knots, points[starts[j] : starts[j + 1]]) for j, knots in enumerate(surface.tmesh.s_knots)]


def _middles(knots: ndarray, s: ndarray) -> ndarray:
    """The middles of the periodic intervals that hold s, in [0, 1)."""
    k = np.unique((np.searchsorted(knots, np.mod(s, 1.0), side="right") - 1) % len(knots))
    following = np.append(knots, knots[0] + 1)[k + 1]
    return np.asarray(np.mod((knots[k] + following) / 2, 1.0))


def with_knots(row: Row, new: Float[ndarray, " k"]) -> Row:
    """The same periodic curve with more knots, each in [0, 1) and not there yet. A pole gets its point at every one of them."""
    knots, points = row
    if len(knots) == 1:
        every = np.sort(new)
        return every, np.repeat(points, len(every), axis=0)
    for x in new:
        knots, points = _with_knot(knots, points, float(x))
    return knots, points


def _with_knot(knots: ndarray, points: ndarray, x: float) -> Row:
    """One more knot. Control point i is centred on knot i; between its new neighbours a point divides an old leg."""
    count, k = len(knots), int(np.searchsorted(knots, x, side="right")) - 1

    def old(i: int) -> float:
        return float(knots[i % count] + i // count)

    at = x if k >= 0 else x + 1  # k = -1: the last interval, before the first knot
    k %= count
    fresh = []
    for i in (k - 1, k, k + 1):  # legs from control point i to i + 1, knots i - 1 .. i + 2
        ratio = (at - old(i - 1)) / (old(i + 2) - old(i - 1))
        fresh.append(points[i % count] * (1 - ratio) + points[(i + 1) % count] * ratio)
    # new centres: knot k gets leg k - 1, the new knot leg k, knot k + 1 leg k + 1
    place = k + 1 if x > knots[0] else 0
    result = np.insert(points, place, fresh[1], axis=0)
    result[(place - 1) % (count + 1)] = fresh[0]
    result[(place + 1) % (count + 1)] = fresh[2]
    return np.insert(knots, place, x), result


def with_t_knot(t_knots: ndarray, rows: list[Row], x: float) -> tuple[ndarray, list[Row]]:
    """The same surface with one more row: rows k-2..k of the new surface lie between two old ones, x in t-span k."""
    k = int(np.searchsorted(t_knots, x, side="right")) - 1
    found = list(rows[: k - 2])
    for i in (k - 2, k - 1, k):
        ratio = (x - t_knots[i]) / (t_knots[i + 3] - t_knots[i])
        found.append(_mixed(rows[i - 1], rows[i], ratio))
    return np.insert(t_knots, k + 1, x), found + list(rows[k:])


def _mixed(first: Row, second: Row, ratio: float) -> Row:
    """(1 - ratio) first + ratio second, on the knots of both."""
    if len(first[0]) == 1 and len(second[0]) == 1:
        return first[0], first[1] * (1 - ratio) + second[1] * ratio
    every = np.union1d(*(row[0] if len(row[0]) > 1 else np.zeros(0) for row in (first, second)))
    a, b = (with_knots(row, every if len(row[0]) == 1 else np.setdiff1d(every, row[0])) for row in (first, second))
    return every, a[1] * (1 - ratio) + b[1] * ratio
