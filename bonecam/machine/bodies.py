"""The bodies of a machine that a tool path keeps clear of: its table, what stands there, and the spindle nose; and
meshes of its links, which a program is held against."""

import math
from dataclasses import dataclass, field
from pathlib import Path

from bonecam.machine.frustum import Frustum


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
