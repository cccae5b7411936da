"""What the tool does on one level, as flat arrays with one row a point."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import IntEnum
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import angles_between, unit
from bonecam.errors import counted
from bonecam.tool.cutter import Cutter
from bonecam.tool.elliptic_cones import EllipticCones

BLANK = -2
"""The level of the paths that mill the stock from the bar, before all others; their `rest` counts from 1."""
PARTING = -1
"""The level of the paths that part the finished part from its post, after level 0; their `rest` counts from 1."""
BESIDE = {PARTING: "parting", BLANK: "blank"}
"""What a program calls the paths that are on no level."""
CALLED = {name.upper(): level for level, name in BESIDE.items()}
"""Their levels by what comments call them."""


class MoveKind(IntEnum):
    """The kind of the move by which the tool arrives at a point."""

    CUT = 0
    LINK = 1
    RAPID = 2


@dataclass(frozen=True, eq=False)
class ContactPath:
    """The cutter contacts of one level, before tool axes are chosen.

    Consecutive points of one pass (`pass_index`) are joined by cutting moves. `parameters` are (s, t) on the
    surface of the level, `normals` point outward, `feeds` are unit feed directions. `centres` of the ball are
    contact + (radius + lift) * normal; `lifts` (mm) are 0 but where the ball would gouge. Those on a `ramp` before a
    pass are raised, and follow once more on the pass itself. `uncut` are the contacts that were left out, `reasons` one
    word for each (post, gouge, covered, short). `trimmed` is the length of passes (mm) that were left out because they
    would hardly have cut. `rest` numbers from 1 the rest paths before the level's own one, 0, and the steps
    of PARTING and BLANK.
    """

    level: int
    cutter: Cutter
    pass_index: Int[ndarray, "n"]
    parameters: Float[ndarray, "n 2"]
    contacts: Float[ndarray, "n 3"]
    normals: Float[ndarray, "n 3"]
    feeds: Float[ndarray, "n 3"]
    centres: Float[ndarray, "n 3"]
    lifts: Float[ndarray, "n"]
    ramp: Bool[ndarray, "n"]
    uncut: Float[ndarray, "u 3"]
    reasons: tuple[str, ...]
    trimmed: float = 0.0
    rest: int = 0

    def take(self, contacts: Int[ndarray, " k"]) -> "ContactPath":
        """The path with these contacts (by index) alone."""
        names = ("pass_index", "parameters", "contacts", "normals", "feeds", "centres", "lifts", "ramp")
        return replace(self, **{name: getattr(self, name)[contacts] for name in names})


@dataclass(frozen=True)
class ConeCheck:
    """How many cones were `asked` of FCL, how many it let pass `narrowed` only, and how many not at all (`refused`)."""

    asked: int
    narrowed: int
    refused: int


@dataclass(frozen=True)
class PoseCheck:
    """How many poses of the tool were `asked` of FCL one by one, and how many of them collide (`refused`)."""

    asked: int
    refused: int


@dataclass(frozen=True, eq=False)
class FreeCones:
    """Elliptic cones of tool axes for which the tool is proven free round their apexes (Xu et al. 2013, section 3).

    Cone k has its apex at the ball centre `apexes[k]` (mm) and the shape `shapes[k]`. Row i of a path has cone
    `cone_of[i]`, -1 for none; there the apex is the row's own ball centre. An axis that lies outside of its cone was
    tested alone. `circular`: their sections across the axes that were wanted are circles. `check` is FCL's word on
    them, where it was asked.
    """

    apexes: Float[ndarray, "k 3"]
    shapes: EllipticCones
    cone_of: Int[ndarray, "n"]
    circular: bool = False
    check: ConeCheck | None = None

    def at(self, rows: Int[ndarray, "m"]) -> "FreeCones":
        """The cones of these rows, -1 for a row that has none."""
        return replace(self, cone_of=np.where(rows >= 0, self.cone_of[rows], -1))

    def hold(self, axes: Float[ndarray, "n 3"]) -> Bool[ndarray, "n"]:
        """Whether the axis of each row lies in the row's cone; of none where it has none."""
        rows, shapes = self._with_cone
        inside = np.zeros(len(axes), dtype=bool)
        inside[rows] = shapes.off(axes[rows]) <= shapes.mean_angles
        return inside

    @cached_property
    def _with_cone(self) -> tuple[Int[ndarray, "m"], EllipticCones]:
        """The rows that have a cone, and its shape."""
        rows = np.flatnonzero(self.cone_of >= 0)
        return rows, self.shapes.take(self.cone_of[rows])


@dataclass(frozen=True, eq=False)
class ToolPath:
    """All moves of one level, or of one rest path before it, in machining order. Row i: the move that arrives at
    tip i with axis i.

    `axes` are unit, from tip to spindle; `tips` = ball centre - radius * axis; `feed_rates` in mm/min (rapid moves: the
    machine's rapid rate); `contacts` and `parameters` are NaN on links and rapids. `pass_index` is -1 on links and
    rapids. `trimmed` and `rest` are those of the `ContactPath`. `blocked_by` counts the contacts that have no tool axis
    by what is against it (`shank against the material`). The first row is a safe point clear of the stock, so is the
    last; or the first is the last one of the path before, near the stock. `cones` are those that the axes were chosen
    in, if they were; `poses` is FCL's word on the contacts whose axes lie in none that it has certified, where it was
    asked. `lifts` are the first and the last rows of ways to the safe point and back, on which rotary axes are rewound.
    """

    level: int
    cutter: Cutter
    kinds: Int[ndarray, "n"]
    pass_index: Int[ndarray, "n"]
    parameters: Float[ndarray, "n 2"]
    contacts: Float[ndarray, "n 3"]
    tips: Float[ndarray, "n 3"]
    axes: Float[ndarray, "n 3"]
    feed_rates: Float[ndarray, "n"]
    uncut: Float[ndarray, "u 3"]
    reasons: tuple[str, ...]
    trimmed: float = 0.0
    rest: int = 0
    blocked_by: Mapping[str, int] = field(default_factory=dict)
    cones: FreeCones | None = None
    poses: PoseCheck | None = None
    lifts: Int[ndarray, "l 2"] = field(default_factory=lambda: np.zeros((0, 2), dtype=np.int64))

    def take(self, rows: Int[ndarray, " k"]) -> "ToolPath":
        """The path with these rows (by index) alone."""
        names = ("kinds", "pass_index", "parameters", "contacts", "tips", "axes", "feed_rates")
        arrays = {name: getattr(self, name)[rows] for name in names}
        return replace(self, cones=self.cones.at(rows) if self.cones else None, **arrays)

    def __repr__(self) -> str:
        return f"<ToolPath of level {self.level}: {counted(len(self.tips), 'point')}>"

    @property
    def balls(self) -> Float[ndarray, "n 3"]:
        """Centres of the ball, mm."""
        return self.cutter.centres_of(self.tips, self.axes)

    @property
    def leads(self) -> Float[ndarray, "n"]:
        """Angle of each axis from the surface's normal at the contact, radians; NaN where nothing is cut."""
        return angles_between(unit(self.balls - self.contacts), self.axes)

    @property
    def title(self) -> str:
        """What a program calls it: level 3, level 3 rest 1, parting 1 or blank 1."""
        if self.level in BESIDE:
            return f"{BESIDE[self.level]} {self.rest}"
        return f"level {self.level} rest {self.rest}" if self.rest else f"level {self.level}"
