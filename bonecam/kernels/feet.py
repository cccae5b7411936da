"""Feet of points on a level near which they are known to lie: a few steps of Gauss-Newton from given
parameters, compiled.

s is periodic over [0, 1); t is held between two rings `ends` next to the poles, within which the surface is
as good as straight.
"""

import numpy as np
from numba import njit
from numpy import ndarray

from bonecam.kernels.bezier import CONTRACT, Three, first_jet, locate_one

STEP_S, STEP_T, RIDGE = 0.05, 0.03, 1e-6
SHORT = 2e-4
"""A step (mm) that is not worth going: what is left of the distance is its square over twice the distance."""
TIP = 32
TINY = np.finfo(np.float64).tiny


@njit(inline="always")
def _dot(a: Three, b: Three) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(inline="always")
def _cross(a: Three, b: Three) -> Three:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(inline="always")
def _times(factor: float, a: Three) -> Three:
    return factor * a[0], factor * a[1], factor * a[2]


@njit(inline="always")
def _minus(a: Three, b: Three) -> Three:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@njit(inline="always")
def _unit(a: Three) -> Three:
    size = np.sqrt(_dot(a, a))
    return _times(1.0 / size, a) if size > 0.0 else a


@njit(cache=True, fastmath=CONTRACT)
def _tip(patches: ndarray, boxes: ndarray, strips: tuple, end: float) -> Three:
    """The mean normal round a pole, which may be the tip of a cone."""
    n = 0.0, 0.0, 0.0
    for k in range(TIP):
        e = locate_one(*strips, k / TIP, end)
        _, S_s, S_t = first_jet(patches[e], boxes[e], k / TIP, end)
        n = _minus(n, _cross(S_t, S_s))
    return _unit(n)


@njit(cache=True, fastmath=CONTRACT, nogil=True)
def feet(
    patches: ndarray, boxes: ndarray, strips: tuple, domain: tuple, ends: tuple, y: ndarray, steps: int, s: ndarray, t: ndarray,
    foot: ndarray, normal: ndarray, clear_of: float, enough: ndarray,
) -> None:  # fmt: skip
    """s and t become the parameters of the nearest place to y that `steps` steps from them came by, `foot`
    and `normal` what is there. A place as near as `enough` ends the search.

    The steps are damped where S_s vanishes, halved where they lead away (farther off than the radius of
    curvature they go too far), and neither long nor SHORT. From the ends the foot goes straight on towards
    the pole (the ring of a whole femur is 0.06 mm off), and the normal is the mean one round it. Farther than
    `clear_of` from the foot the direction from it, or towards it, stands for the normal.

    Most places are in the element of the one before, which is looked at first.
    """
    first, last = _tip(patches, boxes, strips, ends[0]), _tip(patches, boxes, strips, ends[1])
    e = 0
    for l in range(len(y)):
        p = y[l, 0], y[l, 1], y[l, 2]
        u, v, ds, dt, best = s[l] - np.floor(s[l]), min(max(t[l], ends[0]), ends[1]), 0.0, 0.0, np.inf
        nearest_u, nearest_v, nearest, n = u, v, p, p
        for _ in range(steps + 1):
            if not (boxes[e, 0] <= u < boxes[e, 1] and boxes[e, 2] <= v < boxes[e, 3]):
                e = locate_one(*strips, u, v)
            x, S_s, S_t = first_jet(patches[e], boxes[e], u, v)
            r = _minus(p, x)
            square = _dot(r, r)
            if square < best:
                best, nearest_u, nearest_v, nearest, n = square, u, v, x, _cross(S_s, S_t)
                if square <= enough[l] * enough[l]:
                    break
                F, G, a, b = _dot(S_s, S_t), _dot(S_t, S_t), _dot(r, S_s), _dot(r, S_t)
                E = _dot(S_s, S_s) + RIDGE * G
                across = E * G - F * F * (1.0 - RIDGE)
                if across <= 0.0:
                    break
                across = 1.0 / across
                ds, dt = (G * a - F * b) * across, (E * b - F * a) * across
                if E * ds * ds + 2.0 * F * ds * dt + G * dt * dt < SHORT * SHORT:
                    break
                far = max(abs(ds) / STEP_S, abs(dt) / STEP_T)
                if far > 1.0:
                    ds, dt = ds / far, dt / far
            else:
                ds, dt = 0.5 * ds, 0.5 * dt
            u = nearest_u + ds
            u -= np.floor(u)
            v = min(max(nearest_v + dt, ends[0]), ends[1])
        n = first if nearest_v == ends[0] else last if nearest_v == ends[1] else _unit(n)
        end = domain[0] if nearest_v == ends[0] else domain[1] if nearest_v == ends[1] else nearest_v
        if end != nearest_v:
            e = locate_one(*strips, nearest_u, end)
            tip = first_jet(patches[e], boxes[e], nearest_u, end)[0]
            along = _minus(nearest, tip)
            share = min(max(_dot(_minus(p, tip), along) / max(_dot(along, along), TINY), 0.0), 1.0)
            nearest_v, nearest = end + share * (nearest_v - end), _minus(tip, _times(-share, along))
            r = _minus(p, nearest)
            best = _dot(r, r)
        if best > clear_of * clear_of:
            r = _minus(p, nearest)
            n = _times(1.0 / np.copysign(np.sqrt(best), _dot(r, n)), r)
        s[l], t[l] = nearest_u, nearest_v
        for i in range(3):
            foot[l, i], normal[l, i] = nearest[i], n[i]
