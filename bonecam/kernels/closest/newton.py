"""Closest points on a rational bicubic surface: damped Newton on |S(s, t) - p|^2 / 2, compiled.

The step takes the full Hessian (Piegl & Tiller 1997, section 6.1) where it is positive and leaves the second
derivatives out (Gauss-Newton) elsewhere. Every step must bring the point nearer. `into_domain` is the one
place that says what a step over a pole, a seam or an open border leads to.
"""

import numpy as np
from numpy import ndarray

from bonecam.kernels import inner_njit, njit
from bonecam.kernels.bezier.bicubic import jet
from bonecam.kernels.bezier.element_search import locate_one
from bonecam.kernels.fastmath import CONTRACT

MAX_STEPS = 60
"""Steps from one seed: Newton needs under ten but where it starts far away on a folded surface."""

ROUNDING_GAIN = 1e-8
"""Share of |S - p|^2: a step that promises a smaller gain is too short for the gain to be measured in doubles."""

POLISHING_STEPS = 3
"""Newton steps that are taken unmeasured once the gain is below ROUNDING_GAIN."""

MAX_HALVINGS = 30
"""Halvings of one step that leads away: 2^-30 of it is rounding."""

SINGULAR = 1e-12
"""Share of the product of the Hessian's diagonal: with a smaller determinant Newton's step is not taken."""

SAME_SEED = 0.55
"""Share of the longest step: seeds that are nearer to each other in s and in t lead to one closest point."""


@inner_njit(fastmath=CONTRACT)
def _half_square(D: ndarray, p: ndarray) -> float:
    return 0.5 * ((D[0, 0] - p[0]) ** 2 + (D[0, 1] - p[1]) ** 2 + (D[0, 2] - p[2]) ** 2)


@inner_njit()
def into_domain(s: float, t: float, domain: ndarray, period: ndarray, poles: ndarray) -> tuple[float, float]:
    """(s, t) brought back into the domain: round a closed direction, over a pole to the other side, else to
    the border."""
    if t < domain[1, 0]:
        if poles[0]:
            s, t = s + 0.5 * period[0], min(2.0 * domain[1, 0] - t, domain[1, 1])
        elif period[1] > 0.0:
            t += period[1]
        else:
            t = domain[1, 0]
    if t > domain[1, 1]:
        if poles[1]:
            s, t = s + 0.5 * period[0], max(2.0 * domain[1, 1] - t, domain[1, 0])
        elif period[1] > 0.0:
            t -= period[1]
        else:
            t = domain[1, 1]
    if period[0] > 0.0:
        x = (s - domain[0, 0]) / period[0]
        s = domain[0, 0] + period[0] * (x - np.floor(x))
    return min(max(s, domain[0, 0]), domain[0, 1]), min(max(t, domain[1, 0]), domain[1, 1])


@njit(inline="always")
def gauss_newton_step(E: float, F: float, G: float, a: float, b: float, scale: float) -> tuple[float, float]:
    """The step (ds, dt) of [E F; F G] (ds, dt) = (a, b), `scale` = 1 / determinant, where E = S_s . S_s,
    F = S_s . S_t, G = S_t . S_t, and a, b are the products of the way to the point with S_s and S_t."""
    return (G * a - F * b) * scale, (E * b - F * a) * scale


@inner_njit(fastmath=CONTRACT)
def _step(D: ndarray, p: ndarray) -> tuple[float, float, float, bool]:
    """Newton's step on |S - p|^2 / 2, Gauss-Newton's where the Hessian is not positive; its slope; whether it
    is Newton's."""
    g0 = g1 = E = F = G = a = b = c = 0.0
    for d in range(3):
        r = D[0, d] - p[d]
        g0 += r * D[1, d]
        g1 += r * D[2, d]
        E += D[1, d] * D[1, d]
        F += D[1, d] * D[2, d]
        G += D[2, d] * D[2, d]
        a += r * D[3, d]
        b += r * D[4, d]
        c += r * D[5, d]
    a, b, c = a + E, b + F, c + G
    det = a * c - b * b
    newton = a > 0.0 and c > 0.0 and det > SINGULAR * a * c
    if not newton:
        a, b, c = E * (1 + SINGULAR), F, G * (1 + SINGULAR)
        det = a * c - b * b
    if det > 0.0:
        x, y = -(c * g0 - b * g1) / det, -(a * g1 - b * g0) / det
    else:
        x, y = 0.0, -g1 / G if G > 0.0 else 0.0
    return x, y, g0 * x + g1 * y, newton


@inner_njit(fastmath=CONTRACT)
def _step_along(D: ndarray, p: ndarray, axis: int) -> tuple[float, float]:
    """The step in one parameter alone and its slope: Newton's, Gauss-Newton's where the second derivative is
    not positive."""
    g = G = c = 0.0
    for d in range(3):
        r = D[0, d] - p[d]
        g += r * D[1 + axis, d]
        G += D[1 + axis, d] * D[1 + axis, d]
        c += r * D[3 + 2 * axis, d]
    c = c + G if c + G > 0.0 else G
    step = -g / c if c > 0.0 else 0.0
    return step, g * step


@inner_njit(fastmath=CONTRACT)
def descend(
    patches: ndarray, boxes: ndarray, strips: tuple, domain: ndarray, period: ndarray, poles: ndarray,
    limit: ndarray, p: ndarray,
    s: float, t: float, D: ndarray,
) -> tuple[float, float, float]:  # fmt: skip
    """Parameters of the closest point reached from one seed (s, t), and half the squared distance."""
    s, t = into_domain(s, t, domain, period, poles)
    e = locate_one(*strips, s, t)
    jet(patches[e], boxes[e], s, t, D)
    value = _half_square(D, p)
    polished = 0
    for _ in range(MAX_STEPS):
        x, y, slope, newton = _step(D, p)
        if not poles[0] and period[1] == 0.0 and t <= domain[1, 0]:
            y = max(y, 0.0)
        if not poles[1] and period[1] == 0.0 and t >= domain[1, 1]:
            y = min(y, 0.0)
        if period[0] == 0.0 and ((s <= domain[0, 0] and x < 0.0) or (s >= domain[0, 1] and x > 0.0)):
            x = 0.0
            y, slope = _step_along(D, p, 1)
        elif (
            period[0] == 0.0
            and period[1] == 0.0
            and (t <= domain[1, 0] or t >= domain[1, 1])
            and (y == 0.0 or (y > 0.0) == (t > domain[1, 0]))
        ):
            y = 0.0
            x, slope = _step_along(D, p, 0)
        shrink = max(1.0, max(abs(x) / limit[0], abs(y) / limit[1]))
        x, y = x / shrink, y / shrink
        # so near that |S - p| cannot measure the gain any more: Newton's step is trusted
        near = newton and shrink == 1.0 and -slope <= ROUNDING_GAIN * value
        moved, part = False, 1.0
        for _ in range(MAX_HALVINGS):
            s1, t1 = into_domain(s + x, t + y, domain, period, poles)
            e = locate_one(*strips, s1, t1)
            if e >= 0:
                jet(patches[e], boxes[e], s1, t1, D)
                new = _half_square(D, p)
                if new < value or near:
                    moved = True
                    break
            else:  # into a notch of the domain: to the border of the element, and along it
                e = locate_one(*strips, s, t)
                s1 = min(max(s + x, boxes[e, 0]), boxes[e, 1])
                t1 = min(max(t + y, boxes[e, 2]), boxes[e, 3])
                if s1 == s or t1 == t:
                    jet(patches[e], boxes[e], s, t, D)
                    if s1 == s:
                        t1 = min(max(t + _step_along(D, p, 1)[0] * part, boxes[e, 2]), boxes[e, 3])
                    else:
                        s1 = min(max(s + _step_along(D, p, 0)[0] * part, boxes[e, 0]), boxes[e, 1])
                jet(patches[e], boxes[e], s1, t1, D)
                new = _half_square(D, p)
                if new < value:
                    moved = True
                    break
            part *= 0.5
            x, y = 0.5 * x, 0.5 * y
        if not moved:
            break
        value, s, t = new, s1, t1
        if near:
            polished += 1
            if polished == POLISHING_STEPS or -slope <= 1e-30 * value:
                break
    return s, t, value


@njit(cache=True)
def closest_of_seeds(
    patches: ndarray, boxes: ndarray, strips: tuple, domain: ndarray, period: ndarray, poles: ndarray,
    limit: ndarray, points: ndarray,
    seeds: ndarray, s: ndarray, t: ndarray, squared: ndarray,
) -> None:  # fmt: skip
    """s, t and the squared distance of the closest point that is reached from the seeds (n, k, 2) of each point.

    `limit` (2,) is the longest step in s and t. A seed near one that was tried is left out.
    """
    D = np.empty((6, 3))
    for n in range(len(points)):
        best = np.inf
        for k in range(seeds.shape[1]):
            known = False
            for j in range(k):
                ds = abs(seeds[n, k, 0] - seeds[n, j, 0])
                if period[0] > 0.0:
                    ds = min(ds, period[0] - ds)
                if ds <= SAME_SEED * limit[0] and abs(seeds[n, k, 1] - seeds[n, j, 1]) <= SAME_SEED * limit[1]:
                    known = True
            if known:
                continue
            a, b, value = descend(
                patches, boxes, strips, domain, period, poles, limit, points[n], seeds[n, k, 0], seeds[n, k, 1], D
            )  # fmt: skip
            if value < best:
                best, s[n], t[n] = value, a, b
        squared[n] = 2.0 * best
