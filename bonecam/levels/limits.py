"""The limits of one level's program, each as linear rows over the control points' moves x = (dx, dy, dz stacked).

depth     a box in each control point's own frame: [0, up] along its direction, +-side across it
wall      a control point stays on the inner side of its own limit plane

Nesting and the stock at the samples are held by projections in `step.py`.
"""

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float
from numpy import ndarray

from bonecam.levels.solve import Rows


def frames(directions: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3 3"]:
    """Right-handed unit frames whose first axes are the directions (zero directions give any frame)."""
    size = np.linalg.norm(directions, axis=1, keepdims=True)
    u = np.where(size > 0, directions / np.maximum(size, np.finfo(float).tiny), [1.0, 0.0, 0.0])
    a = np.cross(u, np.eye(3)[np.argmin(np.abs(u), axis=1)])
    a /= np.linalg.norm(a, axis=1, keepdims=True)
    return np.stack([u, a, np.cross(u, a)], axis=1)


def depth_box(frame: Float[ndarray, "n 3 3"], up: Float[ndarray, "n"], side: Float[ndarray, "n"]) -> Rows:
    """Moves within [0, up] along the first axis and +-side along the others."""
    A = sp.block_array([[sp.diags_array(frame[:, i, j]) for j in range(3)] for i in range(3)], format="csr")
    return Rows(A, np.concatenate([0 * up, -side, -side]), np.concatenate([up, side, side]))


def planes(normals: Float[ndarray, "n 3"], low: Float[ndarray, "n"], high: Float[ndarray, "n"]) -> Rows:
    """low <= n_i . dP_i <= high for every control point."""
    return Rows(sp.csr_array(sp.hstack([sp.diags_array(normals[:, j]) for j in range(3)])), low, high)
