"""Forward step: how many contacts a line needs so that straight moves of the ball centre follow the offset
curve C = S + R n within the chord tolerance.

Contacts are first spread by the curvature k of the offset curve (a chord of length l deviates by l^2 k / 8);
then every move is measured in its middle and halved until it holds. No move is longer than `max_step`.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import dots, unit
from bonecam.planning.passes.patterns.curves import Curves
from bonecam.surface.tspline import TSpline

DENSE_MOVES = 128
"""Moves into which each line is first divided to find its curvature."""
MIN_MOVES = 8
"""Each line has at least this many moves."""
MAX_HALVINGS = 12
"""A first move is halved no more often than this."""
SPREAD = 0.7
"""Part of the chord tolerance that contacts are first spread for, so that few moves need halving."""
ROUND = np.array([1.0, 0.0])
"""The direction (ds, dt) of lines t = const."""
POLE = 1e-5
"""At a pole the frame is taken this far (share of the domain) inside."""


@dataclass(frozen=True, eq=False)
class LineSamples:
    """Samples on curves: sample i lies at the place `x[i]` of curve `line[i]`, which never decreases; x
    increases along a curve."""

    curves: Curves
    line: Int[ndarray, " n"]
    x: Float[ndarray, " n"]

    @property
    def parameters(self) -> Float[ndarray, "n 2"]:
        """(s, t) of every sample."""
        return self.curves.at(self.line, self.x)[0]


def tangent_range(surface: TSpline) -> tuple[float, float]:
    """The least and the largest t at which tangents are taken: POLE inside the domain at a pole, else its end."""
    low, high = (float(t) for t in surface.domain[1])
    first, last = (POLE * (high - low) * pole for pole in surface.poles)
    return low + first, high - last


def contact_frames(
    surface: TSpline, parameters: Float[ndarray, "n 2"], directions: Float[ndarray, "n 2"] | ndarray
) -> tuple[Float[ndarray, "n 3"], Float[ndarray, "n 3"], Float[ndarray, "n 3"]]:
    """Points, outward unit normals and unit feed directions at (s, t), with the feed along `directions` (ds, dt); at
    poles their limits."""
    t = np.clip(parameters[:, 1], *tangent_range(surface))
    points, Ss, St = surface.evaluate(parameters[:, 0], t, 1)
    along = np.broadcast_to(directions, parameters.shape)
    feeds = along[:, :1] * Ss + along[:, 1:] * St
    return points, unit(np.cross(Ss, St)), unit(feeds)


def sample_lines(
    surface: TSpline, curves: Curves, radius: float, chord_tolerance: float, max_step: float
) -> LineSamples:
    """The contacts of all curves for a ball of `radius`; a ring has its first contact again at its end."""
    lines = _spread(surface, curves, radius, chord_tolerance, max_step)
    unchecked = np.ones(len(lines.x), dtype=bool)
    for _ in range(MAX_HALVINGS):
        lines, unchecked = _halve(
            surface, lines, unchecked=unchecked, radius=radius, chord_tolerance=chord_tolerance, max_step=max_step
        )
        if not unchecked.any():
            break
    return lines


def ball_centres(surface: TSpline, samples: LineSamples, radius: float) -> Float[ndarray, "n 3"]:
    """S + R n at the samples."""
    points, normals, _ = contact_frames(surface, samples.parameters, ROUND)
    return points + radius * normals


def dense_samples(curves: Curves, moves: int) -> LineSamples:
    """Samples at equal steps of x: `moves` on each curve, or one a knot where it has more."""
    counts = np.maximum(curves.last - curves.first, moves)
    x = [np.linspace(a, b, n + 1) for a, b, n in zip(curves.first, curves.last, counts)]
    return LineSamples(curves, np.repeat(np.arange(len(counts)), counts + 1), np.concatenate(x))


def _spread(surface: TSpline, curves: Curves, radius: float, chord_tolerance: float, max_step: float) -> LineSamples:
    """First samples, spread by the curvature of the densely sampled offset curves."""
    dense = dense_samples(curves, DENSE_MOVES)
    moves = np.diff(ball_centres(surface, dense, radius), axis=0)
    same = dense.line[1:] == dense.line[:-1]
    lengths = np.where(same, np.linalg.norm(moves, axis=1), 0.0)
    directions = unit(moves)
    # a move bends by the mean of the turns at its two ends, at the end of a curve by the one turn
    turns = np.linalg.norm(np.diff(directions, axis=0), axis=1)
    inner = same[1:] & same[:-1]
    turns = np.where(inner, turns, 0.0)
    ends = np.r_[0, inner.astype(np.int64)] + np.r_[inner.astype(np.int64), 0]
    bends = (np.r_[0.0, turns] + np.r_[turns, 0.0]) / np.maximum(ends, 1)
    by_chord = np.sqrt(lengths * bends / (8 * SPREAD * chord_tolerance))
    wanted = np.r_[0.0, np.cumsum(np.where(same, np.maximum(by_chord, lengths / max_step), 0.0))]

    bounds = np.searchsorted(dense.line, np.arange(len(curves.first) + 1))
    x: list[ndarray] = []
    for a, b in pairwise(bounds):
        counted = wanted[a:b] - wanted[a]
        steps = max(MIN_MOVES, int(np.ceil(counted[-1])))
        x.append(np.interp(np.linspace(0, counted[-1], steps + 1), counted, dense.x[a:b]))
    return LineSamples(curves, np.repeat(np.arange(len(x)), [len(v) for v in x]), np.concatenate(x))


def _halve(
    surface: TSpline,
    lines: LineSamples,
    unchecked: Bool[ndarray, " n"],
    radius: float,
    chord_tolerance: float,
    max_step: float,
) -> tuple[LineSamples, Bool[ndarray, " m"]]:
    """The lines with each unchecked move halved that bends or reaches too far; the halves are then unchecked.

    A move is named by its first sample.
    """
    first = np.flatnonzero(unchecked[:-1] & (lines.line[:-1] == lines.line[1:]))
    middle = (lines.x[first] + lines.x[first + 1]) / 2
    x = np.r_[lines.x[first], lines.x[first + 1], middle]
    probes = LineSamples(lines.curves, np.tile(lines.line[first], 3), x)
    a, b, m = np.split(ball_centres(surface, probes, radius), 3)

    chord = b - a
    length = np.linalg.norm(chord, axis=1)
    ratio = np.clip(dots(m - a, chord) / np.maximum(length, np.finfo(float).tiny) ** 2, 0, 1)
    deviation = np.linalg.norm(m - a - ratio[:, None] * chord, axis=1)
    split = (deviation > chord_tolerance) | (length > max_step)

    at = first[split] + 1
    fresh = np.zeros(len(lines.x), dtype=bool)
    fresh[first[split]] = True
    line = np.insert(lines.line, at, lines.line[first[split]])
    halved = LineSamples(lines.curves, line, np.insert(lines.x, at, middle[split]))
    return halved, np.insert(fresh, at, True)
