"""Feet of points on a level near which they are known to lie: a few steps of Gauss-Newton from given parameters, compiled.

s is periodic over [0, 1); t is held between two rings `ends` next to the poles.
"""

import numpy as np
from numba import njit
from numpy import ndarray

from bonecam.kernels.bezier import CONTRACT, first_jet, locate_one, located

STEP_S, STEP_T, RIDGE = 0.05, 0.03, 1e-6
SHORT = 2e-4
"""A step (mm) that is not worth going: what is left of the distance is its square over twice the distance."""
TIP = 32


@njit(inline="always")
def _normal(D: ndarray, n: ndarray) -> None:
    """S_s x S_t."""
    n[0] = D[1, 1] * D[2, 2] - D[1, 2] * D[2, 1]
    n[1] = D[1, 2] * D[2, 0] - D[1, 0] * D[2, 2]
    n[2] = D[1, 0] * D[2, 1] - D[1, 1] * D[2, 0]


@njit(inline="always")
def _unit(n: ndarray) -> None:
    size = np.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
    if size > 0.0:
        for i in range(3):
            n[i] /= size


@njit(cache=True, fastmath=CONTRACT)
def _tips(patches: ndarray, boxes: ndarray, strips: tuple, ends: tuple) -> ndarray:
    """The mean normals round the two poles, which may be tips of cones."""
    D, n, tips = np.empty((3, 4)), np.empty(3), np.zeros((2, 3))
    for end in range(2):
        for k in range(TIP):
            s = k / TIP
            e = locate_one(*strips, s, ends[end])
            first_jet(patches[e], boxes[e], s, ends[end], D)
            _normal(D, n)
            tips[end] += n
        _unit(tips[end])
    return tips


@njit(cache=True, fastmath=CONTRACT, nogil=True)
def feet(
    patches: ndarray, boxes: ndarray, strips: tuple, ends: tuple, y: ndarray, steps: int, s: ndarray, t: ndarray, foot: ndarray,
    normal: ndarray, clear_of: float, enough: ndarray,
) -> None:  # fmt: skip
    """s and t become the parameters of the nearest place to y that `steps` steps from them came by, `foot` and `normal` what is there.
    A place as near as `enough` ends the search.

    The steps are damped where S_s vanishes, halved where they lead away (farther off than the radius of curvature they go too far), and
    neither long nor SHORT. At the ends the normal is the mean one round the pole; farther than `clear_of` from the foot the direction from
    it, or towards it, stands for the normal.
    """
    tips, D = _tips(patches, boxes, strips, ends), np.empty((3, 4))
    strip_knots, strip_table, strip_starts, lows, highs, ids, tables = strips
    for l in range(len(y)):
        u, v, ds, dt, best = s[l] - np.floor(s[l]), min(max(t[l], ends[0]), ends[1]), 0.0, 0.0, np.inf
        for _ in range(steps + 1):
            e = located(strip_knots, strip_table, strip_starts, lows, highs, ids, tables, u, v)
            first_jet(patches[e], boxes[e], u, v, D)
            E = F = G = a = b = square = 0.0
            for i in range(3):
                r = y[l, i] - D[0, i]
                square += r * r
                E += D[1, i] * D[1, i]
                F += D[1, i] * D[2, i]
                G += D[2, i] * D[2, i]
                a += r * D[1, i]
                b += r * D[2, i]
            if square < best:
                best, s[l], t[l] = square, u, v
                foot[l] = D[0, :3]
                _normal(D, normal[l])
                if square <= enough[l] * enough[l]:
                    break
                E += RIDGE * G
                across = E * G - F * F * (1.0 - RIDGE)
                if across <= 0.0:
                    break
                ds, dt = (G * a - F * b) / across, (E * b - F * a) / across
                if E * ds * ds + 2.0 * F * ds * dt + G * dt * dt < SHORT * SHORT:
                    break
                far = max(1.0, abs(ds) / STEP_S, abs(dt) / STEP_T)
                ds, dt = ds / far, dt / far
            else:
                ds, dt = 0.5 * ds, 0.5 * dt
            u = s[l] + ds
            u -= np.floor(u)
            v = min(max(t[l] + dt, ends[0]), ends[1])
        if t[l] == ends[0]:
            normal[l] = tips[0]
        elif t[l] == ends[1]:
            normal[l] = tips[1]
        else:
            _unit(normal[l])
        if best > clear_of * clear_of:
            height = 0.0
            for i in range(3):
                height += (y[l, i] - foot[l, i]) * normal[l, i]
            size = np.copysign(np.sqrt(best), height)
            for i in range(3):
                normal[l, i] = (y[l, i] - foot[l, i]) / size
