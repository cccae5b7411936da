"""Where the spindle nose goes during the moves of a text, between their ends too.

Under tool-centre control the tip runs straight while the rotary axes turn, so a linear axis may go farther than at both
ends of a block. With the turns T of the rotary axes, each x -> pivot + Rot(x - pivot), and a point that is moved with
speed v and acceleration a at a distance d from the pivot, the turn by w a block leaves at most

    v' = w d + v,        a' = w^2 d + 2 w v + a,

so that an axis leaves the line between its ends by a / 8 at most. Moves whose bound reaches a value are sampled.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.arrays import lengths
from bonecam.machine.axes import RotaryAxis
from bonecam.machine.control import Control
from bonecam.machine.kinematics import UP, inverse_linear
from bonecam.machine.machine import Machine
from bonecam.nc.reading.motions import Motions

SAMPLES = 65
"""Places that a doubtful move is sampled at: a bound of 1 mm is then kept within 0.3 um."""
MOST_AT_ONCE = 2000
"""Moves sampled at once: bounds the memory."""


@dataclass(frozen=True, eq=False)
class NoseMoves:
    """X, Y, Z of the spindle nose (machine coordinates, mm) at the `starts` and `ends` of moves; `bows`: what it may
    leave the line between them by. Where the start is not known it is the end."""

    machine: Machine
    motions: Motions
    starts: Float[ndarray, "n 3"]
    ends: Float[ndarray, "n 3"]
    bows: Float[ndarray, "n"]

    def reaching(self, column: int, sign: float, value: float) -> Int[ndarray, "k"]:
        """The moves that may bring `sign` times an axis above a `value`, mm."""
        highest = np.maximum(sign * self.starts[:, column], sign * self.ends[:, column]) + self.bows
        return np.flatnonzero(highest > value)

    def highest(self, column: int, sign: float, moves: Int[ndarray, "k"]) -> Float[ndarray, "k"]:
        """The largest value of `sign` times an axis in some moves, mm."""
        highest = [
            self._sampled(column, sign, moves[at : at + MOST_AT_ONCE]) for at in range(0, len(moves), MOST_AT_ONCE)
        ]
        return np.concatenate([np.zeros(0), *highest])

    def _sampled(self, column: int, sign: float, moves: Int[ndarray, "k"]) -> Float[ndarray, "k"]:
        before = np.where(self.motions.known_start[moves], moves - 1, moves)
        first, last = self.motions.words[before], self.motions.words[moves]
        fractions = np.linspace(0.0, 1.0, SAMPLES)[:, None, None]
        words = (first + fractions * (last - first)).reshape(-1, 5)
        tools = np.tile(self.motions.tools[moves], SAMPLES)
        noses = _noses(self.machine, self.motions.controls, words, tools)
        return np.asarray((sign * noses[:, column]).reshape(SAMPLES, -1).max(axis=0))


def nose_moves(motions: Motions, machine: Machine) -> NoseMoves:
    """The moves of the spindle nose in a text."""
    ends = _noses(machine, motions.controls, motions.words, motions.tools)
    known = motions.known_start
    starts = np.where(known[:, None], np.roll(ends, 1, axis=0), ends)
    return NoseMoves(machine, motions, starts, ends, np.where(known, _bows(motions, machine), 0.0))


def _noses(
    machine: Machine, controls: dict[int, Control], words: Float[ndarray, "n 5"], tools: Int[ndarray, "n"]
) -> Float[ndarray, "n 3"]:
    """X, Y, Z of the spindle nose (mm) where the control stands at words (mm, rad) with one of its tools."""
    noses = np.zeros((len(words), 3))
    for number, control in controls.items():
        rows = tools == number
        joints = words[rows]
        if control.tool_centre:
            tips, _ = control.poses(joints)
            joints = inverse_linear(machine, tips, joints[:, 3:], control.tool_length)
        noses[rows] = joints[:, :3] + [0.0, 0.0, control.tool_length]
    return noses


def _bows(motions: Motions, machine: Machine) -> Float[ndarray, "n"]:
    """By how much (mm) the nose may leave the line between the ends of each move; the first has no start."""
    bows = np.zeros(len(motions.words))
    steps = np.abs(np.diff(motions.words, axis=0, prepend=motions.words[:1]))
    for number, control in motions.controls.items():
        rows = motions.tools == number
        if not control.tool_centre:
            continue
        turns = steps[rows, 3:]
        # the programmed point runs straight: where it is the ball's centre, the tip turns about that
        lift = control.centre_height if control.programs_centre else 0.0
        turned = turns.sum(axis=1)
        speed = lengths(steps[rows, :3]) + lift * turned
        part = _accelerations(
            machine,
            machine.part_axes,
            turns=turns,
            points=machine.in_machine(motions.tips[rows]) + machine.part_zero,
            speed=speed,
            acceleration=lift * turned**2,
        )
        tip = np.tile(-control.tool_length * UP, (len(turns), 1))
        still = np.zeros(len(turns))
        bows[rows] = (
            part
            + _accelerations(machine, machine.tool_axes[::-1], turns=turns, points=tip, speed=still, acceleration=still)
        ) / 8
    return bows


def _accelerations(
    machine: Machine,
    axes: Sequence[RotaryAxis],
    turns: Float[ndarray, "n 2"],
    points: Float[ndarray, "n 3"],
    speed: Float[ndarray, "n"],
    acceleration: Float[ndarray, "n"],
) -> Float[ndarray, "n"]:
    """Bounds of the acceleration (mm a block squared) of points (at the end of each move) that the `axes` turn one
    after the other, from their own `speed` and `acceleration`."""
    farthest = np.zeros(len(points))
    for index, axis in enumerate(axes):
        pivot = np.array(axis.pivot)
        if index == 0:
            farthest = lengths(points - pivot) + speed
        else:
            farthest = farthest + float(np.linalg.norm(pivot - axes[index - 1].pivot))
        turn = turns[:, machine.column(axis) - 3]
        acceleration = turn**2 * farthest + 2 * turn * speed + acceleration
        speed = turn * farthest + speed
    return acceleration
