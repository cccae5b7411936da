"""Linear limits low <= A x <= high of a quadratic program."""

from dataclasses import dataclass

import scipy.sparse as sp
from jaxtyping import Float
from numpy import ndarray


@dataclass(frozen=True, eq=False)
class LinearLimits:
    """low <= A x <= high, a row of A each."""

    A: sp.csr_array
    low: Float[ndarray, "r"]
    high: Float[ndarray, "r"]
