"""Stacks of cylinders and cones: holders, spindle noses, and what stands on a table.

The bodies of a machine that a tool path keeps clear of: its table, what stands there, and the spindle nose; and
meshes of its links, which a program is held against.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from bonecam.text.numbers import number

MOST_FRUSTUMS = 20
"""A stack of more is refused: it would slow every collision check down."""


@dataclass(frozen=True)
class Frustum:
    """A cylinder, or a cone whose diameter changes evenly from its lower end to its upper one; mm."""

    length: float
    diameter: float
    top_diameter: float


def stack_of(rows: Iterable[Sequence[float | int]]) -> tuple[Frustum, ...]:
    """The stack of rows [length, diameter] (a cylinder) or [length, diameter, upper diameter] (a cone), from its
    lower end up; mm.

    ValueError where a row has another number of values, or one that is not positive.
    """
    stack = []
    for row in rows:
        numbers = [float(value) for value in row]
        if len(numbers) not in (2, 3) or not all(0 < value < math.inf for value in numbers):
            message = " ".join(f"{value:g}" for value in numbers)
            raise ValueError(f"{message or 'nothing'}: give positive length, diameter and, of a cone, upper diameter")
        stack.append(Frustum(numbers[0], numbers[1], numbers[-1]))
    if len(stack) > MOST_FRUSTUMS:
        raise ValueError(f"{len(stack)} pieces: give at most {MOST_FRUSTUMS}")
    return tuple(stack)


def stack_from_text(text: str) -> tuple[Frustum, ...]:
    """The stack of a text such as '35 10 17, 20 40': rows of `stack_of` with commas between; none of an empty one.

    ValueError as of `stack_of`, or where a word is no number.
    """
    rows = [row.split() for row in text.split(",")] if text.strip() else []
    return stack_of([[number(word) for word in row] for row in rows])


def stack_as_text(rows: Iterable[Iterable[float | int]]) -> str:
    """The text of rows of numbers, for `stack_from_text`."""
    return ", ".join(" ".join(str(value) for value in row) for row in rows)


def stack_length(stack: Sequence[Frustum]) -> float:
    """Length of a whole stack, mm."""
    return math.fsum(piece.length for piece in stack)


@dataclass(frozen=True)
class Table:
    """A table whose top is z = 0: a disc about the Z axis of `radius`, or a plate that reaches to +-`half_width`
    along X and +-`half_depth` along Y; mm, infinite where it has no such edge.

    `open_beside`: what is below its plane beside it is free; else nothing of a tool goes below the plane.
    `standing`: the stack that stands on it round the Z axis, from z = 0 up.
    """

    radius: float = math.inf
    half_width: float = math.inf
    half_depth: float = math.inf
    open_beside: bool = False
    standing: tuple[Frustum, ...] = ()


BED = "bed"
"""The link of a machine that stands still."""


@dataclass(frozen=True)
class LinkBody:
    """A body of a machine as a mesh, called by its `name`: that of an STL `file` in `units`, which moves with the
    `link`: a rotary letter, "XYZ" (the linear axes), or BED.

    Its place is that in the machine's frame, all axes at zero; of what XYZ carries it is measured from the spindle
    nose."""

    name: str
    link: str
    file: Path
    units: str = "mm"


@dataclass(frozen=True)
class MachineBodies:
    """The spindle `nose`, a stack behind the gauge line (empty where it is not known), and the table."""

    nose: tuple[Frustum, ...] = ()
    table: Table = field(default_factory=Table)
