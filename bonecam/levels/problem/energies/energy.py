"""What an energy of a level's program is: a function of what is `Given` that yields its matrices, of one of
two kinds.

    Quadratic   D'(matrix)D + 2 linear . D                   of the control net, D its free moves (`free_moves`)
    Pulled      sum_l w_l |S_new - H_l|^2                    of samples

A new one is a new file here with one such function, and its name in NET or SAMPLED of `program.py`.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float
from numpy import ndarray

from bonecam.levels.problem.cut import Cut, StepParameters
from bonecam.levels.problem.discretisation import Discretisation
from bonecam.levels.problem.remaining import Remaining
from bonecam.surface.tspline import TSpline


@dataclass(frozen=True, eq=False)
class Given:
    """What a level is made from: the level `before`, from which `rest` is left to the stock, and how."""

    discretisation: Discretisation
    before: TSpline
    rest: Remaining
    cut: Cut
    parameters: StepParameters


@dataclass(frozen=True, eq=False)
class Quadratic:
    """D'(matrix)D + 2 linear . D; the matrix is symmetric, positive semidefinite, and the same for x, y and
    z."""

    matrix: sp.csc_array
    linear: Float[ndarray, "m 3"]


@dataclass(frozen=True, eq=False)
class Pulled:
    """Samples at parameters (s, t), now at x = R P, that should be at `target`; H lies `beyond` times as far
    from the target's foot."""

    s: Float[ndarray, " k"]
    t: Float[ndarray, " k"]
    R: sp.csr_array
    x: Float[ndarray, "k 3"]
    weights: Float[ndarray, " k"]
    target: Float[ndarray, "k 3"]
    beyond: Float[ndarray, " k"]


def add(parts: Sequence[Quadratic]) -> Quadratic:
    """The sum of the energies."""
    first, *others = parts
    matrix, linear = first.matrix, first.linear
    for other in others:
        matrix, linear = matrix + other.matrix, linear + other.linear
    return Quadratic(sp.csc_array(matrix), linear)


def stack(parts: Sequence[Pulled]) -> Pulled:
    """The samples of all of them as one energy."""
    s, t, x, weights, target, beyond = (
        np.concatenate([getattr(part, name) for part in parts])
        for name in ("s", "t", "x", "weights", "target", "beyond")
    )
    return Pulled(
        s, t, R=sp.csr_array(sp.vstack([part.R for part in parts])), x=x, weights=weights, target=target, beyond=beyond
    )
