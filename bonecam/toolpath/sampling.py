"""Forward step: how many contacts a line needs so that straight moves of the ball's centre follow its offset
curve.

Contacts are spread by the bending of the centre curve C = S + R n (a chord of length l leaves l^2 k / 8),
then every move is checked at its middle and bisected until it holds; no move is longer than `max_step`.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.arrays import dots
from bonecam.surface.tspline import TSpline

DENSE = 128
FEWEST = 8
ROUNDS = 12
SPREAD = 0.7
"""Contacts are first spread for this part of the chord tolerance, so that few moves need bisecting."""
POLE = 1e-5


@dataclass(frozen=True, eq=False)
class Lines:
    """Samples u along lines: `line` never decreases; u increases within a line. `across` (k,) is each line's
    own parameter."""

    direction: str
    across: Float[ndarray, " k"]
    line: Int[ndarray, " n"]
    u: Float[ndarray, " n"]

    @property
    def parameters(self) -> Float[ndarray, "n 2"]:
        """(s, t) of every sample."""
        fixed = self.across[self.line]
        return np.column_stack([self.u, fixed] if self.direction == "around" else [fixed, self.u])


def frame(
    surface: TSpline, direction: str, parameters: Float[ndarray, "n 2"]
) -> tuple[ndarray, ndarray, ndarray]:
    """Points, outward unit normals and unit feed directions (growing u) at (s, t); limits at the poles."""
    low, high = surface.domain[1]
    edge = POLE * (high - low)
    t = np.clip(parameters[:, 1], low + edge, high - edge)
    points, Ss, St = surface.evaluate(np.mod(parameters[:, 0], 1.0), t, 1)
    normals, feeds = np.cross(Ss, St), Ss if direction == "around" else St
    return (
        points,
        normals / np.linalg.norm(normals, axis=1, keepdims=True),
        feeds / np.linalg.norm(feeds, axis=1, keepdims=True),
    )


def sample_lines(
    surface: TSpline,
    direction: str,
    across: Float[ndarray, " k"],
    radius: float,
    chord_tolerance: float,
    max_step: float,
) -> Lines:
    """Samples of all lines together; a ring has its first sample again at its end (u = 0 and u = 1)."""
    low, high = (0.0, 1.0) if direction == "around" else surface.domain[1]
    lines = _spread(surface, direction, across, radius, chord_tolerance, max_step, (low, high))
    unchecked = np.ones(len(lines.u), dtype=bool)
    for _ in range(ROUNDS):
        lines, unchecked = _bisected(surface, lines, unchecked, radius, chord_tolerance, max_step)
        if not unchecked.any():
            break
    return lines


def _spread(
    surface: TSpline,
    direction: str,
    across: ndarray,
    radius: float,
    chord_tolerance: float,
    max_step: float,
    ends: tuple[float, float],
) -> Lines:
    """First samples by the bending of the densely sampled centre curves."""
    dense = np.linspace(*ends, DENSE + 1)
    even = Lines(direction, across, np.repeat(np.arange(len(across)), DENSE + 1), np.tile(dense, len(across)))
    points, normals, _ = frame(surface, direction, even.parameters)
    centres = (points + radius * normals).reshape(len(across), DENSE + 1, 3)
    moves = np.diff(centres, axis=1)
    lengths = np.linalg.norm(moves, axis=2)
    bends = np.linalg.norm(
        np.diff(moves / np.maximum(lengths, np.finfo(float).tiny)[:, :, None], axis=1), axis=2
    )
    bends = np.column_stack([bends[:, :1], (bends[:, 1:] + bends[:, :-1]) / 2, bends[:, -1:]])
    wanted = np.sqrt(lengths * bends / (8 * SPREAD * chord_tolerance))
    counts = np.column_stack(
        [np.zeros(len(across)), np.cumsum(np.maximum(wanted, lengths / max_step), axis=1)]
    )
    u, line = [], []
    for k, count in enumerate(counts):
        moves_here = max(FEWEST, int(np.ceil(count[-1])))
        u.append(np.interp(np.linspace(0, count[-1], moves_here + 1), count, dense))
        line.append(np.full(moves_here + 1, k))
    return Lines(direction, across, np.concatenate(line), np.concatenate(u))


def _bisected(
    surface: TSpline, lines: Lines, unchecked: ndarray, radius: float, chord_tolerance: float, max_step: float
) -> tuple[Lines, ndarray]:
    """Halve the moves (named by their first sample) that bend or reach too far; the halves are to be checked
    again."""
    first = np.flatnonzero(unchecked[:-1] & (lines.line[:-1] == lines.line[1:]))
    middle = (lines.u[first] + lines.u[first + 1]) / 2
    probes = Lines(
        lines.direction,
        lines.across,
        np.tile(lines.line[first], 3),
        np.r_[lines.u[first], lines.u[first + 1], middle],
    )
    points, normals, _ = frame(surface, lines.direction, probes.parameters)
    a, b, m = np.split(points + radius * normals, 3)
    chord = b - a
    length = np.linalg.norm(chord, axis=1)
    ratio = np.clip(dots(m - a, chord) / np.maximum(length, np.finfo(float).tiny) ** 2, 0, 1)
    far = np.linalg.norm(m - a - ratio[:, None] * chord, axis=1)
    split = (far > chord_tolerance) | (length > max_step)
    at = first[split] + 1
    fresh = np.zeros(len(lines.u), dtype=bool)
    fresh[first[split]] = True
    return Lines(
        lines.direction,
        lines.across,
        np.insert(lines.line, at, lines.line[first[split]]),
        np.insert(lines.u, at, middle[split]),
    ), np.insert(fresh, at, True)
