"""Words that give the tool's direction as a vector: what is written of it, and the rotary angles that the control
takes.

The vector leads from the tip to the spindle, along the axes of the machine as they stand with all rotary axes at zero,
as X, Y, Z do. Of the two solutions, and of the whole turns of each axis, the control takes those nearest to where its
axes stand, within their limits; an axis that every angle suits stays.
"""

import re
from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.arrays import lengths
from bonecam.errors import MachineError
from bonecam.machine.kinematics import LIMIT_GUARD, inverse_rotary, tool_axes
from bonecam.machine.machine import Machine
from bonecam.nc.dialect import Dialect
from bonecam.nc.schema import VectorTable

UNIT = 1e-4
"""A vector is a unit vector where its length differs from 1 by less."""
PARTS = (0.25, 0.5, 0.75, 1.0)
"""Where within a move the tool's direction is looked at."""
LEANS = 5e-4
"""By how much the tool may lean otherwise than meant (rad): 1 um on a ball of 2 mm."""
LEAST = np.radians(0.001)
"""A tool on the axis of a table is leant by this (rad), one step of the words of angles: its vector then says how the
table stands, within 2 degrees where it has 6 decimals."""
TURNED = np.radians(1.0)
"""An axis that the control would turn by more (rad) beside what was planned needs its angle in words: at the pole,
where vectors do not say how the table stands."""


def vectors_of(machine: Machine, vector: VectorTable, angles: Float[ndarray, "n 2"]) -> Float[ndarray, "n 3"]:
    """The components of the tool's directions at rotary angles (rad), as they are written."""
    return vector.number.rounded(machine.in_machine(tool_axes(machine, angles)))


def solved_angles(
    machine: Machine,
    vectors: Float[ndarray, "n 3"],
    before: Float[ndarray, "2"],
    stated: Float[ndarray, "n 2"] | None = None,
) -> tuple[Float[ndarray, "n 2"], Bool[ndarray, "n"]]:
    """The rotary angles (rad, unwound) that a control takes one after the other from those `before`, NaN from the first
    vector on that is no unit vector, or is not reached; and, where angles are `stated` that should be taken, which rows
    are off by more than TURNED: behind these it goes on from what is stated."""
    length = np.linalg.norm(vectors, axis=1)
    axes = machine.in_part(vectors / np.where(length > 0, length, 1.0)[:, None])
    pairs, free = inverse_rotary(machine, axes)
    pairs[np.abs(length - 1) >= UNIT] = np.nan
    bounds = [axis.limits for axis in machine.rotary]
    meant = [] if stated is None else stated.tolist()
    angles = np.full((len(vectors), 2), np.nan)
    off = np.zeros(len(vectors), dtype=bool)
    stand = (float(before[0]), float(before[1]))
    for row, (solutions, stays) in enumerate(zip(pairs.tolist(), free.tolist(), strict=True)):
        nearest = None
        travel = np.inf
        for solution in solutions:
            there, way = _nearest(solution, stays, stand, bounds)
            if way < travel:
                nearest, travel = there, way
        if meant:
            one, two = meant[row]
            if nearest is None or max(abs(nearest[0] - one), abs(nearest[1] - two)) > TURNED:
                off[row] = True
                nearest = (one, two)
        if nearest is None:
            break
        angles[row] = stand = nearest
    return angles, off


def angles_from(
    machine: Machine, stand_deg: Sequence[float | None]
) -> Callable[[Float[ndarray, "n 3"]], Float[ndarray, "n 2"]]:
    """What gives the angles (degrees) of `solved_angles` from where the axes stand, None: not known, then NaN."""
    before = np.radians([np.nan if angle is None else angle for angle in stand_deg])
    return lambda vectors: np.degrees(solved_angles(machine, vectors, before)[0])


def _nearest(
    solution: list[float], stays: list[bool], stand: tuple[float, float], bounds: list[tuple[float, float]]
) -> tuple[tuple[float, float], float]:
    """The angles (rad) of a solution in the turns nearest to where the axes `stand`, and the way to them, rad; infinite
    beyond the limits."""
    there = [0.0, 0.0]
    way = 0.0
    for column in (0, 1):
        if stays[column]:
            there[column] = stand[column]
            continue
        turn = (solution[column] - stand[column] + np.pi) % (2 * np.pi) - np.pi
        low, high = bounds[column]
        there[column] = stand[column] + turn
        inside = low - LIMIT_GUARD <= there[column] <= high + LIMIT_GUARD
        way += abs(turn) if inside else np.inf
    return (there[0], there[1]), way


def written_vectors(
    machine: Machine, vector: VectorTable, words: Float[ndarray, "n 5"]
) -> tuple[Float[ndarray, "n 6"], Bool[ndarray, "n"]]:
    """X, Y, Z and the tool's direction of successive words (mm, deg), as they are written, and which of them must be
    written as rotary words, since the control would turn an axis otherwise. Where it takes none, the tool is leant by
    LEAST at the pole; MachineError where it would lean otherwise than meant on the way all the same."""
    angles = np.radians(words[:, 3:])
    vectors = vectors_of(machine, vector, angles)
    solved, off = solved_angles(machine, vectors, angles[0], angles)
    if vector.takes_angles or not off.any():
        return np.column_stack([words[:, :3], vectors]) + 0.0, off
    vectors = vectors_of(machine, vector, _leant(machine, vectors, angles))
    solved, _ = solved_angles(machine, vectors, angles[0])
    wrong = ~(_between(machine, solved, angles) <= LEANS)
    if wrong.any():
        row = int(np.argmax(wrong)) + 1
        tilt = ", ".join(
            f"{axis.letter} {value:.3f}" for axis, value in zip(machine.rotary, words[row, 3:], strict=True)
        )
        raise MachineError(
            f"near {tilt} deg a tool vector does not say how the axes of {machine.name} stand, the control may turn "
            'them otherwise: give nc.axes = "angles", or another path.lead_deg',
            row=row,
        )
    return np.column_stack([words[:, :3], vectors]) + 0.0, np.zeros(len(words), dtype=bool)


def _leant(machine: Machine, vectors: Float[ndarray, "n 3"], angles: Float[ndarray, "n 2"]) -> Float[ndarray, "n 2"]:
    """The angles (rad) with the tool leant by LEAST where every angle of an axis gives its direction: then it says
    which one is meant."""
    axes = machine.in_part(vectors)
    _, free = inverse_rotary(machine, axes / lengths(axes)[:, None], LEAST)
    leant = angles.copy()
    for column in (0, 1):
        rows = free[:, 1 - column] & (np.abs(angles[:, column]) < LEAST)
        # on the side from which, or to which, the tool leans beside these rows
        sides = np.where(rows, 0.0, np.sign(angles[:, column]))
        last = np.maximum.accumulate(np.where(sides != 0, np.arange(len(sides)), -1))
        before = np.where(last >= 0, sides[np.maximum(last, 0)], 0.0)
        free_side = -1.0 if machine.rotary[column].limits[0] < -LEAST else 1.0
        leant[:, column] = np.where(rows, np.where(before == 0, free_side, before) * LEAST, angles[:, column])
    return leant


def _between(machine: Machine, solved: Float[ndarray, "n 2"], meant: Float[ndarray, "n 2"]) -> Float[ndarray, "m"]:
    """By how much (rad) the tool leans otherwise within each move between successive angles, at most."""
    return np.max(
        [
            lengths(
                tool_axes(machine, (1 - part) * solved[:-1] + part * solved[1:])
                - tool_axes(machine, (1 - part) * meant[:-1] + part * meant[1:])
            )
            for part in PARTS
        ],
        axis=0,
    )


def vector_formats(dialect: Dialect, vector: VectorTable) -> list[str]:
    """The printf formats of X, Y, Z and the components of the tool's direction."""
    length = [f"{letter}{dialect.numbers.length.spec}" for letter in "XYZ"]
    return length + [word.replace("%", "%%").format(number=vector.number.spec) for word in vector.words]


def vector_patterns(vector: VectorTable, number: str) -> list[str]:
    """The patterns of the words of the tool's direction, with their numbers, of the pattern `number`, in groups."""
    return [re.escape(word.replace("{number}", "")) + f"({number})" for word in vector.words]
