"""The rational basis and its derivatives at given parameters, compiled: rows of sparse matrices."""

from numpy import ndarray

from bonecam.kernels import njit
from bonecam.kernels.bezier.bicubic import bernstein, bernstein_first, bernstein_second
from bonecam.kernels.fastmath import CONTRACT


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
        h, k = 1.0 / (boxes[e, 1] - boxes[e, 0]), 1.0 / (boxes[e, 3] - boxes[e, 2])
        x, y = (s[n] - boxes[e, 0]) * h, (t[n] - boxes[e, 2]) * k
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
