"""The patches that certificates bound: their nets of Bezier control points, and the nets of their
quarters."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.surface.tmesh.row_tmesh import RowTMesh
from bonecam.surface.tspline import TSpline

HALVES = (
    np.array(
        [
            [[8, 0, 0, 0], [4, 4, 0, 0], [2, 4, 2, 0], [1, 3, 3, 1]],
            [[1, 3, 3, 1], [0, 2, 4, 2], [0, 0, 4, 4], [0, 0, 0, 8]],
        ]
    )
    / 8
)
"""Two 4 x 4 matrices that lead the control points of a cubic Bezier curve to those of its first and second
half (de Casteljau's algorithm at 1/2)."""

CORNERS = [0, 3, 12, 15]
"""Control points of a net at the corners of its patch."""


def certifiable(surface: TSpline) -> bool:
    """Whether it is a closed row-structured T-spline with poles and weights of one."""
    return isinstance(surface.tmesh, RowTMesh) and surface.poles == (True, True) and bool((surface.weights == 1).all())


def bezier_nets(surface: TSpline) -> Float[ndarray, "e 16 3"]:
    """Bezier control points of every element, s fastest.

    Raises ValueError for a surface that is not `certifiable`.
    """
    if not certifiable(surface):
        raise ValueError(
            "certificates are for row-structured T-splines that are closed, with two poles, and have weights of one"
        )
    return np.ascontiguousarray(surface.patches[:, :, :3])


def quarter_nets(nets: Float[ndarray, "e 16 3"]) -> Float[ndarray, "f 16 3"]:
    """The nets of the four quarters of every patch."""
    quarters = np.einsum("aik,bjl,nklx->nabijx", HALVES, HALVES, nets.reshape(-1, 4, 4, 3))
    return np.ascontiguousarray(quarters.reshape(-1, 16, 3))
