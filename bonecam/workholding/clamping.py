"""What holds the post, as obstacles: the table, what stands on it, and the chuck; a clearance is kept from them."""

import math
from dataclasses import dataclass

from bonecam.job import HoldingJob
from bonecam.machine.bodies import Table
from bonecam.workholding.column import Column

DEFAULT = HoldingJob()


@dataclass(frozen=True)
class Clamping:
    """Upright columns about the Z axis, and whether nothing may go below the table's plane z = 0 (`closed`).

    The whole tool keeps the `clearance` (mm) from these; holder and spindle keep it from the post too.
    """

    columns: tuple[Column, ...] = ()
    closed: bool = True
    clearance: float = DEFAULT.clearance

    @property
    def kept_columns(self) -> tuple[Column, ...]:
        """The columns, with the clearance round them."""
        return tuple(column.grown(self.clearance) for column in self.columns)


def clamping_of(holding: HoldingJob, table: Table) -> Clamping:
    """The clamping of a job on a machine's table.

    Cones that stand on the table are taken as the cylinders that hold them; an open table as the disc that holds
    it, endless downwards.
    """
    columns = []
    if holding.chuck_height:
        columns.append(Column(holding.chuck_diameter / 2, holding.chuck_height))
    height = 0.0
    for piece in table.standing:
        columns.append(Column(max(piece.diameter, piece.top_diameter) / 2, height + piece.length, height))
        height += piece.length
    if table.open_beside:
        plate = math.hypot(table.half_width, table.half_depth)
        columns.append(Column(min(table.radius, plate), 0.0, -math.inf))
    return Clamping(tuple(columns), not table.open_beside, holding.clearance)
