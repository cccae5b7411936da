"""Exact refinement: more control points, the same surface (exact knot insertion).

Row-structured surfaces get knots in single rows, and new rows (Boehm 1980). In t a new row is a combination of two old
ones, S = sum_j N_j(t) Q_j(s); both are first brought to the knots of either. All points are homogeneous, so weights
take part like coordinates. Rows are closed (periodic knots, one a point) or open (clamped, four more than points).
"""

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.surface.basis import clamped_spans, distinct
from bonecam.surface.tmesh import NEAREST, OpenRowTMesh, Surface

Row = tuple[ndarray, ndarray]  # knots and homogeneous control points (r, 4); one of each: a pole
T = TypeVar("T")


def aligned(rows: Sequence[Float[ndarray, " _"]], period: float = 0.0) -> list[Float[ndarray, " _"]]:
    """Rows of knots, those that differ by rounding only made equal to the least of them; a knot just below
    the period comes to lie at 0."""
    kept = distinct(np.concatenate(rows))
    lifted = distinct(np.append(kept, kept[0] + period)) if period else kept
    values = np.append(kept[:-1], kept[0]) if period and len(lifted) == len(kept) else kept
    return [values[np.searchsorted(kept, row, side="right") - 1] for row in rows]


def refine_rows(surface: Surface, s: Float[ndarray, " n"], t: Float[ndarray, " n"], directions: str) -> Surface:
    """The unchanged surface with a knot in the middle of the interval that holds s in each row that acts at
    t ("s"), and in the middle of the t-span ("t").
    """
    tmesh: Any = surface.tmesh
    rows = _rows(surface)
    span, _ = clamped_spans(tmesh.t_knots, t)
    if "s" in directions:
        for j in range(len(rows)):
            acting = (span - 3 <= j) & (j <= span)
            if len(rows[j][0]) > 1 and acting.any():
                # The middles of the intervals that hold s; one that is a known knot but for rounding is that knot.
                here = rows[j]
                places = s[acting]
                known = np.concatenate([row[0] for row in rows])
                knots = here[0]
                if _is_open(here):
                    k = np.unique(clamped_spans(knots, places)[0])
                    middles = (knots[k] + knots[k + 1]) / 2
                    period = 2.0
                else:
                    k = np.unique((np.searchsorted(knots, np.mod(places, 1.0), side="right") - 1) % len(knots))
                    middles = np.mod((knots[k] + np.append(knots, knots[0] + 1)[k + 1]) / 2, 1.0)
                    period = 1.0
                apart = np.abs(np.mod(middles[:, None] - known + period / 2, period) - period / 2)
                nearest = apart.argmin(axis=1)
                rows[j] = with_knots(rows[j], np.where(apart.min(axis=1) < NEAREST, known[nearest], middles))
    t_knots = tmesh.t_knots
    if "t" in directions:
        for x in np.unique((tmesh.t_knots[span] + tmesh.t_knots[span + 1]) / 2):
            t_knots, rows = _insert(t_knots, rows, float(x), _blend_rows)
    return _surface_of(surface, t_knots, rows)


def with_row_knots(surface: Surface, new: Sequence[Float[ndarray, " _"]]) -> Surface:
    """The unchanged surface with more s-knots in its rows. `new` holds for each row knots in [0, 1) that it
    does not have yet, none for a pole.
    """
    rows = [with_knots(row, knots) if len(knots) else row for row, knots in zip(_rows(surface), new, strict=True)]
    return _surface_of(surface, surface.tmesh.t_knots, rows)


def _surface_of(surface: Surface, t_knots: ndarray, rows: Sequence[Row]) -> Surface:
    points = np.vstack([row[1] for row in rows])
    tmesh = type(surface.tmesh).from_rows(t_knots, [row[0] for row in rows])
    return type(surface)(tmesh, points[:, :3] / points[:, 3:], points[:, 3])


def _rows(surface: Surface) -> list[Row]:
    """The rows with homogeneous points; knots of different rows that differ by rounding only are made
    equal."""
    starts = surface.tmesh.row_starts
    weights = surface.weights[:, None]
    points = np.split(np.hstack([surface.control_points * weights, weights]), starts[1:-1])
    if isinstance(surface.tmesh, OpenRowTMesh):
        return list(zip(aligned(surface.tmesh.s_knots), points))
    rows = [(knots, np.argsort(knots), part) for knots, part in zip(aligned(surface.tmesh.s_knots, 1.0), points)]
    return [(knots[order], part[order]) for knots, order, part in rows]


def _is_open(row: Row) -> bool:
    return len(row[0]) > len(row[1])


def with_knots(row: Row, new: Float[ndarray, " k"]) -> Row:
    """The unchanged curve with more knots. A closed curve must have none of them yet; a pole gets its point
    at each of them.
    """
    knots, points = row
    if len(knots) == 1:
        every = np.sort(new)
        return every, np.repeat(points, len(every), axis=0)
    for x in new:
        if _is_open((knots, points)):
            knots, legs = _insert(knots, list(points), float(x), lambda a, b, ratio: a * (1 - ratio) + b * ratio)
            points = np.array(legs)
        else:
            knots, points = _insert_periodic(knots, points, float(x))
    return knots, points


def _insert_periodic(knots: ndarray, points: ndarray, x: float) -> Row:
    """One more knot. Control point i is centred on knot i; between its new neighbours a point divides an old
    leg."""
    count = len(knots)
    k = int(np.searchsorted(knots, x, side="right")) - 1

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


def _insert(knots: ndarray, items: Sequence[T], x: float, mixed: Callable[[T, T, float], T]) -> tuple[ndarray, list[T]]:
    """Clamped knots with x, and the control points or rows: three lie between two old ones each."""
    k = int(np.searchsorted(knots, x, side="right")) - 1
    inserted = list(items[: k - 2])
    for i in (k - 2, k - 1, k):
        inserted.append(mixed(items[i - 1], items[i], (x - knots[i]) / (knots[i + 3] - knots[i])))
    return np.insert(knots, k + 1, x), [*inserted, *items[k:]]


def _blend_rows(first: Row, second: Row, ratio: float) -> Row:
    """(1 - ratio) first + ratio second, on the knots of both."""
    if len(first[0]) == 1 and len(second[0]) == 1:
        return first[0], first[1] * (1 - ratio) + second[1] * ratio
    a = with_knots(first, _lacking(first, second))
    b = with_knots(second, _lacking(second, first))
    return a[0], a[1] * (1 - ratio) + b[1] * ratio


def _lacking(row: Row, other: Row) -> ndarray:
    """The knots of `other` that `row` has not, or not as often; a pole has none of its own."""
    knots, others = (x[0] if len(x[0]) > 1 else np.zeros(0) for x in (row, other))
    every, times = np.unique(others, return_counts=True)
    own = np.searchsorted(knots, every, side="right") - np.searchsorted(knots, every, side="left")
    return np.repeat(every, np.maximum(times - own, 0))


def refine(surface: Surface, s: Float[ndarray, " n"], t: Float[ndarray, " n"], directions: str = "st") -> Surface:
    """The unchanged surface with more control points near the samples.

    Each face that holds a sample is cut in its middle, across s ("s"), across t ("t") or both. In rows those that act
    at a sample get a knot ("s"), and the t-span gets a row ("t"). Raises ValueError for samples outside the domain.
    """
    if directions not in ("s", "t", "st", "ts"):
        raise ValueError(f"directions must be 's', 't' or 'st', not {directions!r}")
    _, s, t = surface.elements().place(s, t)
    return getattr(surface.tmesh, "refine", refine_rows)(surface, s, t, directions)
