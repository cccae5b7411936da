"""The quadratic program of one level, on the free moves D of the control points (`free_moves`).

    min  int |S_new - H|^2 + stiffness D'MD + bending P_new'M P_new        S_new = S + R D, over the surface
    s.t. depth, nesting and stock at samples

The energies are those listed in NET (of the control net) and SAMPLED (of samples), each a file of `energies/`;
the limits are files of `limits/`. `levels/solvers` solves the program.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.arrays import dots, lengths
from bonecam.levels.problem.cut import Cut, StepParameters
from bonecam.levels.problem.discretisation import Discretisation
from bonecam.levels.problem.energies.energy import Given, Quadratic, add, stack
from bonecam.levels.problem.energies.farthest import farthest
from bonecam.levels.problem.energies.pull import pull
from bonecam.levels.problem.energies.thin_plate import plate
from bonecam.levels.problem.factorisation import factorise
from bonecam.levels.problem.limits.planes import Limits, heights, limits_at
from bonecam.levels.problem.limits.reverse_depth import reverse_depths
from bonecam.levels.problem.limits.wall import inside
from bonecam.levels.problem.remaining import Remaining
from bonecam.levels.problem.samples import gram

NET = (plate,)
SAMPLED = (pull, farthest)
"""The energies of a program: those of the control net, and those of samples."""
TOO_FAR = 0.001
"""A sample is in a hollow once it is so much (mm) farther from the new level than the cut is deep. (Without this
limit a bone of 17 cuts takes 18.)"""
MOST_BENT = 2.5
"""Bending alone takes no sample farther than so many depths: it grows with the part, and that of a femur would sweep
its neck out of all limits."""
PRESS = 0.1
"""How far (mm) outside the stock samples may be pulled: what is pressed against the wall lies there, where
levels meet it too."""


@dataclass(frozen=True, eq=False)
class LevelProgram:
    """min sum_l w_l |x_l + R_l D - H_l|^2 + D'(matrix)D + 2 linear . D within `limits`, set up at the
    targets; `net` is the second half.

    The samples are at parameters (s, t); the moves of all control points are `free` times D. From where
    `hollow` samples are now the new level has become too far once (`reverse_depth.py`): they are limited along the way
    from there to it.
    """

    s: Float[ndarray, " k"]
    t: Float[ndarray, " k"]
    free: sp.csr_array
    hollow: Bool[ndarray, " k"]
    R: sp.csr_array
    x: Float[ndarray, "k 3"]
    weights: Float[ndarray, " k"]
    H: Float[ndarray, "k 3"]
    start: Float[ndarray, "k 3"]
    limits: Limits
    net: Quadratic

    @property
    def matrix(self) -> sp.csc_array:
        """Half the energy's second derivative, for each of x, y and z."""
        return sp.csc_array(gram(self.R, self.weights) + self.net.matrix)

    def energy(self, moves: Float[ndarray, "m 3"]) -> float:
        """What is made least."""
        pull = self.weights @ ((self.x - self.H) ** 2).sum(1) + 2 * np.einsum("ij,ij->", self.gradient, moves)
        return float(np.einsum("ij,ij->", moves, self.matrix @ moves) + pull)

    @property
    def gradient(self) -> Float[ndarray, "m 3"]:
        """Half the energy's gradient at D = 0."""
        return self.R.T @ (self.weights[:, None] * (self.x - self.H)) + self.net.linear

    def at(self, moves: Float[ndarray, "m 3"]) -> "LevelProgram":
        """Limits set up again where the moves take the samples, and H slid beside them: what counts is the
        way along the normals.

        So samples may gather where the level bends, as at the rim of what lies at the wall; in the spans at
        the poles, where they would fold over the pole, they may not.
        """
        y = self.x + self.R @ moves
        limits = self.limits.at(y, 1)
        before = self.limits.before
        knots = np.unique(before.tmesh.t_knots)
        sliding = (limits.t > knots[1]) & (limits.t < knots[-2])
        slid = y + dots(self.H - y, limits.n)[:, None] * limits.n
        _, high = heights(limits.cut, limits.gap)
        far = np.where(self.hollow, 0, high + TOO_FAR)
        after = before.with_control_points(before.control_points + self.free @ moves)
        back = reverse_depths(
            after, self.x, y=y, s=self.s, t=self.t, foot_s=limits.s, foot_t=limits.t, far=far, steps=2
        )
        hollow = self.hollow.copy()
        hollow[back.which] = True
        limits = limits.replace_slabs(
            back.which, self.x[back.which], back.n, high[back.which] + dots(y[back.which] - back.foot, back.n)
        )
        return replace(self, limits=limits, H=np.where(sliding[:, None], slid, self.H), hollow=hollow)


def program_of(
    discretisation: Discretisation,
    P: Float[ndarray, "c 3"],
    rest: Remaining,
    cut: Cut,
    parameters: StepParameters,
    pull_factor: Float[ndarray, " c"] | None = None,
) -> LevelProgram:
    """The program of the level above P, from which `rest` is left to the stock; `pull_factor` is a factor of the
    pull, a control point each."""
    stock = discretisation.stock
    before = discretisation.surface.with_control_points(P)
    given = Given(discretisation, before, rest, cut, parameters)
    net, pulled = add([energy(given) for energy in NET]), stack([energy(given) for energy in SAMPLED])
    x, target = pulled.x, pulled.target
    weights = pulled.weights if pull_factor is None else pulled.weights * (pulled.R @ pull_factor)
    R = sp.csr_array(pulled.R @ discretisation.free)
    gap = -stock.signed_distance(x)
    limits = limits_at(before, stock, cut=cut, gap=gap, y=target, s=pulled.s, t=pulled.t, steps=2)
    H = inside(stock, limits.c + pulled.beyond[:, None] * (target - limits.c), np.minimum(gap, cut.landing) - PRESS)
    hollow = np.zeros(len(x), dtype=bool)
    return LevelProgram(
        pulled.s,
        pulled.t,
        free=discretisation.free,
        hollow=hollow,
        R=R,
        x=x,
        weights=weights,
        H=H,
        start=target,
        limits=limits,
        net=_limit_bending(net, R, weights, MOST_BENT * cut.depth),
    )


def _limit_bending(net: Quadratic, R: sp.csr_array, weights: ndarray, most: float) -> Quadratic:
    """The energy, its linear part reduced where that alone would take a sample farther than `most`, mm."""
    far = float(lengths(R @ factorise(net.matrix, R, weights).solve(net.linear)).max())
    return net if far <= most else replace(net, linear=net.linear * (most / far))
