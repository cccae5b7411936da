"""The moves of a program, as they were read from its text."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.machine.control import Control
from bonecam.tool.enveloping_ball import EnvelopingBall, enveloping_ball


@dataclass(frozen=True)
class Tool:
    """A cutter as the program's header describes it in a `line`: radius, and length from tip to spindle nose; the
    radius of the `corner` of a bull nose, 0 of a flat end, None of a ball; mm. It leans by the `lead`, radians."""

    number: int
    radius: float
    length: float
    line: int = 0
    corner: float | None = None
    lead: float = np.pi / 2

    @property
    def arc(self) -> float:
        """Radius of the arc that cuts, mm: that of the corner, or of the ball."""
        return self.radius if self.corner is None else self.corner

    @property
    def envelope(self) -> EnvelopingBall:
        """The ball that holds its end."""
        return enveloping_ball(self.radius, self.arc, self.lead)


COLUMNS = 15
"""Columns of the table that `motions_of` takes."""


@dataclass(frozen=True)
class PartialMove:
    """A move after which not all axes are known: `joints`, X, Y, Z of the spindle nose in machine coordinates (mm)
    and the rotary axes (degrees), NaN where not known; or a `retract`."""

    line: int
    tool: int
    joints: tuple[float, ...]
    retract: bool = False


@dataclass(frozen=True, eq=False)
class Motions:
    """Moves to fully known positions, in order; row i is the move that arrives there.

    `words` (n, 5): X Y Z in mm and the rotary words in radians, unwound; `feed_rates` in mm/min, or 1/min
    where `inverse_time`, NaN for rapids; `lines` of the text (from 1); `known_start`: the position before the
    move is known too, so that all of it can be simulated; `links`: feed moves behind a comment LINK; `tips` (mm)
    and `axes` in the part's frame by forward kinematics. `blocks` counts every moving block, also those that
    leave the position partly unknown: these are `partial`. `spindle`: its speed in 1/min, 0 where it stands; `coolant`:
    it runs. `tolerances`: how far the control may leave the points, mm; infinite where the text leaves that to the
    control, NaN where the dialect has no words for it. `short_way`: endless axes turn the short way by their words.
    `controls` and `described`, the tools of the header, by tool number.
    """

    rapid: Bool[ndarray, "n"]
    words: Float[ndarray, "n 5"]
    feed_rates: Float[ndarray, "n"]
    inverse_time: Bool[ndarray, "n"]
    lines: Int[ndarray, "n"]
    tools: Int[ndarray, "n"]
    known_start: Bool[ndarray, "n"]
    links: Bool[ndarray, "n"]
    tips: Float[ndarray, "n 3"]
    axes: Float[ndarray, "n 3"]
    blocks: int
    controls: dict[int, Control]
    spindle: Float[ndarray, "n"]
    coolant: Bool[ndarray, "n"]
    tolerances: Float[ndarray, "n"]
    partial: tuple[PartialMove, ...]
    short_way: bool
    described: dict[int, Tool]


def motions_of(
    table: Float[ndarray, "n 15"],
    controls: dict[int, Control],
    blocks: int,
    partial: Sequence[PartialMove],
    short_way: bool,
    described: dict[int, Tool],
) -> Motions:
    """The moves of a table of rows: five words (mm, degrees), rapid, feed, inverse time, line, tool, known start,
    link, speed of the spindle, coolant, tolerance."""
    words = np.column_stack([table[:, :3], np.radians(table[:, 3:5])])
    numbers = table[:, 9].astype(np.int64)
    tips = np.zeros((len(table), 3))
    axes = np.zeros((len(table), 3))
    for number, control in controls.items():
        rows = numbers == number
        tips[rows], axes[rows] = control.poses(words[rows])
    return Motions(
        rapid=table[:, 5] == 1,
        words=words,
        feed_rates=table[:, 6],
        inverse_time=table[:, 7] == 1,
        lines=table[:, 8].astype(np.int64),
        tools=numbers,
        known_start=table[:, 10] == 1,
        links=(table[:, 11] == 1) & (table[:, 5] == 0),
        tips=tips,
        axes=axes,
        blocks=blocks,
        controls=controls,
        spindle=table[:, 12],
        coolant=table[:, 13] == 1,
        tolerances=table[:, 14],
        partial=tuple(partial),
        short_way=short_way,
        described=described,
    )
