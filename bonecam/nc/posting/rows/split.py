"""The moves of a program: a tool path with its rotary angles, split where the control would leave the path.

Between two points of the path the ball centre runs straight and the tool axis turns evenly on the great
circle. The control interpolates its words instead (`machine/control.py`). A move is split evenly until tip and ball
centre stay within the tolerance at 1/4, 1/2 and 3/4 of it (the deviation is of second order in the move, so
its square root tells how often), no joint turns by more than 10 degrees in a feed move or a right angle in a
rapid or at the pole itself, and, without tool-centre control, no feed move is longer than 1 mm.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import angles_between, largest, lengths, unit
from bonecam.errors import MachineError
from bonecam.machine.control import Control
from bonecam.machine.kinematics import tool_axes
from bonecam.nc.posting.rotary.choice import choose_angles
from bonecam.tool.path import MoveKind, ToolPath

MAX_ROUNDS = 40
"""A path that still needs splits after so many rounds passes through the singular axis."""
MAX_MOVE = 1.0
"""The longest feed move without tool-centre control, mm."""
MAX_TURN = np.radians(9.99)
"""The largest rotation of a joint in a feed move, rad: 10 degrees less the rounding of the words."""
MAX_RAPID_TURN = np.pi / 2
"""The largest rotation of a joint in a rapid, and in a feed move through the pole, rad."""
POLE_PASS = np.radians(0.01)
"""A feed move whose tool axis turns by less (rad) while a joint rotates passes the pole itself, where splits
do not lessen the rotation."""
RAPID_FACTOR = 20.0
"""Rapids may leave the path by this many times the tolerance of feed moves."""
AXIS_TOLERANCE = np.radians(1.0)
"""The largest angle between the tool axis of the path and that of the control, rad."""


@dataclass(frozen=True, eq=False)
class ProgramMoves:
    """The points of a program and the moves that arrive at them; `angles` in rad.

    `rows` are the points of the tool path that the moves belong to. Where `rewinds`, the rotary axes jump off
    the part.
    """

    kinds: Int[ndarray, "n"]
    tips: Float[ndarray, "n 3"]
    axes: Float[ndarray, "n 3"]
    angles: Float[ndarray, "n 2"]
    feed_rates: Float[ndarray, "n"]
    rows: Int[ndarray, "n"]
    rewinds: Bool[ndarray, "n"]


def split_moves(
    path: ToolPath, control: Control, tolerance: float, hold_cone: float, before: Float[ndarray, "2"] | None = None
) -> ProgramMoves:
    """The moves of one tool path, fine enough for `control` to follow within `tolerance` (mm; rapids 20 times
    as much).

    `before`: the rotary joints (rad) the machine comes from.
    """
    kinds = np.asarray(path.kinds)
    tips = path.tips
    axes = path.axes
    rows = np.arange(len(path.tips))
    locked = any(axis.locked for axis in control.machine.rotary)
    known = np.full((len(tips), 2), np.nan)
    for _ in range(MAX_ROUNDS):
        choice = choose_angles(control.machine, axes, kinds, hold_cone, before)
        if locked:
            # the axes that the machine has, under the balls of the path
            balls = tips + control.centre_height * axes
            axes = tool_axes(control.machine, choice.angles)
            tips = balls - control.centre_height * axes
        # what was fine enough stays so while its angles do
        new = (choice.angles != known).any(1) | choice.rewinds
        asked = np.flatnonzero(new[1:] | new[:-1])
        pieces = np.ones(len(tips) - 1, dtype=np.int64)
        ends = asked[:, None] + [0, 1]
        pieces[asked] = _pieces(
            control, kinds[asked + 1], tips=tips[ends], axes=axes[ends], angles=choice.angles[ends], tolerance=tolerance
        )
        pieces[choice.rewinds[1:]] = 1
        if (pieces == 1).all():
            return ProgramMoves(
                kinds,
                tips,
                axes=axes,
                angles=choice.angles,
                feed_rates=np.asarray(path.feed_rates)[rows],
                rows=rows,
                rewinds=choice.rewinds,
            )
        # each new row: behind an old one, by a fraction of the move to the next
        move = np.repeat(np.arange(len(pieces)), pieces)
        place = np.arange(len(move)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
        fractions = np.r_[0.0, (place + 1) / pieces[move]]
        after = np.r_[0, move + 1]
        tips, axes = between(tips, axes, control.centre_height, np.r_[0, move], fractions)
        known = np.where((fractions % 1 == 0)[:, None], choice.angles[after], np.nan)
        kinds = kinds[after]
        rows = rows[after]
    row = int(rows[1 + np.argmax(pieces)])
    raise MachineError(
        f"point {row}: the move passes too near the machine's singular axis to be split: "
        "change path.lead_deg or path.direction",
        row=row,
    )


def between(
    tips: Float[ndarray, "n 3"],
    axes: Float[ndarray, "n 3"],
    radius: float,
    before: Int[ndarray, "m"],
    fractions: Float[ndarray, "m"],
) -> tuple[Float[ndarray, "m 3"], Float[ndarray, "m 3"]]:
    """Tips and axes of the path at fractions of the moves from the rows `before` to the next; exact at 0 and
    1."""
    after = np.minimum(before + 1, len(tips) - 1)
    a = axes[before]
    b = axes[after]
    part = fractions[:, None]
    angle = angles_between(a, b)[:, None]
    sine = np.sin(angle)
    small = sine < 1e-9
    weights = np.where(small, 1 - part, np.sin((1 - part) * angle) / np.where(small, 1, sine))
    weights_after = np.where(small, part, np.sin(part * angle) / np.where(small, 1, sine))
    turned = unit(weights * a + weights_after * b)
    centres = (1 - part) * (tips[before] + radius * a) + part * (tips[after] + radius * b)
    whole = fractions == 1
    start = fractions == 0
    turned = np.where(whole[:, None], b, np.where(start[:, None], a, turned))
    meant = np.where(whole[:, None], tips[after], np.where(start[:, None], tips[before], centres - radius * turned))
    return meant, turned


def _pieces(
    control: Control,
    kinds: Int[ndarray, " m"],
    tips: Float[ndarray, "m 2 3"],
    axes: Float[ndarray, "m 2 3"],
    angles: Float[ndarray, "m 2 2"],
    tolerance: float,
) -> Int[ndarray, " m"]:
    """The number of equal pieces that each move is split into; tips, axes and angles are those of its two ends."""
    first, last = (control.words(tips[:, end], angles[:, end]) for end in (0, 1))
    rapid = kinds == MoveKind.RAPID
    allowed = np.where(rapid, RAPID_FACTOR * tolerance, tolerance)
    worst = np.zeros(len(kinds))
    centres = tips + control.centre_height * axes
    middle = _axis_halfway(axes[:, 0], axes[:, 1])
    quarters = ((0.25, _axis_halfway(axes[:, 0], middle)), (0.5, middle), (0.75, _axis_halfway(middle, axes[:, 1])))
    for fraction, turned in quarters:
        tip, axis = control.between(first, last, fraction)
        tilted = axis - turned
        path = (1 - fraction) * centres[:, 0] + fraction * centres[:, 1]
        centre = tip + control.centre_height * axis - path
        off = np.maximum(lengths(centre), lengths(centre - control.centre_height * tilted))
        worst = np.maximum(worst, np.maximum(off / allowed, lengths(tilted) / AXIS_TOLERANCE))
    pieces = np.where(worst > 1, np.ceil(np.sqrt(1.1 * np.minimum(worst, 1e4))), 1)
    at_pole = lengths(axes[:, 1] - axes[:, 0]) < POLE_PASS
    rotation = largest(np.abs(angles[:, 1] - angles[:, 0])) / np.where(rapid | at_pole, MAX_RAPID_TURN, MAX_TURN)
    pieces = np.maximum(pieces, np.ceil(rotation - 1e-9))
    if not control.tool_centre:
        length = lengths(tips[:, 1] - tips[:, 0])
        pieces = np.maximum(pieces, np.where(rapid, 1, np.ceil(length / MAX_MOVE - 1e-9)))
    return np.maximum(pieces, 1).astype(np.int64)


def _axis_halfway(a: Float[ndarray, "n 3"], b: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
    """The unit vector halfway on the great circle; zero between opposite axes."""
    middle = a + b
    return middle / np.maximum(lengths(middle), np.finfo(float).tiny)[:, None]
