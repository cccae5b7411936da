"""Limits of the published program: second-order cones and planes at points of a level."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float
from numpy import ndarray


@dataclass(frozen=True, eq=False)
class Cones:
    """|R_l x - centre_l - tau_l axis| <= radius_l, 0 <= tau_l <= 1, for moves x (c, 3) of the control points,
    lengths in mm.

    With `axis` None there is no tau: balls. With one: capsules, exactly (their nearest axis point moves
    along).
    """

    R: sp.csr_array
    centres: Float[ndarray, "k 3"]
    radii: Float[ndarray, " k"]
    axis: Float[ndarray, "3"] | None = None

    @property
    def slides(self) -> int:
        """How many tau there are."""
        return 0 if self.axis is None else len(self.radii)


@dataclass(frozen=True, eq=False)
class Planes:
    """normal_l . R_l x <= high_l, mm."""

    R: sp.csr_array
    normals: Float[ndarray, "k 3"]
    high: Float[ndarray, " k"]

    def and_planes(self, other: "Planes") -> "Planes":
        """The planes of both."""
        R = sp.csr_array(sp.vstack([self.R, other.R]))
        return Planes(R, np.vstack([self.normals, other.normals]), np.concatenate([self.high, other.high]))
