"""Linear limits low <= A x <= high of a quadratic program.

The depth of a cut: no sample goes farther from the level before than the cut is deep, less a margin for
what samples do not see.

The stock's wall: no sample leaves the stock. Its surface is as good as the plane that touches it nearest
to the sample.

The limits of one level's program, as planes at each sample, given by its closest points on the level before and
on the stock.

A sample y = S_new(l) has the closest point c on the level before, with the outward normal n there, and y - c is
along n. So

    slabs    low <= n . (y - c) <= high    (heights over the level before: the sample may slide)
    walls    m . y <= h                    (computed again as the sample moves)

and of several of a kind the tightest holds. A new one is a new file here with one function, and its
name in SLABS or WALLS. The planes are exact at y itself; `Limits.at` sets them up again when y has moved on.

Nesting: no sample falls behind the level before (the published program leaves this out).

The depth of a cut the other way: no place of the level before may be farther from the new level than the
cut is deep.

In a hollow what is above a place is near to the hollow's sides, and so not too deep, when the place itself is
too far behind already.

Where the place at (s, t) slid to the foot (s + ds, t + dt), the foot of the one it came from is near (s - ds,
t - dt): most are near enough there, and only the others' feet are sought.

What an energy of a level's program is: a function of what is `Given` that yields its matrices, of one of
two kinds.

    Quadratic   D'(matrix)D + 2 linear . D                   of the control net, D its free moves (`free_moves`)
    Pulled      sum_l w_l |S_new - H_l|^2                    of samples

A new one is one such function here, and its name in NET or SAMPLED.

The thin plate, twice: stiffness of the moves, D'MD, and bending of the new level, (P + D)'M(P + D), as
published.

Stiffness keeps the net from crumpling; bending fills hollows as the level goes and keeps walls from standing
up. The weight of bending falls with the depth squared.

The pull on the level itself: its samples along a smoothed field of directions (`problem.py`), as far as
they should go.

A sample should go as far as it may, and is pulled beyond; with a `least_share` below 1 one with less way to the
stock than the farthest goes less, so that all come to the stock together: where some come early, levels crowd into
what is left between them and fold. Nothing is pulled farther than the stock's wall: what lies at it already would
be drawn along it, and waves of one level would no longer fit into those of the next.

The pull at the feet of the farthest points of the stock, towards those points and all out: what is left
there decides K.

Without it all 39 cuts of a talus become 38, of which one is not certified, and the levels of 3distph take 1.16 times
as long.

The quadratic program of one level, on the free moves D of the control points (`free_moves`).

    min  int |S_new - H|^2 + stiffness D'MD + bending P_new'M P_new        S_new = S + R D, over the surface
    s.t. depth, nesting and stock at samples

The energies are those listed in NET (of the control net) and SAMPLED (of samples), each a file of `energies/`;
the limits are files of `limits/`. `levels/solvers` solves the program.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import dots, lengths, unit
from bonecam.kernels.matrices import Planes
from bonecam.levels.problem import ROUGH, Cut, Discretisation, Remaining, StepParameters, factorise, gram
from bonecam.setup.stock import Stock
from bonecam.surface.query import closest_points_near
from bonecam.surface.tspline import TSpline


@dataclass(frozen=True, eq=False)
class LinearLimits:
    """low <= A x <= high, a row of A each."""

    A: sp.csr_array
    low: Float[ndarray, "r"]
    high: Float[ndarray, "r"]


DEPTH_MARGIN, DEPTH_SHARE = 0.001, 0.005
"""The margin: so many mm (half of what a depth may exceed its limit by), or this share of the depth where that is
less."""


def depth(cut: Cut, gap: Float[ndarray, " k"]) -> tuple[Float[ndarray, " k"], Float[ndarray, " k"]]:
    """Least and largest height, mm, of samples that are `gap` inside the stock at the level before."""
    return np.full(len(gap), -np.inf), np.full(
        len(gap), cut.depth - cut.margin * min(DEPTH_MARGIN, DEPTH_SHARE * cut.depth)
    )


def wall(
    cut: Cut, gap: Float[ndarray, " k"], stock: Stock, y: Float[ndarray, "k 3"]
) -> tuple[Float[ndarray, "k 3"], Float[ndarray, " k"]]:
    """Planes m . y <= h at samples that are at y now and `gap` inside the stock at the level before: what is
    near may stay."""
    distance, m = stock.distances_and_normals(y)
    return m, dots(m, y) - distance - np.minimum(gap, cut.clearance)


def inside(stock: Stock, points: Float[ndarray, "k 3"], clearance: Float[ndarray, " k"]) -> Float[ndarray, "k 3"]:
    """The points, those less than their clearance inside the stock taken there along the shortest way."""
    distance, out = stock.distances_and_normals(points)
    return points - np.maximum(distance + clearance, 0)[:, None] * out


MARGIN, SHARE = 0.001, 0.05
"""The margin: so many mm (as much as a level may fall behind when it is measured), or this share of the room to the
wall where that is less."""


def nesting(cut: Cut, gap: Float[ndarray, " k"]) -> tuple[Float[ndarray, " k"], Float[ndarray, " k"]]:
    """Least and largest height, mm, of samples that are `gap` inside the stock at the level before: above
    zero where there is room."""
    return cut.margin * np.clip(SHARE * (gap - cut.clearance), 0, MARGIN), np.full(len(gap), np.inf)


SLABS = (depth, nesting)
WALLS = (wall,)
"""The limits of a program: those of heights over the level before, and those of the stock."""


def heights(cut: Cut, gap: Float[ndarray, " k"]) -> tuple[Float[ndarray, " k"], Float[ndarray, " k"]]:
    """Lowest and largest height over the level before of samples that are `gap` inside the stock there, by
    all slabs, mm."""
    low, high = zip(*(slab(cut, gap) for slab in SLABS))
    return np.maximum.reduce(low), np.minimum.reduce(high)


@dataclass(frozen=True, eq=False)
class Limits:
    """low <= n . (y - c) <= high and m . y <= h, one a sample, mm; the parameters (s, t) of the feet c; and
    what they are set up from: `gap` is how far inside the stock a sample is at the level before."""

    before: TSpline
    stock: Stock
    cut: Cut
    gap: Float[ndarray, " k"]
    s: Float[ndarray, " k"]
    t: Float[ndarray, " k"]
    c: Float[ndarray, "k 3"]
    n: Float[ndarray, "k 3"]
    low: Float[ndarray, " k"]
    high: Float[ndarray, " k"]
    m: Float[ndarray, "k 3"]
    h: Float[ndarray, " k"]

    @property
    def planes(self) -> Planes:
        """The planes alone, as compiled loops take them."""
        return Planes(self.c, self.n, self.low, self.high, m=self.m, h=self.h)

    def planes_with(self, c: Float[ndarray, "n 3"], n: Float[ndarray, "n 3"], high: Float[ndarray, " n"]) -> Planes:
        """The planes with those of more samples, which have only n . (y - c) <= high."""
        no_limit = np.full(len(c), np.inf)
        slabs = Planes(c, n, low=-no_limit, high=high, m=np.zeros((len(c), 3)), h=no_limit)
        return Planes(*(np.concatenate([mine, its]) for mine, its in zip(self.planes, slabs)))

    def heights(self, y: Float[ndarray, "k 3"]) -> Float[ndarray, " k"]:
        """Distance of each sample from the level before, mm, negative behind it."""
        return dots(y - self.c, self.n)

    def broken(self, y: Float[ndarray, "k 3"]) -> Float[ndarray, " k"]:
        """How far each sample breaks its worst limit, mm; negative: the room it has."""
        height = self.heights(y)
        return np.maximum.reduce([height - self.high, self.low - height, dots(self.m, y) - self.h])

    def at(self, y: Float[ndarray, "k 3"], steps: int) -> "Limits":
        """The limits set up again where the samples are at y; `steps` of Newton find their closest points."""
        return limits_at(self.before, self.stock, cut=self.cut, gap=self.gap, y=y, s=self.s, t=self.t, steps=steps)

    def only(self, which: ndarray) -> "Limits":
        """The limits of some of the samples."""
        names = ("gap", "s", "t", *Planes._fields)
        return replace(self, **{name: getattr(self, name)[which] for name in names})

    def renew(self, which: ndarray, y: Float[ndarray, "k 3"], steps: int) -> "Limits":
        """The limits, those of the samples `which` set up again where they are at y."""
        renewed = self.only(which).at(y[which], steps)
        values = {name: getattr(self, name).copy() for name in ("s", "t", *Planes._fields)}
        for name, value in values.items():
            value[which] = getattr(renewed, name)
        return replace(self, **values)

    def rows(self, R: sp.csr_array, x: Float[ndarray, "k 3"]) -> LinearLimits:
        """The limits over the moves D of the control points (x, y, z stacked) with y = x + R D."""
        along, wall = (sp.hstack([sp.diags_array(v[:, j]) @ R for j in range(3)]) for v in (self.n, self.m))
        start = self.heights(x)
        low = np.concatenate([self.low - start, np.full(len(x), -np.inf)])
        return LinearLimits(
            sp.csr_array(sp.vstack([along, wall])), low, np.concatenate([self.high - start, self.h - dots(self.m, x)])
        )


def limits_at(
    before: TSpline,
    stock: Stock,
    cut: Cut,
    gap: Float[ndarray, " k"],
    y: Float[ndarray, "k 3"],
    s: Float[ndarray, " k"],
    t: Float[ndarray, " k"],
    steps: int,
) -> Limits:
    """The limits of samples at y that were `gap` inside the stock at the level before; `steps` of Newton from
    (s, t) find their feet.

    A sample that has slid to where the level before is nearer to the stock than it was itself may be as near:
    else no place there would do.
    """
    s, t, c, n = closest_points_near(before, y, s, t, steps)
    room = np.minimum(gap, -stock.signed_distance(c))
    low, high = heights(cut, room)

    # Of the planes m . y <= h at each sample the one that y breaks most.
    planes = [one(cut, room, stock, y) for one in WALLS]
    m, h = planes[0]
    for other, its in planes[1:]:
        worse = dots(other, y) - its > dots(m, y) - h
        m, h = np.where(worse[:, None], other, m), np.where(worse, its, h)

    return Limits(before, stock, cut=cut, gap=gap, s=s, t=t, c=c, n=n, low=low, high=high, m=m, h=h)


@dataclass(frozen=True, eq=False)
class ReverseDepths:
    """Places of the level before (`which` of those asked for), the parameters (s, t) of their feet on the new
    level, the feet, how far these are `away`, mm, and the directions there."""

    which: Int[ndarray, " k"]
    s: Float[ndarray, " k"]
    t: Float[ndarray, " k"]
    foot: Float[ndarray, "k 3"]
    away: Float[ndarray, " k"]
    n: Float[ndarray, "k 3"]


def reverse_depths(
    after: TSpline,
    x: Float[ndarray, "n 3"],
    y: Float[ndarray, "n 3"],
    s: Float[ndarray, " n"],
    t: Float[ndarray, " n"],
    foot_s: Float[ndarray, " n"],
    foot_t: Float[ndarray, " n"],
    far: Float[ndarray, " n"],
    steps: int,
) -> ReverseDepths:
    """The places of the level before that are farther than `far` (mm) from the new level.

    A place with parameters (s, t) lies at x on the level before and at y on the new one; (foot_s, foot_t) are
    the parameters of the closest point to y on the level before.
    """
    which = np.flatnonzero(lengths(y - x) > far)
    _, _, foot, _ = closest_points_near(after, x[which], (2 * s - foot_s)[which], (2 * t - foot_t)[which], 0)
    which = which[lengths(foot - x[which]) > far[which]]
    s, t, foot, _ = closest_points_near(after, x[which], s=s[which], t=t[which], steps=steps, near_enough=far[which])
    across = foot - x[which]
    away = lengths(across)
    kept = away > far[which]
    n = across[kept] / away[kept, None]
    return ReverseDepths(which=which[kept], s=s[kept], t=t[kept], foot=foot[kept], away=away[kept], n=n)


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


def plate(given: Given) -> Quadratic:
    """Stiffness and bending on the free moves D, less their value at D = 0."""
    M, free = given.discretisation.M, given.discretisation.free
    bending = given.parameters.bending * (given.cut.depth / ROUGH) ** 2
    matrix = (given.parameters.stiffness + bending) * given.discretisation.free_M
    return Quadratic(matrix, np.asarray(bending * (free.T @ (M @ given.before.control_points))))


SMOOTHING = 1e-4
"""Weight of the thin plate, parameters over [0, 1], that smooths the field of directions."""
OVERSHOOT = 2.0
"""How far a sample that may go all the depth is pulled, in depths."""
ALL_OUT = 8
"""How sharply the pull beyond the depth sets in."""
LONGEST, LEAST_COSINE = 2.0, 0.3
"""A sample that is pulled obliquely goes a longer way to its height: so many heights at most; and cosines between its
way and the normal count as no less than this."""


def pull(given: Given) -> Pulled:
    """The samples of the energy, weighed by area and uniformly."""
    discretisation = given.discretisation
    P = given.before.control_points
    samples = discretisation.samples
    x = samples.R @ P
    area_vectors = samples.area_vectors(P)
    area = np.linalg.norm(area_vectors, axis=1)
    weights = area * samples.weights
    weights = weights / weights.sum() + given.parameters.uniform / len(x)
    normals = area_vectors / np.maximum(area, np.finfo(float).tiny)[:, None]
    field = samples.R.T @ (weights[:, None] * discretisation.attraction(x, normals, discretisation.stock))
    field = unit(samples.R @ factorise(SMOOTHING * discretisation.M, samples.R, weights).solve(field))
    gap = -discretisation.stock.signed_distance(x)
    share = np.clip(gap / given.rest.left, given.parameters.least_share, 1.0)
    target = targets(given, x, s=samples.s, t=samples.t, normals=normals, towards=field, share=share)
    return Pulled(
        samples.s,
        samples.t,
        R=samples.R,
        x=x,
        weights=weights,
        target=target,
        beyond=1 + (OVERSHOOT - 1) * share**ALL_OUT,
    )


def targets(
    given: Given,
    x: Float[ndarray, "k 3"],
    s: Float[ndarray, " k"],
    t: Float[ndarray, " k"],
    normals: Float[ndarray, "k 3"],
    towards: Float[ndarray, "k 3"],
    share: Float[ndarray, " k"],
) -> Float[ndarray, "k 3"]:
    """Where samples at x should be: so far along `towards` that their distance to the level before is a
    `share` of what they may go."""
    stock = given.discretisation.stock
    cut = given.cut
    distance, out = stock.distances_and_normals(x)
    gap = -distance
    height = share * heights(cut, gap)[1]
    cosine = np.maximum(dots(normals, towards), LEAST_COSINE)
    reach = longest = np.minimum(height / cosine, LONGEST * height)
    for _ in range(2):
        y = x + reach[:, None] * towards
        s, t, c, _ = closest_points_near(given.before, y, s, t, 1)
        away = lengths(y - c)
        slope = dots(y - c, towards) / np.maximum(away, np.finfo(float).tiny)
        reach = np.clip(reach + (height - away) / np.maximum(slope, LEAST_COSINE), 0, longest)
    reach = np.minimum(reach, gap / np.maximum(dots(towards, out), LEAST_COSINE))
    return inside(stock, x + reach[:, None] * towards, np.minimum(gap, cut.landing))


FARTHEST = 1.0
"""Points of the stock pull at their closest points where they are less than this number of depths nearer than the
farthest one."""
MOST = 600
"""Points of the stock that pull at most."""
WEIGHT = 0.3
"""Their share of the weight of all pulls."""


def farthest(given: Given) -> Pulled:
    """The closest points are samples of their own, the farther the point the heavier."""
    before, rest = given.before, given.rest
    least = rest.farthest - FARTHEST * given.cut.depth
    candidates = np.flatnonzero(rest.at_most > least)
    candidates = candidates[:: 1 + len(candidates) // MOST]
    start = rest.feet[candidates]
    s, t, x, _ = closest_points_near(before, rest.points[candidates], start[:, 0], start[:, 1], 3)
    across = rest.points[candidates] - x
    distance = np.linalg.norm(across, axis=1)
    weights = np.clip((distance - least) / (rest.farthest - least), 0, 1)
    kept = weights > 0
    weights = WEIGHT * weights[kept] / weights.sum()
    s = s[kept]
    t = t[kept]
    x = x[kept]
    towards = unit(across[kept])
    target = targets(given, x, s=s, t=t, normals=towards, towards=towards, share=np.ones(len(s)))
    return Pulled(s, t, R=before.basis(s, t)[0], x=x, weights=weights, target=target, beyond=np.full(len(s), OVERSHOOT))


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
    `hollow` samples are now the new level has become too far once: they are limited along the way
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
        # The samples that are too near get n . (y - c) <= high instead of their slabs
        limits = replace(limits, c=limits.c.copy(), n=limits.n.copy(), low=limits.low.copy(), high=limits.high.copy())
        limits.c[back.which] = self.x[back.which]
        limits.n[back.which] = back.n
        limits.low[back.which] = -np.inf
        limits.high[back.which] = high[back.which] + dots(y[back.which] - back.foot, back.n)
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

    # The linear part of the net's energy is reduced where that alone would take a sample too far
    far = float(lengths(R @ factorise(net.matrix, R, weights).solve(net.linear)).max())
    if far > MOST_BENT * cut.depth:
        net = replace(net, linear=net.linear * (MOST_BENT * cut.depth / far))

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
        net=net,
    )
