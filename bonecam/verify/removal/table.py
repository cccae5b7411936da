"""How far the whole tool stays from table, chuck and what stands on the table, over all moves and between them."""

import numpy as np

from bonecam.kernels.removal.fixed import fixed_clearance
from bonecam.kernels.removal.sweep import Pieces
from bonecam.runtime.threads import in_pieces
from bonecam.setup.fixture.clamping import Clamping
from bonecam.toolpath.cutters.cutter import Cutter
from bonecam.verify.removal.sweeping import sections_of

AT_ONCE = 16384
"""Pieces measured at once."""
DEEPEST = -1e4
"""Columns without end go down to here, mm."""


def table_clearance(
    pieces: Pieces, cutter: Cutter, clamping: Clamping, within: float
) -> tuple[float, int, str, int]:
    """The least distance (mm) of the tool from its clamping, its move and the part of the tool (-1 and none where it
    is more than `within`); and the first move in which they meet, -1 for none."""
    sections, _ = sections_of(cutter)
    names = [*(section.name for section in cutter.profile), "ball"]
    columns = np.array([[one.radius, one.top, max(one.bottom, DEEPEST)] for one in clamping.columns])

    def measure(some: slice) -> tuple[float, int, str, int]:
        part = Pieces(*(column[some] for column in pieces))
        least, where, section, touched = fixed_clearance(
            part, sections, cutter.radius, columns.reshape(-1, 3), clamping.closed, within
        )
        move = int(part.moves[where]) if where >= 0 else -1
        return (
            least,
            move,
            names[section] if where >= 0 else "",
            int(part.moves[touched]) if touched >= 0 else -1,
        )

    found = in_pieces(measure, len(pieces.starts), AT_ONCE)
    least, move, name, _ = min(found, key=lambda one: one[0])
    return least, move, name, min((one[3] for one in found if one[3] >= 0), default=-1)
