"""Frozen arrays: what a value that exists holds, nobody changes."""

from typing import Any

import numpy as np
from numpy.typing import DTypeLike


def frozen(values: Any, dtype: DTypeLike = np.float64) -> Any:
    """A read-only, C-contiguous copy of `values`."""
    array = np.array(values, dtype=dtype, order="C")
    array.setflags(write=False)
    return array
