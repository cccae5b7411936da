"""A pole that is smooth stays smooth: the ring of control points next to it moves as one affine map of
itself.

Each of the ring's points alone could leave the plane they share with the pole, which then becomes the tip of
a cone, and folds.
"""

import numpy as np
import scipy.sparse as sp

from bonecam.surface.tspline import TSpline

FLAT = 1e-6
"""Thickness of a ring, as a share of its size, that counts as none."""


def free_moves(surface: TSpline) -> sp.csr_array:
    """B of moves = B d: the moves of all control points (c) from those d (m) that are free. Of a ring round a
    pole with two directions in its plane, two points are: the others are where the affine map of pole and
    ring that they give takes them."""
    starts, size = surface.tmesh.row_starts, surface.tmesh.size
    B = sp.lil_array(sp.eye_array(size))
    bound = np.zeros(size, dtype=bool)
    for has_pole, pole, ring in zip(
        surface.tmesh.poles, (0, size - 1), (range(starts[1], starts[2]), range(starts[-3], starts[-2]))
    ):
        points = np.array(ring)
        offsets = surface.control_points[points] - surface.control_points[pole]
        _, sizes, axes = np.linalg.svd(offsets, full_matrices=False)
        flat = offsets @ axes[sizes > FLAT * sizes[0]].T
        count = flat.shape[1]
        if not has_pole or len(points) <= count:
            continue

        # As many of the points as they have coordinates, the farthest first, each next one as independent of those as
        # can be
        leading: list[int] = []
        rest = flat.copy()
        for _ in range(flat.shape[1]):
            leading.append(int(np.argmax(np.linalg.norm(rest, axis=1))))
            away = rest[leading[-1]] / np.linalg.norm(rest[leading[-1]])
            rest = rest - (rest @ away)[:, None] * away

        shares = flat @ np.linalg.inv(flat[leading])
        B[points, :] = 0.0
        B[points, pole] = 1 - shares.sum(1)
        for k in range(count):
            B[points, points[leading[k]]] = shares[:, k]
        bound[np.delete(points, leading)] = True
    return sp.csr_array(sp.csc_array(B)[:, np.flatnonzero(~bound)])
