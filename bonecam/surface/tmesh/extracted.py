"""A T-mesh that is known by its Bezier elements only: what an .iga file gives, extraordinary points included.

The elements share no chart, so each has a parameter square of its own: element e is [2 e, 2 e + 1] x [0, 1].
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int64
from numpy import ndarray

from bonecam.surface.basis.elements import Elements


@dataclass(frozen=True, eq=False)
class ExtractedTMesh:
    """`size` functions, of which functions[starts[e]:starts[e+1]] live on element e with Bernstein
    coefficients (k, c), s fastest."""

    size: int
    starts: Int64[ndarray, " e1"]
    functions: Int64[ndarray, " k"]
    coefficients: Float[ndarray, "k c"]

    @property
    def poles(self) -> tuple[bool, bool]:
        """There is no common direction that could have poles."""
        return False, False

    @property
    def domain(self) -> Float[ndarray, "2 2"]:
        """[[0, 2 e - 1], [0, 1]]: with gaps between the elements."""
        return self.elements.domain

    @cached_property
    def elements(self) -> Elements:
        """The Bezier elements, side by side."""
        low = 2.0 * np.arange(len(self.starts) - 1)
        boxes = np.column_stack([low, low + 1, np.zeros_like(low), np.ones_like(low)])
        return Elements(boxes, self.starts, self.functions, self.coefficients)
