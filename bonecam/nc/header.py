"""The header of a program: what a machinist must know before the start, as comments.

It tells what must be mounted, how the control must be set, what the program will do, the room that it takes (the range
of every axis, and the height above all that it does), where its zero is in the words that the control reads, and how
the words of its axes are written.

The air check is one small turn of each rotary axis and what must be seen, from the machine file alone. A control that
turns an axis the other way, counts it from another zero or takes one axis for the other shows something else than
these sentences tell, before anything is cut. Of an axis that carries the part a mark on the table is watched, of one
that carries the tool the tip. Directions are those of the machine; they are told as seen from the middle of the table,
or from the pivot of the head, so that they hold wherever the axes lie.

Where the control fixes X, Y, Z to the table as it stands when tool-centre control is switched on, a run starts so: it
is switched on with all rotary axes at zero, the spindle where tools start. Then the rotary axes turn to their angles
in steps, the spindle staying where it is: its words follow the table. Between two steps the tip runs straight in the
part instead of on its arc; over a step of 10 degrees it comes nearer to the pivot by 0.4 % of its distance from it,
which the approach height allows for.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import lengths, unit
from bonecam.errors import MachineError
from bonecam.job import Job
from bonecam.job.holding_section import MILLED, NO_FLAT
from bonecam.job.materials.preset import Material, read_material
from bonecam.machine.control import Control
from bonecam.machine.kinematics import forward, inverse_linear, tool_axes
from bonecam.machine.machine import Machine
from bonecam.machine.machine_file import RotaryAxis
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.nc.dialect import Dialect
from bonecam.nc.feeds import feed_figures, on_scale, stepped_feeds
from bonecam.nc.path_words import (
    APPROACH_HEIGHT,
    MAX_TURN,
    Posted,
    drivable_rates,
    in_radians,
    joints_and_lengths,
    round_words,
)
from bonecam.nc.program import Program, ProgramTime
from bonecam.nc.words import comment, comments_of, move_words, word_texts
from bonecam.planning.blank import bar_of
from bonecam.planning.stump import cut_groove
from bonecam.setup.stock import Stock, kind_of
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import MoveKind, ToolPath
from bonecam.workholding.clamping import holding_columns
from bonecam.workholding.post import tailstock_bodies, tailstock_columns


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


def check_at_zero(machine: Machine, asked: str, where: str = "") -> None:
    """MachineError where a rotary axis cannot stand at zero, as what is `asked` of a job wants it."""
    for axis in machine.own_rotary:
        low, high = np.degrees(axis.limits)
        if not low <= 0.0 <= high:
            what = f"{axis.letter} of {machine.name} cannot stand at zero ({low:g} to {high:g} deg){where}"
            raise MachineError(f"{what}: leave {asked} out", machine=machine.name, axis=axis.letter)


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


def travel_of(machine: Machine, job: Job, paths: Sequence[Posted]) -> tuple[Float[ndarray, "5 2"], Float[ndarray, "3"]]:
    """Lowest and highest value of every axis in a program: X, Y, Z of the spindle nose in mm, rotary axes in degrees,
    unwound; and where every tool is to start, X, Y and Z of its tip in the machine's frame (mm): over the program's
    zero, or, where the part's Z does not stand upright with all rotary axes at zero, over its place as far from the
    table as any approach: over zero the spindle would stand across the table's plane. The height is above everything
    the program does, and above table and chuck, whatever the rotary axes do meanwhile. MachineError with axis, value,
    limit and level where the spindle nose leaves its limits or the program its travel."""
    tips = [posted.control.poses(in_radians(posted.approaches))[0] for posted in paths]
    farthest = max(float(each[:, 2].max()) for each in tips)
    over = machine.in_machine(np.array([[0.0, 0.0, farthest]]))[0] + machine.part_zero
    approaches = [joints_and_lengths(posted.control, posted.approaches)[0] for posted in paths]
    heights = [joints[:, 2].max() for joints in approaches]
    if machine.part_axes:
        pivot = np.array(machine.part_axes[-1].pivot)
        # while the table swings under the tool, the part sweeps at most this ball about the pivot
        reach = [lengths(posted.joints[:, :3] - pivot).max() for posted in paths]
        heights.append(pivot[2] + max(*reach, table_reach(machine, job)))
    start = np.array([over[0], over[1], np.ceil(max(heights) + APPROACH_HEIGHT)])
    ranges = np.column_stack([np.full(5, np.inf), np.full(5, -np.inf)])
    for posted in paths:
        dialect, control = posted.dialect, posted.control
        starts = [
            start_words(dialect, control, words[3:], start) for words in posted.approaches if dialect.starts_at_zero
        ]
        more, _ = joints_and_lengths(control, np.vstack([posted.approaches, *starts]))
        # what the template that moves a tool over zero does not say is that of the first joints
        first = [[*start, *posted.joints[0, 3:]]] if "{over_zero}" in dialect.templates.tool else more[:0]
        nose = np.vstack([posted.joints, more, first])
        nose[:, 3:] = np.degrees(nose[:, 3:])
        nose[:, 2] += control.tool_length
        for column, axis in enumerate(machine.linear):
            _check_limits(axis.letter, axis.limits, nose[:, column], posted, machine)
        lift = control.tool_length if dialect.templates.lift else 0.0
        top = np.array([[-np.inf] * 2 + [float(start[2]) + control.tool_length + lift] + [-np.inf] * 2])
        ranges[:, 0] = np.minimum(ranges[:, 0], nose.min(0))
        ranges[:, 1] = np.maximum(ranges[:, 1], np.vstack([nose, top]).max(0))
        level = posted.path.level
        for axis, (low, high) in zip(machine.linear, ranges.tolist(), strict=False):
            if high - low > axis.travel:
                raise MachineError(
                    f"level {level}: {axis.letter} runs over {high - low:.1f} mm, travel {axis.travel:.1f} mm "
                    f"of {machine.title}: take a machine with more travel, a shorter tool, post or part",
                    axis=axis.letter,
                    value=high - low,
                    limit=axis.travel,
                    level=level,
                )
    return ranges, start


def above(posted: Posted, run: int, retract: float) -> Float[ndarray, "5"]:
    """Words (mm, deg) of the place on the tool axis over the approach of a run, at the retract height."""
    return _raised(posted, posted.approaches[run][None], retract)


def lifted(posted: Posted, run: int, retract: float) -> Float[ndarray, "5"]:
    """Words (mm, deg) of the place on the tool axis over the end of a run at the retract height; above it by the length
    of the tool where the dialect lifts it, so that a control that drops the tool by its length leaves it above
    everything."""
    end = posted.runs[run][1] - 1
    more = posted.control.tool_length if posted.dialect.templates.lift else 0.0
    return _raised(posted, posted.words[end][None], retract, more)


def _raised(posted: Posted, words: Float[ndarray, "1 5"], height: float, more: float = 0.0) -> Float[ndarray, "5"]:
    """Words (mm, deg) moved along the tool axis until the tip is at a machine Z of `height`, and by `more`."""
    joints, _ = joints_and_lengths(posted.control, words)
    lift = max(height - float(joints[0, 2]), 0.0) + more
    radians = in_radians(words)
    if not posted.control.tool_centre:
        return np.asarray(words[0] + [0.0, 0.0, lift, 0.0, 0.0])
    tips, axes = posted.control.poses(radians)
    return np.asarray(round_words(posted.dialect, posted.control, tips + lift * axes, radians[:, 3:])[0])


def table_reach(machine: Machine, job: Job) -> float:
    """The farthest that table, chuck and what else stands there reach from the pivot about which they swing under the
    tool, mm, as far as they are known."""
    pivot = np.array(machine.part_axes[-1].pivot)
    table = machine.table
    edges = [(0.0, radius) for radius in (table.radius, np.hypot(table.half_width, table.half_depth))]
    edges.append((0.0, 0.0))
    held = [*holding_columns(job.holding).values(), *tailstock_bodies(job.holding)]
    edges += [(column.top, column.radius + float(np.hypot(column.x, column.y))) for column in held]
    height = 0.0
    for piece in table.standing:
        height += piece.length
        edges.append((height, max(piece.diameter, piece.top_diameter) / 2))
    zero = np.array(machine.part_zero) - pivot
    up = machine.in_machine(np.array([[0.0, 0.0, 1.0]]))[0]
    return max(float(np.linalg.norm(zero + high * up)) + radius for high, radius in edges if np.isfinite(radius))


def _check_limits(letter: str, limits: tuple[float, float], nose: ndarray, posted: Posted, machine: Machine) -> None:
    """MachineError where the spindle nose (mm along one axis) leaves the limits of the axis."""
    for value, limit, off in (
        (nose.min(), limits[0], nose.min() < limits[0]),
        (nose.max(), limits[1], nose.max() > limits[1]),
    ):
        if not off:
            continue
        row = int(np.argmin(np.abs(nose - value)))
        rows = np.r_[np.arange(len(posted.words)), [first for first, _ in posted.runs]]
        where = "the start of its tool"
        if row < len(rows):
            where = f"pass {int(posted.path.pass_index[posted.moves.rows[rows[row]]])}"
        raise MachineError(
            f"level {posted.path.level}, {where}: {letter} {value:.1f} mm leaves the limit "
            f"{limit:.1f} mm of {machine.title}: take a machine with more travel, or move part_zero",
            axis=letter,
            value=float(value),
            limit=float(limit),
            level=posted.path.level,
        )


class ZeroWords(NamedTuple):
    """X, Y and Z of the tip (mm, as texts) that stands on the program's zero, all rotary axes at zero."""

    x: str
    y: str
    z: str

    @property
    def over(self) -> str:
        """The place over the zero, as the texts of the setup tell it."""
        return f"{_word('X', self.x)} {_word('Y', self.y)}"

    @property
    def height(self) -> str:
        """The height of the zero, as the texts of the setup tell it."""
        return _word("Z", self.z)


def zero_words(machine: Machine, dialect: Dialect) -> ZeroWords:
    """0 0 0 under tool-centre control, whose datum is the program's zero; in machine coordinates `part_zero`."""
    if dialect.tool_centre:
        return ZeroWords("0", "0", "0")
    decimals = dialect.numbers.length.decimals
    x, y, z = (f"{round(value, decimals) + 0.0:.12g}" for value in machine.part_zero)
    return ZeroWords(x, y, z)


def over_zero(machine: Machine, dialect: Dialect, start: Float[ndarray, "3"]) -> str:
    """The words of X and Y where tools `start` (X, Y and Z of the tip in the machine's frame, mm)."""
    x, y, _ = start - machine.part_zero if dialect.tool_centre else start
    length = dialect.numbers.length
    return f"X{length.text(float(x))} Y{length.text(float(y))}"


def zero_texts(machine: Machine, dialect: Dialect) -> list[str]:
    """What X 0 Y 0 Z 0 is where words are machine coordinates, which do not turn with the part."""
    if dialect.tool_centre:
        return []
    zero = zero_words(machine, dialect)
    if zero == ZeroWords("0", "0", "0"):
        return ["X 0 Y 0 Z 0: program zero with all rotary axes at 0, the words do not turn with the part"]
    return [
        "X 0 Y 0 Z 0: zero of the machine file, not on the part, which stands as told at rotary axes 0",
        "Z of stock, post and clamping: heights over program zero",
    ]


def _word(letter: str, number: str) -> str:
    """A letter and its number, apart where that is zero."""
    return f"{letter} 0" if number == "0" else f"{letter}{number}"


TILT_DEG = 30.0
"""The turn of an axis that tilts, degrees: plainly seen, and within what most axes can."""
QUARTER_DEG = 90.0
"""The turn of an axis along the spindle, degrees: a mark goes from one axis of the machine to another."""
ALONG_SPINDLE = 0.9
"""An axis with such a share of Z turns about the spindle; below it, it tilts."""
SHOWN = 0.35
"""Components of a direction that are told, as a share of the largest."""
SEEN = np.sin(np.radians(1.0))
"""A unit vector that moves less is taken to stand still."""
ABOVE = 50.0
"""The place over the program's zero, where the tip is held, is so far above the blank, mm."""


def air_check_texts(control: Control, dialect: Dialect, top: float) -> list[str]:
    """What must be seen with all rotary axes at zero and as each turns, and of a control that reads machine coordinates
    poses that keep the tip on one place; lines of header and sheet. `top` is the upper end of the blank, mm."""
    machine = control.machine
    # The rotary joints (rad) at which the check begins
    start = np.array([turn_of(axis)[0] for axis in machine.rotary])
    # How the tool stands to the table before an axis turns
    tilt = np.degrees(np.arccos(np.clip(tool_axes(machine, start[None])[0, 2], -1.0, 1.0)))
    stands = "square to the table" if tilt < 1e-3 else f"{tilt:.3f} degrees from square to the table"
    at = " and ".join(f"{axis.letter} {_degrees(turn_of(axis)[0])}" for axis in machine.own_rotary)
    along = ""
    frame = _part_frame(machine, start)
    if np.allclose(frame, np.eye(3), atol=1e-9):
        along = ", X+ of the blank towards X+"
    elif not machine.stands:
        along = f", X+ of the blank towards {_words_of(frame[0])}, its Z+ towards {_words_of(frame[2])}"
    # that along the spindle last: on a head it is seen by the tilt of the other
    tilting_first = sorted(machine.own_rotary, key=lambda axis: abs(axis.direction[2]) > ALONG_SPINDLE)
    # Words that keep the tip on one place over the program's zero as each axis turns: a pivot or an offset that is not
    # the machine file's shows as a way of the tip. Poses beyond a limit of the spindle nose are left out
    places = []
    if not control.tool_centre:
        height = control.zero_height + float(np.ceil(top - control.zero_height + ABOVE))
        angles = [start, *(_turned(machine, start, axis) for axis in machine.own_rotary)]
        words = control.words(np.tile([0.0, 0.0, height], (len(angles), 1)), np.array(angles))
        nose = words[:, :3] + [0.0, 0.0, control.tool_length]
        low, high = np.array([axis.limits for axis in machine.linear]).T
        reached = np.all((nose >= low) & (nose <= high), axis=1)
        words[:, 3:] = np.degrees(words[:, 3:])
        over = f"{height - control.zero_height:.0f} mm over program zero"
        same = f"the tip must be at one and the same place, {over}, in each of these poses"
        places = [same, *(" ".join(word_texts(machine, dialect, row)) for row in words[reached])]
    return [
        "tool in the spindle, retracted, tool-centre control off, each axis driven by hand and back",
        "X+, Y+, Z+ are where the tool goes over the table as X, Y, Z grow",
        "marks on the table are watched from its middle",
        f"at {at} the tool must stand {stands}{along}",
        *(text for axis in tilting_first for text in _turn_texts(machine, axis, start)),
        *places,
    ]


def turn_of(axis: RotaryAxis) -> tuple[float, float]:
    """From where to where (rad) an axis turns in the check: from zero, or the limit next to it, up where there is
    room."""
    low, high = axis.limits
    start = min(max(0.0, low), high)
    turn = np.radians(QUARTER_DEG if abs(axis.direction[2]) > ALONG_SPINDLE else TILT_DEG)
    if start + turn <= high:
        return start, start + turn
    if start - turn >= low:
        return start, start - turn
    return start, high if high - start >= start - low else low


def _turned(machine: Machine, start: Float[ndarray, "2"], *axes: RotaryAxis) -> Float[ndarray, "2"]:
    """The joints with some axes at the end of their turns."""
    joints = start.copy()
    for axis in axes:
        joints[machine.column(axis) - 3] = turn_of(axis)[1]
    return joints


def _in_machine(machine: Machine, vectors: Float[ndarray, "n 3"], rotary: Float[ndarray, "2"]) -> Float[ndarray, "n 3"]:
    """Directions fixed to the part, in the machine's frame."""
    positions = inverse_linear(machine, np.vstack([np.zeros(3), vectors]), np.tile(rotary, (len(vectors) + 1, 1)))
    return positions[1:, :3] - positions[0, :3]


def _part_frame(machine: Machine, rotary: Float[ndarray, "2"]) -> Float[ndarray, "3 3"]:
    """X, Y and Z of the part in the machine's frame, a row each."""
    return _in_machine(machine, np.eye(3), rotary)


def _tip_direction(machine: Machine, rotary: Float[ndarray, "2"]) -> Float[ndarray, "3"]:
    """The direction from the spindle to the tip in the machine's frame."""
    return -_in_machine(machine, tool_axes(machine, rotary[None]), rotary)[0]


def _turn_texts(machine: Machine, axis: RotaryAxis, start: Float[ndarray, "2"]) -> list[str]:
    """What must be seen as one axis turns, and how the tool then stands on the table, if it leans."""
    end = _turned(machine, start, axis)
    if axis not in machine.part_axes:
        seen = _tip_text(machine, axis, start)
    else:
        # a mark on the X+ or Y+ side of the table, whichever moves more
        turn = np.linalg.inv(_part_frame(machine, start)) @ _part_frame(machine, end)
        sides = np.eye(3)[:2]
        ways = np.array([_across(side, side @ turn) for side in sides])
        # rounded: of two that move equally far the first
        side = int(np.argmax(np.round(np.linalg.norm(ways, axis=1), 6)))
        mark = f"a mark at {_words_of(sides[side])} of the table must go to {_words_of(ways[side])}"
        seen = f"{_to(axis)}: {mark}"
    # sides of the table are those that lie so with all axes at zero
    lean = machine.in_machine(tool_axes(machine, end[None]) * [1.0, 1.0, 0.0])[0]
    if np.linalg.norm(lean) < SEEN:
        return [seen]
    return [seen, f"{_to(axis)}: the tool, from tip to spindle, leans to {_words_of(lean)} of the table"]


def _tip_text(machine: Machine, axis: RotaryAxis, start: Float[ndarray, "2"]) -> str:
    """Where the tip swings as an axis turns the tool; about the tool itself nothing is seen, the other axis then tilts
    it first."""
    end = _turned(machine, start, axis)
    before, after = _tip_direction(machine, start), _tip_direction(machine, end)
    if np.linalg.norm(_across(before, after)) > SEEN:
        return f"{_to(axis)}: the tip of the tool must swing to {_words_of(_across(before, after))}"
    others = [one for one in machine.own_rotary if one != axis]
    if not others:
        return f"{_to(axis)}: the tip of the tool stays where it is"
    (other,) = others
    before, after = (
        _tip_direction(machine, joints) * [1.0, 1.0, 0.0]
        for joints in (_turned(machine, start, other), _turned(machine, start, other, axis))
    )
    held = f"{other.letter} at {_degrees(turn_of(other)[1])} and {_to(axis)}"
    return f"{held}: the tip of the tool must swing from {_words_of(before)} to {_words_of(after)}"


def _across(before: Float[ndarray, "3"], after: Float[ndarray, "3"]) -> Float[ndarray, "3"]:
    """The part of a unit vector across what it was."""
    return np.asarray(after - (after @ before) * before)


def _words_of(vector: Float[ndarray, "3"]) -> str:
    """A direction in words, its largest component first: X+, or Y- and Z+."""
    sizes = np.round(np.abs(unit(vector[None])[0]), 6)
    message = [k for k in np.argsort(-sizes, kind="stable") if sizes[k] > SHOWN * sizes.max()]
    return " and ".join("XYZ"[k] + ("+" if vector[k] > 0 else "-") for k in message)


def _to(axis: RotaryAxis) -> str:
    """The turn of an axis in words."""
    start, end = turn_of(axis)
    begun = f" from {_degrees(start)}" if start else ""
    return f"{axis.letter}{begun} to {_degrees(end)}"


def _degrees(angle: float) -> str:
    """An angle (rad) in degrees with its sign, zero without one."""
    value = round(float(np.degrees(angle)), 3)
    return f"{value:+g}" if value else "0"


VECTOR = [
    "tool axis: a unit vector from the tip to the spindle, along the axes of the part with all rotary axes at 0",
    "tool axis: the control takes the angles nearest to where its axes stand, and turns them evenly between blocks",
]
"""How the control must read the tool's direction, where that is a vector."""
_CHANGES = {
    "changer": "by the machine, every length measured in its tool table before the start",
    "stop": "by hand where the program stops, every length measured in the tool table before the start",
}
"""What the header says of each `nc.tool_change`."""


def part_texts(job: Job) -> list[str]:
    """That the part is mirrored or scaled, where it is."""
    return [f"the part is {change}" for change in job.mesh.changes]


def setup_texts(job: Job, stock: Stock | None, zero: ZeroWords, zero_height: float = 0.0) -> list[str]:
    """What must be mounted and where the zero is, `zero_height` (mm) above that of the part's frame; `stock` is None
    where only the paths are known."""
    level = partial(_level, zero_height)
    top = job.holding.length if stock is None else float(stock.bounds[0, 2])
    held = holding_columns(job.holding)
    stub = held.pop("stub", None)
    name, foot = ("post", 0.0) if stub is None else ("neck", stub.top)
    end = top if stock is None else _neck_end(stock, job.holding.diameter / 2)
    how = "milled" if job.holding.neck == MILLED else "turned"
    post = f"{name} below it: diameter {job.holding.diameter:.2f} mm, from {level(foot)} to {level(end)}"
    made = "turned before" if how == "turned" else "milled first"
    texts = [f"{post}, {made}, {'parted at the end' if job.holding.parting else 'left uncut'}", *part_texts(job)]
    if stub is not None:
        bar = f"bar of diameter {2 * stub.radius:.2f} mm, from {level(stub.bottom)} to {level(stub.top)}"
        texts.append(f"stub below the neck: {bar}, stock and neck are {how} from it")
    if stock is not None:
        low, high = stock.bounds[:, 2].tolist()
        sizes = ", ".join(f"{name} {size:.2f}" for name, size in stock.sizes.items())
        shape = kind_of(job.stock).shape
        sawn = bar_of(stock, job.holding)
        if sawn is not None:
            shape = (
                f"milled first from a plain bar of diameter {2 * sawn.radius:.2f} mm, its sawn end at {level(sawn.top)}"
            )
        texts = [
            f"stock: {stock.kind}, {sizes} mm",
            f"stock: from {level(low)} to {level(high)}",
            f"stock: {shape}, mounted so before the start",
            *texts,
        ]
    texts += _tailstock_texts(job, zero_height)
    if stock is not None:
        texts += touch_texts(job, stock, zero_height)
    over = f"program zero: {zero.over} on the axis of the post"
    on_end = f"{zero.height} on the end of the bar as it is clamped, its highest point"
    if not held:
        return [
            *texts,
            f"clamping: nothing of chuck, collet or vice may stand above {level(0.0)}",
            f"{over}, {on_end if zero_height else zero.height + ' on the table or on top of the clamping'}",
        ]
    lowest = next(iter(held))
    holds = f" round the {'post' if stub is None else 'stub'}"
    names = {"riser": "a riser", "chuck": "a chuck or collet"}
    for kind, column in held.items():
        where = holds if kind == "chuck" else ""
        size = f"of at most diameter {2 * column.radius:.2f} mm{where}, up to {level(column.top)}"
        texts.append(f"clamping: {names[kind]} {size}")
    texts.append(f"table: {level(0.0)} under the {lowest}")
    return [*texts, f"{over}, {on_end if zero_height else f'{zero.height} on the table under the {lowest}'}"]


NECK_STEP = 0.005
"""The end of the neck is found to this, mm."""


def _neck_end(stock: Stock, radius: float) -> float:
    """The height (mm) at which the side of a neck of this `radius` (mm) comes to the stock: above its lower end, where
    that is round."""
    heights = np.arange(stock.bounds[0, 2], stock.bounds[:, 2].mean(), NECK_STEP)
    places = np.column_stack([np.full(len(heights), radius), np.zeros(len(heights)), heights])
    inside = stock.signed_distance(places) <= 0.0
    return float(heights[np.argmax(inside)])


def zero_text(zero_height: float) -> str:
    """The comment of the header that tells where the program's zero is, mm; `reading` reads it."""
    return f"ZERO HEIGHT {zero_height:.6f} OVER TABLE OR CLAMPING"


def _level(zero_height: float, height: float) -> str:
    """A height (mm) as the Z of a program whose zero is so high."""
    return f"Z {round(height - zero_height, 2) + 0.0:.2f}"


TOUCHED = 2.0
"""A side is touched so far below an edge, mm."""


def touch_heights(job: Job, stock: Stock) -> tuple[float, float]:
    """The two heights (mm, part's frame) at which the side of the bar is touched, the upper one first: below its end,
    or the dome there; and below the shoulder, or above the lower end where no stub stands."""
    low, high = stock.bounds[:, 2].tolist()
    bar = bar_of(stock, job.holding)
    if bar is not None:
        return bar.top - TOUCHED, bar.bottom + TOUCHED
    inset = stock.diameter / 2 if stock.kind == "capsule" else min(TOUCHED, (high - low) / 4)
    stub = holding_columns(job.holding).get("stub")
    if stub is None:
        return high - inset, low + inset
    return high - inset, max(stub.top - TOUCHED, (stub.top + stub.bottom) / 2)


def touch_texts(job: Job, stock: Stock, zero_height: float) -> list[str]:
    """What is touched before the start, and the run-out that the part bears: an axis of the bar that is off by what a
    ball may enter the part leaves no deeper step where neck and part meet."""
    level = partial(_level, zero_height)
    stub = holding_columns(job.holding).get("stub")
    bar = bar_of(stock, job.holding)
    shoulder = [] if stub is None or bar else [f"touch: the shoulder round the neck at {level(stub.top)}"]
    off = job.path.gouge_tolerance
    upper, lower = touch_heights(job, stock)
    high = bar.top if bar else float(stock.bounds[1, 2])
    clamped = max((column.top for name, column in holding_columns(job.holding).items() if name != "stub"), default=0.0)
    return [
        f"bar: stands out {high - clamped:.2f} mm, its end over what clamps it",
        f"touch: the end of the bar at {level(high)}",
        *shoulder,
        f"run-out: {2 * off:.3f} mm at most, a dial on the bar at {level(upper)} and {level(lower)}",
        f"run-out: the axis within {off:.3f} mm of X 0 Y 0, the gouge that the job allows",
    ]


def _tailstock_texts(job: Job, zero_height: float) -> list[str]:
    """What holds the free end, and where its bracket stands."""
    bodies = tailstock_columns(job.holding)
    if not bodies:
        return []
    level = partial(_level, zero_height)
    holding = job.holding
    (column,) = bodies["column"]
    under = bodies["arm"][0]
    at = f"at X {holding.tailstock_x:.2f} Y {holding.tailstock_y:.2f}"
    what = {
        "pin": f"a steel pin of {holding.tailstock_diameter:.2f} mm {at} in a hole of the bar, drilled before",
        "neck": f"a neck of {holding.tailstock_diameter:.2f} mm {at}, turned on the bar before and held above",
    }[holding.tailstock]
    foot = f"column of diameter {2 * column.radius:.2f} mm at X {column.x:.2f} Y {column.y:.2f} on the table"
    arm = f"arm at most {holding.tailstock_arm:.2f} mm wide, from {level(under.bottom)} to {level(under.top)}"
    return [f"tailstock: {what}", f"tailstock: {foot}, turning with it", f"tailstock: {arm}"]


def second_setup_texts(
    job: Job, shell: TriangleMesh, top: float, zero: ZeroWords, zero_height: float = 0.0
) -> list[str]:
    """What must be mounted and where the zero is in the second clamping: the part with a stump up to the height `top`
    (mm) in its `shell`, which the job's [holding] holds; the zero is `zero_height` (mm) above that of its frame."""
    level = partial(_level, zero_height)
    rim = "rim of the shell, its highest edge" if zero_height else "table under the shell"
    holding = job.holding
    low, high = shell.bounds[:, 2].tolist()
    chuck = f"nothing of chuck or vice may stand above {level(0.0)}"
    if holding.chuck_height:
        size = f"diameter {holding.chuck_diameter:.2f} mm, up to {level(holding.chuck_height)}"
        chuck = f"a chuck or vice of at most {size}"
    datum = []
    if holding.second_flat != NO_FLAT:
        datum.append(f"datum: the flat of the shell, to which its arrow points, faces {holding.second_flat}")
    if holding.second_pin:
        datum.append(f"datum: a pin of {holding.second_pin:.2f} mm in the shell's base, at X 0 Y 0")
    return [
        "second clamping: the parted part, turned over about X, stands in its shell",
        *datum,
        f"shell: from {level(low)} to {level(high)}, round the finished end of the part",
        f"stump: broken or sawn off, up to {level(top)} at most",
        f"clamping: {chuck}",
        f"program zero: {zero.over} on the axis of the stump, {zero.height} on the {rim}",
        "turned about X alone: +X of the part stays where it was, +Y comes to -Y",
        *part_texts(job),
    ]


def parting_texts(paths: Sequence[ToolPath], zero_height: float = 0.0) -> list[str]:
    """What the last paths do to the post, if they part."""
    groove = cut_groove(paths)
    if groove is None:
        return []
    middle = _level(zero_height, groove.middle)
    where = f"parting: at the end a groove of {2 * groove.radius:.2f} mm round the post at {middle}"
    bridge = f"parting: a bridge of diameter {2 * groove.bridge:.2f} mm holds the part, break or saw it there"
    return [where, bridge]


def tool_texts(job: Job, posted: Sequence[Posted], time: ProgramTime) -> list[str]:
    """Every tool: a line that the reader takes, its shapes, its time; and where its length is measured."""
    texts = []
    own_posted = {one.path.cutter.number: one for one in posted}
    for (number, one), minutes in zip(own_posted.items(), time.tools, strict=True):
        cutter = one.path.cutter
        own = [each for each in posted if each.path.cutter.number == number]
        cuts = [each.path.feed_rates[each.path.kinds == MoveKind.CUT] for each in own]
        fastest = float(np.concatenate(cuts).max(initial=0.0))
        texts += [
            tool_text(cutter, one.control.tool_length),
            *(f"tool {number}: {text}" for text in _shapes(cutter)),
            f"tool {number}: stick-out {cutter.overhang:.2f} mm, S{cutter.spindle:.0f}, F{fastest:.0f} at most, "
            f"about {minutes:.1f} min",
        ]
    figures = feed_figures(posted)
    source = ""
    material = asked_material(job)
    if material is not None:
        source = f"speeds not in the job are of {material.title}: {material.source}; {material.note}"
    return [
        *texts,
        "tool lengths: planned, from the spindle nose to the tip of the ball; enter the measured ones",
        *([source] if source else []),
        f"tool change: {_CHANGES[job.nc.tool_change]}",
        "holders and shanks: none wider, no stick-out shorter than above",
        f"cutting feeds: median {figures.median:.0f}, a tenth below {figures.low:.0f} mm/min: "
        f"an axis limits {100 * figures.limited:.0f} percent",
    ]


def asked_material(job: Job) -> Material | None:
    """The material that speeds are of which the job does not give; None where it gives all."""
    given = all(getattr(job, name).spindle and getattr(job, name).feed for name in job.cutter_names)
    return None if given else read_material(job.material.name)


def _shapes(cutter: Cutter) -> list[str]:
    """The shapes of a cutter from the tip up, mm, two cylinders or cones a line; without the spindle."""
    reported = []
    for section in cutter.profile:
        end = f" to {2 * section.end_radius:.2f}" if section.end_radius != section.radius else ""
        if section.name != "spindle":
            reported.append(f"{section.name} to {section.end:.2f} diameter {2 * section.radius:.2f}{end}")
    return [", ".join(reported[at : at + 2]) for at in range(0, len(reported), 2)]


def tool_text(cutter: Cutter, tool_length: float) -> str:
    """The comment of the header that describes a cutter, mm; `reading.modal_state` reads it."""
    return f"TOOL {cutter.number} BALL RADIUS {cutter.radius:.4f} LENGTH {tool_length:.4f}"


def control_texts(machine: Machine, dialect: Dialect, posted: Sequence[Posted]) -> list[str]:
    """What the control must have and how it must be set: the programmed point, rapids, words of endless axes."""
    centre = posted[0].control.programs_centre
    point = "BALL CENTRE" if centre else "TOOL TIP"
    where = "IN THE PART" if dialect.tool_centre else "IN MACHINE COORDINATES"
    switch = dialect.tool_centre_switch(machine)
    notes = (switch.centre if centre else switch.tip) if switch else []
    rapids = "rapids: the control must drive them straight, all axes arriving together"
    if not dialect.straight_rapids:
        rapids = "rapids: only above the part, elsewhere feeds, as the control may bend them"
    # The bodies of the machine that the paths were kept clear of
    nose = ", ".join(
        f"{piece.length:.0f} mm of diameter {max(piece.diameter, piece.top_diameter):.0f}" for piece in machine.nose
    )
    table = machine.table
    size = "of any size"
    if math.isfinite(table.radius):
        size = f"of diameter {2 * table.radius:.0f}"
    elif math.isfinite(table.half_width):
        size = f"of {2 * table.half_width:.0f} x {2 * table.half_depth:.0f}"
    return [
        *(f"needs: {of_machine(need, machine)}" for need in dialect.needs),
        f"programmed point: {point} {where}",
        *zero_texts(machine, dialect),
        *(VECTOR if dialect.vector else []),
        *(of_machine(note, machine) for note in notes),
        rapids,
        f"kept clear of: a spindle nose of {nose or 'no known size'}; a table {size} mm",
    ]


def of_machine(text: str, machine: Machine) -> str:
    """A line of a dialect with the axes of the machine in the place of its fields."""
    letters = [axis.letter for axis in machine.own_rotary]
    wound = [axis.letter for axis in machine.own_rotary if axis.endless] or letters
    fields = {
        "{count}": {4: "four", 5: "five"}[len(machine.letters)],
        "{rotary}": " and ".join(letters),
        "{zero}": " ".join(f"{letter} 0" for letter in letters),
        "{wound}": " and ".join(wound),
    }
    for field, value in fields.items():
        text = text.replace(field, value)
    return text


def axis_texts(machine: Machine, ranges: Float[ndarray, "5 2"], dialect: Dialect) -> list[str]:
    """The room that the program takes by the `ranges` of its axes, and how endless axes are written."""
    linear = ", ".join(
        f"{axis.letter} {high - low:.1f} of {axis.travel:.1f}"
        for axis, (low, high) in zip(machine.linear, ranges.tolist(), strict=False)
    )
    rotary = ", ".join(
        f"{axis.letter} {low:+.3f} to {high:+.3f}"
        for axis, (low, high) in zip(machine.own_rotary, ranges[3:].tolist(), strict=False)
    )
    # How the words of an endless axis are written, and what the control must do with them
    block = f" under {dialect.endless_block}" if dialect.endless_block else ""
    endless = []
    for letter in (axis.letter for axis in machine.rotary if axis.endless):
        if dialect.endless_words == "wrapped":
            lowest = f"{dialect.endless_from_deg:.0f}..{dialect.endless_from_deg + 360:.0f}"
            form = f" as {dialect.endless_word.format(letter=letter, number='')}" if dialect.has_own_form else ""
            endless += [
                f"{letter} words: wrapped to {lowest}{form}{block}, the control takes the short way",
                f"{letter} must be a modulo axis, its display reduced to 360 degrees",
            ]
        else:
            endless += [
                f"{letter} words: wound up over many turns{block}, the control drives them as they are",
                f"{letter} must not be a modulo axis, its display not reduced to 360 degrees",
            ]
    return [
        f"travel, mm: {linear}, pivots and tool lengths as assumed",
        f"rotary axes, degrees unwound: {rotary}",
        *endless,
    ]


SPARE = "-"
"""A line of the header that is kept free for what is known later."""
UNCHECKED = ("checks passed: none, this text was not read back", SPARE, SPARE)
"""The lines of a program before its proof; `record_checks` replaces them."""
UNSIMULATED = ("removal not simulated", *[SPARE] * 7)
"""The lines of a program whose removal of material is not simulated; `record_simulation` replaces them."""


def record_checks(program: Program, dialect: Dialect, checks: str) -> Program:
    """The program with the `checks` that its text passed in the header; no block moves, no line is added. ValueError
    where its text has them already."""
    return _with_lines(program, dialect, UNCHECKED, [f"checks passed: {checks}"])


def record_simulation(program: Program, dialect: Dialect, cell: float, bending: str = "") -> Program:
    """The program with a header that tells that the removal of its text was simulated on rays `cell` mm apart, and what
    `bending` does, if that is known, a line or more for each of its parts between semicolons; no block moves, no line
    is added. ValueError where its text tells it already."""
    texts = [f"removal simulated in cells of {cell:g} mm", *filter(None, bending.split("; "))]
    return _with_lines(program, dialect, UNSIMULATED, texts)


def _with_lines(program: Program, dialect: Dialect, before: Sequence[str], texts: Sequence[str]) -> Program:
    """The program in whose header other comments stand in the place of successive ones; what they have no room for is
    left out from the end."""
    lines = program.text.split("\n")
    first = comment(before[0], dialect)
    found = [at for at, line in enumerate(lines) if line.endswith(first)]
    if len(found) != 1:
        raise ValueError(f"the program has no line {first!r}: give it as it was written")
    after = [line for text in texts for line in comments_of(text, dialect)]
    after += [comment(SPARE, dialect)] * (len(before) - len(after))
    for at, (old, new) in enumerate(zip(before, after, strict=False), found[0]):
        lines[at] = lines[at].removesuffix(comment(old, dialect)) + new
    return replace(program, text="\n".join(lines))
