"""The cones of free axes that a page shows at contacts."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Int
from numpy import ndarray

from bonecam.tool.elliptic_cones import EllipticCones
from bonecam.tool.path import ToolPath


def cone_contents(
    paths: Sequence[ToolPath], rows: Int[ndarray, " n"], arrives: Bool[ndarray, " n"]
) -> dict[str, ndarray]:
    """Axes, directions of the largest opening and semi-angles (radians) of cones, and for each move that `arrives` at
    one of the `rows` of all paths its cone's number from 1; 0 where it has none, or the move ends between contacts.
    Empty where no axis was chosen in a cone."""
    shapes = [EllipticCones.none(0)]
    cone_of = []
    count = 0
    for path in paths:
        cones = path.cones
        if cones is None:
            cone_of.append(np.zeros(len(path.tips), dtype=np.int64))
            continue
        cone_of.append(np.where(cones.cone_of >= 0, cones.cone_of + count + 1, 0))
        shapes.append(cones.shapes)
        count += len(cones.shapes)
    if not count:
        return {}
    used, number = np.unique(np.where(arrives, np.concatenate(cone_of)[rows], 0), return_inverse=True)
    shift = int(used[0] > 0)  # without a move that has no cone numbers begin at 0 too
    chosen = used[used > 0] - 1
    return {
        "cone_axis": np.vstack([part.axes for part in shapes])[chosen],
        "cone_side": np.vstack([part.sides for part in shapes])[chosen],
        "cone_angle": np.vstack([part.angles for part in shapes])[chosen],
        "move_cone": number + shift,
    }
