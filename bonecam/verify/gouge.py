"""Whether the ball enters the design surface anywhere along the moves of a program, between their ends too.

Each move is run as the control runs it (`nc/control.py`) and the distance d from the ball centre to the part
is taken at samples. Between two samples a chord s apart nothing is left to chance: for every point q of the
part, Stewart's theorem gives

    |c(u) - q|^2 = (1-u) |c0-q|^2 + u |c1-q|^2 - u (1-u) s^2 >= (1-u) d0^2 + u d1^2 - u (1-u) s^2

on the chord, and the true way bows from the chord by at most sup|c''| / 8. Samples are added until this bound
shows that no point in between goes deeper than the samples by more than `slack`, or that the ball stays clear
of the part there.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.errors import VerifyError
from bonecam.mesh.distance import lowest_between
from bonecam.nc.control import Control
from bonecam.nc.reading.motions import Motions

SLACK = 0.001
MOST_ROUNDS = 60
MOST_PIECES = 64


@runtime_checkable
class Distances(Protocol):
    """Distances from the part: `bonecam.mesh.distance.MeshDistance`, or a shape that knows them."""

    def signed(
        self, points: Float[ndarray, "n 3"], wanted: float | Float[ndarray, " n"]
    ) -> Float[ndarray, " n"]:
        """A lower bound of the signed distance (negative inside) of each point, mm; exact where it is below
        `wanted`."""
        ...


@dataclass(frozen=True)
class Gouge:
    """The deepest the ball enters the part: radius - distance at the samples (negative: it never touches),
    mm.

    `bound` is what it can be between the samples at most; `line` of the text, `place` of the ball centre
    there.
    """

    depth: float
    bound: float
    line: int
    place: tuple[float, float, float]
    samples: int


@dataclass(frozen=True, eq=False)
class _Spans:
    """Pieces of moves: u in [start, end] of move `move`, centres and distances at both ends."""

    move: Int[ndarray, "k"]
    start: Float[ndarray, "k"]
    end: Float[ndarray, "k"]
    first: Float[ndarray, "k 3"]
    last: Float[ndarray, "k 3"]
    near: Float[ndarray, "k"]
    far: Float[ndarray, "k"]

    def taken(self, keep: Bool[ndarray, "k"]) -> "_Spans":
        return _Spans(
            *(getattr(self, name)[keep] for name in ("move", "start", "end", "first", "last", "near", "far"))
        )


def measure_gouge(motions: Motions, part: Distances, slack: float = SLACK) -> Gouge:
    """The deepest gouge of all moves, rapids included; `slack` (mm) is how much deeper it may go between
    samples.

    A move whose start is unknown (after a retract or tool change) is checked at its end only.
    """
    if not len(motions.tips):
        raise VerifyError("the program moves nothing: there is no gouge to measure", line=0)
    radius = np.array([motions.controls[number].radius for number in motions.tools.tolist()])
    centres = motions.tips + radius[:, None] * motions.axes
    # far from the part half of the longest move beside it is enough to keep the ball clear of it
    steps = np.r_[0.0, np.linalg.norm(np.diff(centres, axis=0), axis=1), 0.0]
    distance = part.signed(centres, radius + np.maximum(steps[:-1], steps[1:]) / 2)
    depth = radius - distance
    worst = int(np.argmax(depth))
    best = Gouge(
        float(depth[worst]),
        float(depth[worst]),
        int(motions.lines[worst]),
        _place(centres[worst]),
        len(centres),
    )
    for number in sorted(motions.controls):
        moves = np.flatnonzero((motions.tools == number) & motions.known_start)
        if len(moves):
            best = _refine(motions, motions.controls[number], moves, centres, distance, part, slack, best)
    return best


def _place(point: ndarray) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in point)
    return x, y, z


def _refine(
    motions: Motions,
    control: Control,
    moves: ndarray,
    centres: ndarray,
    distance: ndarray,
    part: Distances,
    slack: float,
    best: Gouge,
) -> Gouge:
    bows = _bows(control, motions.words[moves - 1], motions.words[moves])
    zero, one = np.zeros(len(moves)), np.ones(len(moves))
    spans = _Spans(
        np.arange(len(moves)),
        zero,
        one,
        centres[moves - 1],
        centres[moves],
        distance[moves - 1],
        distance[moves],
    )
    for _ in range(MOST_ROUNDS):
        bound = _lowest(spans, bows)
        # enough: the ball is clear of the part, or goes no deeper than at the ends, or no deeper than known
        # elsewhere
        reach = np.minimum(np.minimum(spans.near, spans.far), control.radius - max(best.depth, 0.0))
        proved = bound >= reach - slack
        if proved.any():
            lowest = float((control.radius - np.maximum(bound[proved], 0.0)).max())
            best = Gouge(best.depth, max(best.bound, lowest), best.line, best.place, best.samples)
        if proved.all():
            return best
        spans, depth, place = _divided(spans.taken(~proved), motions, control, moves, bows, part, slack)
        worst = int(np.argmax(depth))
        if depth[worst] > best.depth:
            line = int(motions.lines[moves[spans.move[worst]]])
            best = Gouge(
                float(depth[worst]),
                max(best.bound, float(depth[worst])),
                line,
                _place(place[worst]),
                best.samples,
            )
        best = Gouge(best.depth, best.bound, best.line, best.place, best.samples + len(depth))
    line = int(motions.lines[moves[spans.move[0]]])
    raise VerifyError(
        f"line {line}: the way between its ends cannot be bounded: the move turns too far in one block",
        line=line,
    )


def _lowest(spans: _Spans, bows: ndarray) -> Float[ndarray, "k"]:
    """No point of a span is nearer to the part than this."""
    length = np.linalg.norm(spans.last - spans.first, axis=1)
    # inside the part distances are negative: the bound holds for what is outside, so the worst is taken
    value = lowest_between(np.maximum(spans.near, 0), np.maximum(spans.far, 0), length)
    lowest = value - bows[spans.move] * (spans.end - spans.start) ** 2 / 8
    return np.minimum(
        lowest, np.where(np.minimum(spans.near, spans.far) < 0, np.minimum(spans.near, spans.far), np.inf)
    )


def _divided(
    spans: _Spans,
    motions: Motions,
    control: Control,
    moves: ndarray,
    bows: ndarray,
    part: Distances,
    slack: float,
) -> tuple[_Spans, ndarray, ndarray]:
    """The spans cut into as many pieces as the bound is expected to need; depth and centre at each piece's
    end."""
    length = np.linalg.norm(spans.last - spans.first, axis=1)
    bow = bows[spans.move] * (spans.end - spans.start) ** 2 / 8
    needed = np.maximum(length / np.sqrt(4 * control.radius * slack), np.sqrt(2 * bow / slack))
    # far from the part a span only has to show that the ball stays clear
    gap = np.minimum(spans.near, spans.far) - control.radius
    needed = np.where(gap > length / 4, np.minimum(needed, 2), needed)
    pieces = np.clip(np.ceil(needed), 2, MOST_PIECES).astype(np.int64)
    owner = np.repeat(np.arange(len(pieces)), pieces)
    place = np.arange(len(owner)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    width = (spans.end - spans.start) / pieces
    start = spans.start[owner] + place * width[owner]
    last_piece = place == pieces[owner] - 1
    end = np.where(last_piece, spans.end[owner], start + width[owner])
    move = spans.move[owner]
    tips, axes = control.between(motions.words[moves[move] - 1], motions.words[moves[move]], end)
    last = tips + control.radius * axes
    far = spans.far[owner].copy()
    far[~last_piece] = part.signed(last[~last_piece], control.radius + (length / pieces)[owner[~last_piece]])
    begins = place == 0
    first = np.where(begins[:, None], spans.first[owner], np.roll(last, 1, axis=0))
    near = np.where(begins, spans.near[owner], np.roll(far, 1))
    return _Spans(move, start, end, first, last, near, far), control.radius - far, last


def _bows(control: Control, start: Float[ndarray, "n 5"], end: Float[ndarray, "n 5"]) -> Float[ndarray, "n"]:
    """An upper bound of |c''| of the ball centre over each move, u in [0, 1]; mm."""
    turn = np.abs(end[:, 3:] - start[:, 3:]).sum(1)
    if control.tool_centre:
        return np.zeros(len(turn)) if control.programs_centre else control.radius * turn**2
    chain = [np.array(axis.pivot) for axis in control.machine.part_axes]
    lever = np.full(len(turn), control.radius)
    if chain:
        reach = (np.linalg.norm(words[:, :3] - chain[-1], axis=1) for words in (start, end))
        lever = lever + np.maximum(*reach) + sum(float(np.linalg.norm(b - a)) for a, b in pairwise(chain))
    for axis in control.machine.tool_axes:
        lever = lever + 2 * float(np.linalg.norm(axis.pivot)) + 2 * control.tool_length
    return lever * turn**2 + 2 * turn * np.linalg.norm(end[:, :3] - start[:, :3], axis=1)
