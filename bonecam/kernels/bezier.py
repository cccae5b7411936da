"""Rational Bezier patches and their basis, compiled: find the element, evaluate, differentiate.

A bicubic patch is 16 homogeneous control points (w x, w y, w z, w), s fastest: row 4 j + i
belongs to B_i(u) B_j(v) on the element's box. The derivatives follow from differentiating S W = A. The rational basis
and its derivatives are written as rows of sparse matrices. The element that holds (s, t) is searched in strips of t.
"""

from typing import TypeAlias

import numpy as np
from numpy import ndarray

from bonecam.kernels import CONTRACT, inner_njit, njit
from bonecam.kernels.vectors import Three

Four: TypeAlias = tuple[float, float, float, float]


@njit(cache=True, fastmath=CONTRACT)
def homogeneous_patches(starts: ndarray, functions: ndarray, coefficients: ndarray, weighted: ndarray) -> ndarray:
    """Sum of coefficient x weighted control point over the functions of each element: (e, 16, 4) for bicubic
    ones."""
    count = coefficients.shape[1]
    result = np.zeros((len(starts) - 1, count, 4))
    for e in range(len(starts) - 1):
        for k in range(starts[e], starts[e + 1]):
            f = functions[k]
            for c in range(count):
                for d in range(4):
                    result[e, c, d] += coefficients[k, c] * weighted[f, d]
    return result


@njit(inline="always")
def bernstein(x: float) -> Four:
    """The four cubic Bernstein polynomials at x."""
    y = 1.0 - x
    return y * y * y, 3.0 * y * y * x, 3.0 * y * x * x, x * x * x


@njit(inline="always")
def bernstein_first(x: float, h: float) -> Four:
    """The derivatives of the cubic Bernstein polynomials at x; h = 1 / width of the element."""
    y = 1.0 - x
    return -3.0 * y * y * h, 3.0 * y * (y - 2.0 * x) * h, 3.0 * x * (2.0 * y - x) * h, 3.0 * x * x * h


@njit(inline="always")
def bernstein_second(x: float, h: float) -> Four:
    """The second derivatives of the cubic Bernstein polynomials at x; h = 1 / width of the element."""
    g = 6.0 * h * h
    return (1.0 - x) * g, (3.0 * x - 2.0) * g, (1.0 - 3.0 * x) * g, x * g


@njit(inline="always")
def _in_element(box: ndarray, s: float, t: float) -> Four:
    """The place of (s, t) on an element, 0 to 1, and 1 / its widths."""
    h, k = 1.0 / (box[1] - box[0]), 1.0 / (box[3] - box[2])
    return (s - box[0]) * h, (t - box[2]) * k, h, k


@njit(cache=True, fastmath=CONTRACT)
def positions(patches: ndarray, boxes: ndarray, element: ndarray, s: ndarray, t: ndarray, S: ndarray) -> None:
    """Write the surface points at each sample into S (n, 3)."""
    for n in range(len(s)):
        e = element[n]
        x, y, _, _ = _in_element(boxes[e], s[n], t[n])
        a0, a1, a2, a3 = bernstein(x)
        b = bernstein(y)
        p = patches[e]
        A = np.zeros(4)
        for j in range(4):
            for d in range(4):
                A[d] += b[j] * (a0 * p[4 * j, d] + a1 * p[4 * j + 1, d] + a2 * p[4 * j + 2, d] + a3 * p[4 * j + 3, d])
        for d in range(3):
            S[n, d] = A[d] / A[3]


@njit(inline="always")
def _four(p: ndarray, d: int, a: Four) -> Four:
    """The sums of one homogeneous coordinate along the four rows of a patch."""
    return (
        a[0] * p[0, d] + a[1] * p[1, d] + a[2] * p[2, d] + a[3] * p[3, d],
        a[0] * p[4, d] + a[1] * p[5, d] + a[2] * p[6, d] + a[3] * p[7, d],
        a[0] * p[8, d] + a[1] * p[9, d] + a[2] * p[10, d] + a[3] * p[11, d],
        a[0] * p[12, d] + a[1] * p[13, d] + a[2] * p[14, d] + a[3] * p[15, d],
    )


@njit(inline="always")
def _one(b: Four, r: Four) -> float:
    """The sum of four values, each times its polynomial."""
    return b[0] * r[0] + b[1] * r[1] + b[2] * r[2] + b[3] * r[3]


@njit(inline="always")
def _coordinate(p: ndarray, d: int, a: Four, a_s: Four, b: Four, b_t: Four) -> Three:
    """One homogeneous coordinate and its first derivatives, from the polynomials of s and t and theirs."""
    r = _four(p, d, a)
    return _one(b, r), _one(b, _four(p, d, a_s)), _one(b_t, r)


@njit(cache=True, fastmath=CONTRACT, forceinline=True)
def first_jet(p: ndarray, box: ndarray, s: float, t: float) -> tuple[Three, Three, Three]:
    """S, S_s and S_t of one patch at (s, t): numbers, no arrays, which takes half the time."""
    x, y, h, k = _in_element(box, s, t)
    a = bernstein(x)
    a_s = bernstein_first(x, h)
    b = bernstein(y)
    b_t = bernstein_first(y, k)
    w, w_s, w_t = _coordinate(p, 3, a, a_s, b, b_t)
    x0, s0, t0 = _coordinate(p, 0, a, a_s, b, b_t)
    x1, s1, t1 = _coordinate(p, 1, a, a_s, b, b_t)
    x2, s2, t2 = _coordinate(p, 2, a, a_s, b, b_t)
    w = 1.0 / w
    x0, x1, x2 = x0 * w, x1 * w, x2 * w
    along = (s0 - w_s * x0) * w, (s1 - w_s * x1) * w, (s2 - w_s * x2) * w
    return (x0, x1, x2), along, ((t0 - w_t * x0) * w, (t1 - w_t * x1) * w, (t2 - w_t * x2) * w)


spread_first_jet = njit(inline="always")(first_jet.py_func)
"""`first_jet` written out where it is called: in the busiest loop that saves a tenth, and compiles for seconds."""


@njit(cache=True, fastmath=CONTRACT)
def first_derivatives(
    patches: ndarray, boxes: ndarray, element: ndarray, s: ndarray, t: ndarray, S: ndarray, S_s: ndarray, S_t: ndarray
) -> None:
    """Write S, S_s and S_t at each sample into arrays (n, 3)."""
    for n in range(len(s)):
        e = element[n]
        x, along, across = first_jet(patches[e], boxes[e], s[n], t[n])
        for d in range(3):
            S[n, d], S_s[n, d], S_t[n, d] = x[d], along[d], across[d]


@inner_njit(fastmath=CONTRACT)
def jet(p: ndarray, box: ndarray, s: float, t: float, D: ndarray) -> None:
    """Write S, S_s, S_t, S_ss, S_st, S_tt of one patch at (s, t) into the rows of D (6, 3)."""
    x, y, h, k = _in_element(box, s, t)
    a, a1, a2 = bernstein(x), bernstein_first(x, h), bernstein_second(x, h)
    b, b1, b2 = bernstein(y), bernstein_first(y, k), bernstein_second(y, k)
    w = ws = wt = wss = wst = wtt = 0.0
    for c in range(4):
        d = 3 - c  # the weight comes first
        A = As = At = Ass = Ast = Att = 0.0
        for j in range(4):
            p0, p1, p2, p3 = p[4 * j, d], p[4 * j + 1, d], p[4 * j + 2, d], p[4 * j + 3, d]
            r = a[0] * p0 + a[1] * p1 + a[2] * p2 + a[3] * p3
            r1 = a1[0] * p0 + a1[1] * p1 + a1[2] * p2 + a1[3] * p3
            r2 = a2[0] * p0 + a2[1] * p1 + a2[2] * p2 + a2[3] * p3
            A += b[j] * r
            At += b1[j] * r
            Att += b2[j] * r
            As += b[j] * r1
            Ast += b1[j] * r1
            Ass += b[j] * r2
        if c == 0:
            w = 1.0 / A
            ws, wt, wss, wst, wtt = As, At, Ass, Ast, Att
        else:
            q = A * w
            qs = (As - ws * q) * w
            qt = (At - wt * q) * w
            D[0, d], D[1, d], D[2, d] = q, qs, qt
            D[3, d] = (Ass - 2.0 * ws * qs - wss * q) * w
            D[4, d] = (Ast - ws * qt - wt * qs - wst * q) * w
            D[5, d] = (Att - 2.0 * wt * qt - wtt * q) * w


@njit(cache=True, fastmath=CONTRACT)
def second_derivatives(patches: ndarray, boxes: ndarray, element: ndarray, s: ndarray, t: ndarray, D: ndarray) -> None:
    """Write S and all derivatives to the second order at each sample into D (6, n, 3)."""
    one = np.empty((6, 3))
    for n in range(len(s)):
        jet(patches[element[n]], boxes[element[n]], s[n], t[n], one)
        for k in range(6):
            for d in range(3):
                D[k, n, d] = one[k, d]


@njit(cache=True, fastmath=CONTRACT)
def basis_values(
    starts: ndarray,
    functions: ndarray,
    coefficients: ndarray,
    weights: ndarray,
    boxes: ndarray,
    element: ndarray,
    s: ndarray,
    t: ndarray,
    order: int,
    indptr: ndarray,
    indices: ndarray,
    values: ndarray,
) -> None:
    """Write the rational basis R and its derivatives at each sample as CSR matrices with one pattern.

    With W = sum w B: R_s = (w B_s - R W_s) / W, R_ss = (w B_ss - 2 W_s R_s - W_ss R) / W, and so on.
    `indptr` is given; `indices` and `values` (1, 3 or 6, k) are written.
    """
    for n in range(len(s)):
        e = element[n]
        x, y, h, k = _in_element(boxes[e], s[n], t[n])
        a, a1, a2 = bernstein(x), bernstein_first(x, h), bernstein_second(x, h)
        b, b1, b2 = bernstein(y), bernstein_first(y, k), bernstein_second(y, k)
        W = Ws = Wt = Wss = Wst = Wtt = 0.0
        first = indptr[n]
        for m in range(starts[e], starts[e + 1]):
            C = coefficients[m]
            B = Bs = Bt = Bss = Bst = Btt = 0.0
            for j in range(4):
                c0, c1, c2, c3 = C[4 * j], C[4 * j + 1], C[4 * j + 2], C[4 * j + 3]
                r = a[0] * c0 + a[1] * c1 + a[2] * c2 + a[3] * c3
                B += b[j] * r
                if order > 0:
                    r1 = a1[0] * c0 + a1[1] * c1 + a1[2] * c2 + a1[3] * c3
                    Bs += b[j] * r1
                    Bt += b1[j] * r
                    if order > 1:
                        Bss += b[j] * (a2[0] * c0 + a2[1] * c1 + a2[2] * c2 + a2[3] * c3)
                        Bst += b1[j] * r1
                        Btt += b2[j] * r
            w = weights[functions[m]]
            q = first + m - starts[e]
            indices[q] = functions[m]
            values[0, q] = w * B
            W += w * B
            if order > 0:
                values[1, q], values[2, q] = w * Bs, w * Bt
                Ws += w * Bs
                Wt += w * Bt
                if order > 1:
                    values[3, q], values[4, q], values[5, q] = w * Bss, w * Bst, w * Btt
                    Wss += w * Bss
                    Wst += w * Bst
                    Wtt += w * Btt
        inverse = 1.0 / W
        for q in range(first, first + starts[e + 1] - starts[e]):
            R = values[0, q] * inverse
            values[0, q] = R
            if order > 0:
                Rs = (values[1, q] - R * Ws) * inverse
                Rt = (values[2, q] - R * Wt) * inverse
                values[1, q], values[2, q] = Rs, Rt
                if order > 1:
                    values[3, q] = (values[3, q] - 2.0 * Ws * Rs - Wss * R) * inverse
                    values[4, q] = (values[4, q] - Ws * Rt - Wt * Rs - Wst * R) * inverse
                    values[5, q] = (values[5, q] - 2.0 * Wt * Rt - Wtt * R) * inverse


@njit(inline="always")
def _strip(strip_knots: ndarray, strip_table: ndarray, t: float) -> int:
    """The last strip that starts at or below t. The table holds, for even slices of the t-range, the strip at
    which the search starts."""
    count = len(strip_knots) - 1
    slices = len(strip_table)
    k = strip_table[
        min(slices - 1, max(0, int((t - strip_knots[0]) * (slices / (strip_knots[count] - strip_knots[0])))))
    ]
    while k + 1 < count and strip_knots[k + 1] <= t:
        k += 1
    return k


@njit(inline="always")
def _slot(strip_starts: ndarray, lows: ndarray, highs: ndarray, tables: ndarray, k: int, s: float) -> int:
    """The last element of strip k that starts at or below s, its first one where there is none."""
    a = strip_starts[k]
    b = strip_starts[k + 1] - 1
    slots = tables.shape[1]
    i = tables[k, min(slots - 1, max(0, int((s - lows[a]) * (slots / (highs[b] - lows[a])))))]
    while i < b and lows[i + 1] <= s:
        i += 1
    return i


@inner_njit()
def locate_one(
    strip_knots: ndarray, strip_table: ndarray, strip_starts: ndarray, lows: ndarray, highs: ndarray,
    ids: ndarray, tables: ndarray,
    s: float, t: float,
) -> int:  # fmt: skip
    """The element that holds (s, t), its borders included; -1 where there is none.

    Strip k covers t in [strip_knots[k], strip_knots[k+1]]; its elements are sorted by their lower s.
    """
    k = _strip(strip_knots, strip_table, t)
    while k >= 0:
        i = _slot(strip_starts, lows, highs, tables, k, s)
        if lows[i] <= s <= highs[i]:
            return ids[i]
        if i > strip_starts[k] and highs[i - 1] == s:
            return ids[i - 1]
        if t > strip_knots[k]:
            return -1
        k -= 1
    return -1


@njit(cache=True)
def locate(
    strip_knots: ndarray, strip_table: ndarray, strip_starts: ndarray, lows: ndarray, highs: ndarray,
    ids: ndarray, tables: ndarray,
    s: ndarray, t: ndarray,
) -> ndarray:  # fmt: skip
    """The element of each sample, as `locate_one` finds it, without a call where the first guess is right."""
    elements = np.empty(len(s), dtype=np.int32)
    for n in range(len(s)):
        x = s[n]
        i = _slot(strip_starts, lows, highs, tables, _strip(strip_knots, strip_table, t[n]), x)
        if lows[i] <= x <= highs[i]:
            elements[n] = ids[i]
        else:
            elements[n] = locate_one(strip_knots, strip_table, strip_starts, lows, highs, ids, tables, x, t[n])
    return elements
