"""The start of a run where the control fixes X, Y, Z to the table as it stands when tool-centre control is switched on.

It is switched on with all rotary axes at zero, the spindle where tools start (`travel.py`). Then the
rotary axes turn to their angles in steps, the spindle staying where it is: its words follow the table. Between two
steps the tip runs straight in the part instead of on its arc; over a step of 10 degrees it comes nearer to the pivot
by 0.4 % of its distance from it, which the approach height allows for.
"""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import MachineError
from bonecam.machine.control import Control
from bonecam.machine.kinematics import forward
from bonecam.nc.dialect import Dialect
from bonecam.nc.posting.axis_words import move_words, word_texts
from bonecam.nc.posting.feeds.feed_scale import on_scale, stepped_feeds
from bonecam.nc.posting.path_words import drivable_rates, round_words
from bonecam.nc.posting.rows.split import MAX_TURN


def start_texts(
    dialect: Dialect, control: Control, angles_deg: Float[ndarray, "2"], start: Float[ndarray, "3"], rapid: float
) -> tuple[str, str, list[str]]:
    """The words of the rotary axes at zero, the word of Z without its letter where tool-centre control is switched on,
    and the blocks that turn the axes under it to `angles_deg`, at the feed `rapid` (mm/min) or what the axes can."""
    steps = start_words(dialect, control, angles_deg, start)
    words, _ = move_words(control.machine, dialect, steps)
    rows = [" ".join(words.formats) % tuple(row) for row in words.numbers.tolist()]
    feed = dialect.numbers.feed
    scale = np.unique(np.r_[stepped_feeds(feed), rapid])
    rates = feed.rounded_down(on_scale(np.r_[rapid, drivable_rates(control, steps, rapid)], scale))
    turn = [
        line
        for row, rate in zip(rows, rates.tolist(), strict=True)
        for line in dialect.lines("feed", words=row, feed=feed.text(rate))
    ]
    rotary = word_texts(control.machine, dialect, steps[0])[3:]
    return " ".join(rotary), dialect.numbers.length.text(steps[0, 2]), turn


def start_words(
    dialect: Dialect, control: Control, angles_deg: Float[ndarray, "2"], start: Float[ndarray, "3"]
) -> Float[ndarray, "n 5"]:
    """Words (mm, deg) from all rotary axes at zero to `angles_deg`, the spindle standing where tools `start` (X, Y and
    Z of the tip in the machine's frame, mm); MachineError where a rotary axis cannot stand at zero."""
    machine = control.machine
    for axis in machine.rotary:
        low, high = axis.limits
        if not low <= 0.0 <= high:
            what = f"{axis.letter} of {machine.title} cannot stand at zero, where {dialect.name} switches its"
            raise MachineError(
                f"{what} tool-centre control on: take another controller, or machine",
                machine=machine.name,
                dialect=dialect.name,
                axis=axis.letter,
            )
    target = np.radians(angles_deg)
    for column, axis in enumerate(machine.rotary):
        if axis.endless and not axis.bounded:
            target[column] -= 2 * np.pi * np.round(target[column] / (2 * np.pi))
    steps = max(int(np.ceil(np.abs(target).max() / MAX_TURN)), 1)
    angles = np.linspace(0.0, 1.0, steps + 1)[:, None] * target
    joints = np.column_stack([np.tile(start, (steps + 1, 1)), angles])
    tips, _ = forward(machine, joints, control.tool_length)
    return round_words(dialect, control, tips, angles)
