"""Bezier extraction of a T-spline from local knot vectors: faces cut at the knots of the functions that live
on them.

A blending function is B(s, t) = N[s-knots](s) N[t-knots](t), cubic B-splines each on its own five knots (Gan
et al. 2014, Definition 1). On a face it is a polynomial between its own knots only, so every face is cut into
a grid by those knots of all functions that reach it. The functions need not sum to one.
"""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.surface.basis.elements import Elements
from bonecam.surface.basis.knots import bernstein_coefficients, distinct

BLOCK = 4_000_000
"""Pairs of a function and a box looked at in one go."""


def extract_local(
    faces: Float[ndarray, "f 4"],
    s_knots: Float[ndarray, "n 5"],
    t_knots: Float[ndarray, "n 5"],
    period: tuple[float, float],
) -> Elements:
    """The elements of the faces (s_low, s_high, t_low, t_high) under functions with these local knots.

    In a closed direction (period > 0) functions act again one period on.
    """
    # The functions and their images one and two periods away that may reach the domain
    shifts = [np.arange(-2, 3) * length if length else np.zeros(1) for length in period]
    moved = [(s_knots + a, t_knots + b, np.arange(len(s_knots))) for a in shifts[0] for b in shifts[1]]
    s, t, ids = (np.concatenate([part[k] for part in moved]) for k in range(3))

    boxes = _cut(faces, s, t)
    s_middle, t_middle = boxes[:, :2].mean(axis=1), boxes[:, 2:].mean(axis=1)
    function, element = _overlaps(
        np.column_stack([s_middle, s_middle, t_middle, t_middle]), s, t
    )  # images are off by a rounding
    low, high = boxes[element][:, [0, 2]], boxes[element][:, [1, 3]]
    around, along = (_coefficients(k[function], low[:, d], high[:, d]) for d, k in ((0, s), (1, t)))
    values = (along[:, :, None] * around[:, None, :]).reshape(-1, 16)

    # Elements with the images of one function added up and functions in increasing order
    functions = ids[function]
    key = element * (functions.max() + 1) + functions
    unique, inverse = np.unique(key, return_inverse=True)
    if len(unique) < len(key):
        summed = np.zeros((len(unique), 16))
        np.add.at(summed, inverse, values)
    else:
        summed = values[np.argsort(key)]
    owner = unique // (functions.max() + 1)
    starts = np.searchsorted(owner, np.arange(len(boxes) + 1))
    return Elements(boxes, starts, unique % (functions.max() + 1), summed, period)


def _cut(faces: ndarray, s: ndarray, t: ndarray) -> ndarray:
    """Each face cut into a grid by the knots of the functions that reach it."""
    function, face = _overlaps(faces, s, t)
    order = np.argsort(face, kind="stable")
    function = function[order]
    starts = np.searchsorted(face[order], np.arange(len(faces) + 1))
    lines = [_lines(faces[:, :2], s), _lines(faces[:, 2:], t)]
    boxes = []
    for k, (s_low, s_high, t_low, t_high) in enumerate(faces):
        here = function[starts[k] : starts[k + 1]]
        x, y = (
            _nearest(every, np.concatenate([[low, high], np.clip(knots[here].ravel(), low, high)]))
            for every, knots, low, high in ((lines[0], s, s_low, s_high), (lines[1], t, t_low, t_high))
        )
        i, j = (index.ravel() for index in np.meshgrid(np.arange(len(x) - 1), np.arange(len(y) - 1)))
        boxes.append(np.column_stack([x[i], x[i + 1], y[j], y[j + 1]]))
    return np.vstack(boxes)


def _lines(sides: ndarray, knots: ndarray) -> ndarray:
    """All places where a box may end: the sides of faces, and knots that do not differ from them by rounding
    only."""
    sides = np.unique(sides)
    every = distinct(np.clip(knots.ravel(), sides[0], sides[-1]))
    slack = 4096 * np.finfo(float).eps * max(1.0, float(np.abs(sides).max()))
    apart = np.abs(every - sides[np.clip(np.searchsorted(sides, every), 0, len(sides) - 1)]) > slack
    apart &= np.abs(every - sides[np.clip(np.searchsorted(sides, every) - 1, 0, None)]) > slack
    return np.sort(np.concatenate([sides, every[apart]]))


def _nearest(lines: ndarray, knots: ndarray) -> ndarray:
    """The lines that are nearest to some of the knots."""
    above = np.clip(np.searchsorted(lines, knots), 1, len(lines) - 1)
    return lines[np.unique(np.where(knots - lines[above - 1] < lines[above] - knots, above - 1, above))]


def _overlaps(boxes: ndarray, s: ndarray, t: ndarray) -> tuple[ndarray, ndarray]:
    """Pairs (function, box) whose insides meet."""
    pairs = []
    step = max(1, BLOCK // max(1, len(s)))
    for first in range(0, len(boxes), step):
        b = boxes[first : first + step, :, None]
        meet = (s[:, 0] < b[:, 1]) & (s[:, 4] > b[:, 0]) & (t[:, 0] < b[:, 3]) & (t[:, 4] > b[:, 2])
        box, function = np.nonzero(meet)
        pairs.append((function, box + first))
    return np.concatenate([f for f, _ in pairs]), np.concatenate([b for _, b in pairs])


def _coefficients(knots: ndarray, low: ndarray, high: ndarray) -> ndarray:
    """Bernstein coefficients (m, 4) of N[knots] on boxes that lie within one of its spans."""
    padded = np.column_stack([*[knots[:, 0] - 1] * 3, knots, *[knots[:, 4] + 1] * 3])
    middle = (low + high) / 2
    span = np.clip((knots <= middle[:, None]).sum(axis=1) - 1, 0, 3)
    window = np.take_along_axis(padded, span[:, None] + np.arange(8), axis=1)
    return bernstein_coefficients(window, low, high)[np.arange(len(knots)), 3 - span]
