"""Forward step: how many contacts a line needs so that straight moves of the ball centre follow the offset
curve C = S + R n within the chord tolerance.

Contacts are first spread by the curvature k of the offset curve (a chord of length l deviates by l^2 k / 8);
then every move is measured in its middle and halved until it holds. No move is longer than `max_step`.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import dots, unit
from bonecam.surface.tspline import TSpline

DENSE_MOVES = 128
"""Moves into which each line is first divided to find its curvature."""
MIN_MOVES = 8
"""Each line has at least this many moves."""
MAX_HALVINGS = 12
"""A first move is halved no more often than this."""
SPREAD = 0.7
"""Part of the chord tolerance that contacts are first spread for, so that few moves need halving."""
POLE = 1e-5
"""At a pole the frame is taken this far (share of the domain) inside."""


@dataclass(frozen=True, eq=False)
class LineSamples:
    """Samples on iso-parametric lines: sample i lies on line `line[i]` (which never decreases) at parameter
    `u[i]` (which increases along a line).

    `across` (k,) is the fixed parameter of each line. Lines `round` run in s at fixed t, lines `along` run
    in t at fixed s.
    """

    pattern: str
    across: Float[ndarray, " k"]
    line: Int[ndarray, " n"]
    u: Float[ndarray, " n"]

    @property
    def parameters(self) -> Float[ndarray, "n 2"]:
        """(s, t) of every sample."""
        fixed = self.across[self.line]
        return np.column_stack([self.u, fixed] if self.pattern == "round" else [fixed, self.u])


def tangent_range(surface: TSpline) -> tuple[float, float]:
    """The least and the largest t at which tangents are taken: POLE inside the domain at a pole, else its end."""
    low, high = (float(t) for t in surface.domain[1])
    first, last = (POLE * (high - low) * pole for pole in surface.poles)
    return low + first, high - last


def contact_frames(
    surface: TSpline, pattern: str, parameters: Float[ndarray, "n 2"]
) -> tuple[Float[ndarray, "n 3"], Float[ndarray, "n 3"], Float[ndarray, "n 3"]]:
    """Points, outward unit normals and unit feed directions (of growing u) at (s, t); at poles their
    limits."""
    t = np.clip(parameters[:, 1], *tangent_range(surface))
    points, Ss, St = surface.evaluate(parameters[:, 0], t, 1)
    feeds = Ss if pattern == "round" else St
    return points, unit(np.cross(Ss, St)), unit(feeds)


def sample_lines(
    surface: TSpline,
    pattern: str,
    across: Float[ndarray, " k"],
    radius: float,
    chord_tolerance: float,
    max_step: float,
) -> LineSamples:
    """The contacts of all lines for a ball of `radius`; a line in a closed direction has its first contact again at
    its end."""
    lines = _spread(surface, pattern, across, radius, chord_tolerance, max_step)
    unchecked = np.ones(len(lines.u), dtype=bool)
    for _ in range(MAX_HALVINGS):
        lines, unchecked = _halve(surface, lines, unchecked, radius, chord_tolerance, max_step)
        if not unchecked.any():
            break
    return lines


def _spread(
    surface: TSpline,
    pattern: str,
    across: Float[ndarray, " k"],
    radius: float,
    chord_tolerance: float,
    max_step: float,
) -> LineSamples:
    """First samples, spread by the curvature of the densely sampled offset curves."""
    start, end = surface.domain[0 if pattern == "round" else 1]
    dense = np.linspace(start, end, DENSE_MOVES + 1)
    count = len(across)
    line = np.repeat(np.arange(count), DENSE_MOVES + 1)
    even = LineSamples(pattern, across, line, np.tile(dense, count))
    points, normals, _ = contact_frames(surface, pattern, even.parameters)
    centres = (points + radius * normals).reshape(count, DENSE_MOVES + 1, 3)

    moves = np.diff(centres, axis=1)
    lengths = np.linalg.norm(moves, axis=2)
    directions = moves / np.maximum(lengths, np.finfo(float).tiny)[:, :, None]
    bends = np.linalg.norm(np.diff(directions, axis=1), axis=2)
    bends = np.column_stack([bends[:, :1], (bends[:, 1:] + bends[:, :-1]) / 2, bends[:, -1:]])
    by_chord = np.sqrt(lengths * bends / (8 * SPREAD * chord_tolerance))
    wanted = np.cumsum(np.maximum(by_chord, lengths / max_step), axis=1)
    counted = np.column_stack([np.zeros(count), wanted])

    steps = np.maximum(MIN_MOVES, np.ceil(counted[:, -1])).astype(int)
    u = [np.interp(np.linspace(0, row[-1], n + 1), row, dense) for row, n in zip(counted, steps)]
    return LineSamples(pattern, across, np.repeat(np.arange(count), steps + 1), np.concatenate(u))


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
    middle = (lines.u[first] + lines.u[first + 1]) / 2
    u = np.r_[lines.u[first], lines.u[first + 1], middle]
    probes = LineSamples(lines.pattern, lines.across, np.tile(lines.line[first], 3), u)
    points, normals, _ = contact_frames(surface, lines.pattern, probes.parameters)
    a, b, m = np.split(points + radius * normals, 3)

    chord = b - a
    length = np.linalg.norm(chord, axis=1)
    ratio = np.clip(dots(m - a, chord) / np.maximum(length, np.finfo(float).tiny) ** 2, 0, 1)
    deviation = np.linalg.norm(m - a - ratio[:, None] * chord, axis=1)
    split = (deviation > chord_tolerance) | (length > max_step)

    at = first[split] + 1
    fresh = np.zeros(len(lines.u), dtype=bool)
    fresh[first[split]] = True
    line = np.insert(lines.line, at, lines.line[first[split]])
    halved = LineSamples(lines.pattern, lines.across, line, np.insert(lines.u, at, middle[split]))
    return halved, np.insert(fresh, at, True)
