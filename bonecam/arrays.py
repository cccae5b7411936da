"""Frozen arrays (what a value that exists holds, nobody changes), and sums row by row."""

from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from numpy.typing import DTypeLike


def frozen(values: Any, dtype: DTypeLike = np.float64) -> Any:
    """A read-only, C-contiguous copy of `values`."""
    array = np.array(values, dtype=dtype, order="C")
    array.setflags(write=False)
    return array


def dots(a: Float[ndarray, "n d"], b: Float[ndarray, "n d"]) -> Float[ndarray, " n"]:
    """a . b row by row."""
    return np.asarray(np.einsum("ij,ij->i", a, b))


def lengths(a: Float[ndarray, "n d"]) -> Float[ndarray, " n"]:
    """|a| row by row."""
    return np.asarray(np.sqrt(dots(a, a)))
