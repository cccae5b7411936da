"""The faces of a T-mesh in index space: cells joined where no edge parts them."""

import numpy as np
import scipy.sparse as sp
from numpy import ndarray
from scipy.sparse.csgraph import connected_components

from bonecam.errors import SurfaceError


def face_rectangles(
    widths: ndarray, heights: ndarray, inside: ndarray, along_s: ndarray, along_t: ndarray
) -> ndarray:
    """Cells joined where no edge parts them, as boxes of line numbers; what lies across a seam is parted
    there.

    Only the part of a face that has an area must be a rectangle: at a clamped corner that turns inwards empty
    cells are missing.
    """
    p, q = inside.shape
    cell = np.arange(p * q).reshape(p, q)
    joined_s = inside[:-1] & inside[1:] & ~along_t[1:p, :q]
    joined_t = inside[:, :-1] & inside[:, 1:] & ~along_s[:p, 1:q]
    pairs = [(cell[:-1][joined_s], cell[1:][joined_s]), (cell[:, :-1][joined_t], cell[:, 1:][joined_t])]
    a, b = (np.concatenate([pair[k] for pair in pairs]) for k in (0, 1))
    label = connected_components(
        sp.coo_array((np.ones(len(a)), (a, b)), shape=(p * q, p * q)), directed=False
    )[1].reshape(p, q)
    counted = inside & (widths > 0)[:, None] & (heights > 0)
    i, j = np.nonzero(counted)
    kinds, group = np.unique(label[counted], return_inverse=True)
    low = np.full((2, len(kinds)), p + q)
    high = np.full((2, len(kinds)), -1)
    for k, index in enumerate((i, j)):
        np.minimum.at(low[k], group, index)
        np.maximum.at(high[k], group, index + 1)
    full = np.array(
        [
            np.count_nonzero(widths[s0:s1]) * np.count_nonzero(heights[t0:t1])
            for s0, t0, s1, t1 in zip(*low, *high)
        ]
    )
    wrong = np.flatnonzero(full != np.bincount(group, minlength=len(kinds)))
    if len(wrong):
        place = low[:, wrong[0]]
        raise SurfaceError(
            f"the face round cell ({place[0]}, {place[1]}) is not a rectangle of index lines", cell=place
        )
    return np.column_stack([low[0], high[0], low[1], high[1]])
