"""Whether the ball enters the design surface anywhere along the moves of a program, between their ends too.

Each move is run as the control runs it (`machine/control.py`), and the distance d from the ball centre c to the
part is taken at samples. Between two samples a chord s apart the distance is bounded: for every point q of
the part, Stewart's theorem gives

    |c(u) - q|^2 = (1-u) |c0-q|^2 + u |c1-q|^2 - u (1-u) s^2 >= (1-u) d0^2 + u d1^2 - u (1-u) s^2

on the chord, and the true path deviates from the chord by at most sup|c''| / 8. Samples are added until this
bound shows that no point in between goes deeper than the samples by more than `slack`, or that the ball stays
clear of the part there.
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.errors import VerifyError
from bonecam.machine.control import Control
from bonecam.mesh.distance import lowest_between
from bonecam.nc.motions import Motions

SLACK = 0.001
"""How much deeper (mm) the ball may go between samples: a tenth of the gouge allowed by default."""
MAX_ROUNDS = 60
"""Times that the spans of a move are divided at most."""
MAX_PIECES = 64
"""Pieces that a span is divided into at most."""


@runtime_checkable
class Distances(Protocol):
    """Distances from the part: `bonecam.mesh.distance.MeshDistance`, or a shape that knows them."""

    def signed(self, points: Float[ndarray, "n 3"], wanted: float | Float[ndarray, " n"]) -> Float[ndarray, " n"]:
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


class _Spans(NamedTuple):
    """Pieces of moves: u in [start, end] of move `move` (0 .. 1 is all of it), with ball centres (`first`,
    `last`) and their distances (`near`, `far`, mm) at both ends."""

    move: Int[ndarray, "k"]
    start: Float[ndarray, "k"]
    end: Float[ndarray, "k"]
    first: Float[ndarray, "k 3"]
    last: Float[ndarray, "k 3"]
    near: Float[ndarray, "k"]
    far: Float[ndarray, "k"]

    def take(self, keep: Bool[ndarray, "k"]) -> "_Spans":
        """The spans to keep."""
        return _Spans(*(column[keep] for column in self))

    @property
    def length(self) -> Float[ndarray, "k"]:
        """Length of the chord, mm."""
        return np.linalg.norm(self.last - self.first, axis=1)


class _Run(NamedTuple):
    """Moves of one tool, by their rows in `motions`, with an upper bound of |c''| of the ball centre over
    each."""

    motions: Motions
    control: Control
    moves: Int[ndarray, "m"]
    bows: Float[ndarray, "m"]
    part: Distances
    slack: float


def measure_gouge(motions: Motions, part: Distances, slack: float = SLACK) -> Gouge:
    """The deepest gouge of all moves, rapids included; `slack` (mm) is how much deeper it may go between
    samples.

    A move whose start is unknown (after a retract or tool change) is checked at its end only.
    """
    if not len(motions.tips):
        raise VerifyError("the program moves nothing: there is no gouge to measure", line=0)
    controls = [motions.controls[number] for number in motions.tools.tolist()]
    radius, heights = np.array([(one.radius, one.centre_height) for one in controls]).T
    centres = motions.tips + heights[:, None] * motions.axes
    # far from the part, half of the longest move beside it is enough to keep the ball clear of it by the slack
    steps = np.r_[0.0, np.linalg.norm(np.diff(centres, axis=0), axis=1), 0.0]
    distance = part.signed(centres, radius + slack + np.maximum(steps[:-1], steps[1:]) / 2)
    depths = radius - distance
    worst = int(np.argmax(depths))
    depth = float(depths[worst])
    best = Gouge(depth, depth, int(motions.lines[worst]), _place(centres[worst]), len(centres))
    for number, control in sorted(motions.controls.items()):
        moves = np.flatnonzero((motions.tools == number) & motions.known_start)
        if len(moves):
            bows = centre_bows(control, motions.words[moves - 1], motions.words[moves])
            run = _Run(motions, control, moves=moves, bows=bows, part=part, slack=slack)
            best = _refine(run, centres, distance, best)
    return best


def _place(point: Float[ndarray, "3"]) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in point)
    return x, y, z


def _refine(run: _Run, centres: Float[ndarray, "n 3"], distance: Float[ndarray, "n"], best: Gouge) -> Gouge:
    """The deepest gouge with the moves of `run` sampled until it is bounded; VerifyError where it cannot
    be."""
    moves = run.moves
    radius = run.control.radius
    count = len(moves)
    ends = centres[moves - 1], centres[moves], distance[moves - 1], distance[moves]
    spans = _Spans(np.arange(count), np.zeros(count), np.ones(count), *ends)
    for _ in range(MAX_ROUNDS):
        # No point of a span is nearer to the part than this, mm
        on_chord = lowest_between(np.maximum(spans.near, 0), np.maximum(spans.far, 0), spans.length)
        lowest = on_chord - _bow(spans, run.bows)
        # inside the part distances are negative, and the bound holds outside only: the worse end is taken
        at_ends = np.minimum(spans.near, spans.far)
        bound = np.minimum(lowest, np.where(at_ends < 0, at_ends, np.inf))

        # enough: the ball is clear of the part, or goes no deeper than at the ends, or no deeper than known
        # elsewhere
        reach = np.minimum(np.minimum(spans.near, spans.far), radius - max(best.depth, 0.0))
        proved = bound >= reach - run.slack
        if proved.any():
            deepest = float((radius - np.maximum(bound[proved], 0.0)).max())
            best = replace(best, bound=max(best.bound, deepest))
        if proved.all():
            return best

        spans, depths, points = _divide(spans.take(~proved), run)
        worst = int(np.argmax(depths))
        if depths[worst] > best.depth:
            depth = float(depths[worst])
            line = int(run.motions.lines[moves[spans.move[worst]]])
            best = Gouge(depth, max(best.bound, depth), line, _place(points[worst]), best.samples)
        best = replace(best, samples=best.samples + len(depths))

    line = int(run.motions.lines[moves[spans.move[0]]])
    raise VerifyError(
        f"line {line}: the move turns too far in one block to bound the gouge between its ends: "
        "change path.lead_deg or path.pattern",
        line=line,
    )


def _bow(spans: _Spans, bows: Float[ndarray, "m"]) -> Float[ndarray, "k"]:
    """How far the path of the ball centre deviates from the chord of each span at most, mm."""
    return bows[spans.move] * (spans.end - spans.start) ** 2 / 8


def _divide(spans: _Spans, run: _Run) -> tuple[_Spans, Float[ndarray, "p"], Float[ndarray, "p 3"]]:
    """The spans divided into pieces; depth (mm) and ball centre at the end of each piece."""
    # Pieces that the bound is expected to need on each span
    length = spans.length
    for_chord = length / np.sqrt(4 * run.control.radius * run.slack)
    needed = np.maximum(for_chord, np.sqrt(2 * _bow(spans, run.bows) / run.slack))
    # far from the part a span only has to show that the ball stays clear
    gap = np.minimum(spans.near, spans.far) - run.control.radius
    needed = np.where(gap > length / 4, np.minimum(needed, 2), needed)
    pieces = np.clip(np.ceil(needed), 2, MAX_PIECES).astype(np.int64)

    owner = np.repeat(np.arange(len(pieces)), pieces)
    place = np.arange(len(owner)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    width = (spans.end - spans.start) / pieces
    start = spans.start[owner] + place * width[owner]
    is_last = place == pieces[owner] - 1
    end = np.where(is_last, spans.end[owner], start + width[owner])

    move = spans.move[owner]
    words = run.motions.words
    tips, axes = run.control.between(words[run.moves[move] - 1], words[run.moves[move]], end)
    last = tips + run.control.centre_height * axes
    far = spans.far[owner].copy()
    wanted = run.control.radius + run.slack + (spans.length / pieces)[owner[~is_last]]
    far[~is_last] = run.part.signed(last[~is_last], wanted)
    is_first = place == 0
    first = np.where(is_first[:, None], spans.first[owner], np.roll(last, 1, axis=0))
    near = np.where(is_first, spans.near[owner], np.roll(far, 1))
    return (_Spans(move, start, end=end, first=first, last=last, near=near, far=far), run.control.radius - far, last)


def centre_bows(control: Control, start: Float[ndarray, "n 5"], end: Float[ndarray, "n 5"]) -> Float[ndarray, "n"]:
    """An upper bound of |c''| of the ball centre over each move (words at its start and end), u in [0, 1];
    mm.

    Linear axes move evenly by v and rotary axes turn evenly by w in all, so |c''| <= lever w^2 + 2 w |v|, the
    lever being the largest distance of the ball centre from the pivots.
    """
    turn = np.abs(end[:, 3:] - start[:, 3:]).sum(1)
    if control.tool_centre:
        return np.zeros(len(turn)) if control.programs_centre else control.centre_height * turn**2

    start, end = control.joints(start), control.joints(end)
    lever = np.full(len(turn), control.centre_height)
    pivots = [np.array(axis.pivot) for axis in control.machine.part_axes]
    if pivots:
        at_start = np.linalg.norm(start[:, :3] - pivots[-1], axis=1)
        at_end = np.linalg.norm(end[:, :3] - pivots[-1], axis=1)
        between_pivots = sum(float(np.linalg.norm(b - a)) for a, b in pairwise(pivots))
        lever = lever + np.maximum(at_start, at_end) + between_pivots
    for axis in filter(lambda axis: axis.letter, control.machine.tool_axes):
        lever = lever + 2 * float(np.linalg.norm(axis.pivot)) + 2 * control.tool_length
    length = np.linalg.norm(end[:, :3] - start[:, :3], axis=1)
    return lever * turn**2 + 2 * turn * length
