"""Linear limits low <= A x <= high of a quadratic program."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float
from numpy import ndarray


@dataclass(frozen=True, eq=False)
class LinearLimits:
    """low <= A x <= high, a row of A each."""

    A: sp.csr_array
    low: Float[ndarray, "r"]
    high: Float[ndarray, "r"]


def stack_limits(*limits: LinearLimits) -> LinearLimits:
    """The limits of all of them at once."""
    A = sp.csr_array(sp.vstack([one.A for one in limits]))
    low = np.concatenate([one.low for one in limits])
    high = np.concatenate([one.high for one in limits])
    return LinearLimits(A, low, high)
