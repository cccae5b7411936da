"""What a move of a program is and where it touches: from the row of the paths that it leads to, or from the text."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.nc.dialect import Dialect
from bonecam.nc.reading.motions import Motions
from bonecam.tool.path import MoveKind, ToolPath
from bonecam.verify.readback import Tolerances, compare_moves


@dataclass(frozen=True, eq=False)
class MoveRows:
    """The row of all paths that each move leads to: it `arrives` there, ends on the way to it (a row's move may be
    split), or is `away` from all rows, before a first one."""

    rows: Int[ndarray, " n"]
    arrives: Bool[ndarray, " n"]
    away: Bool[ndarray, " n"]


def rows_of_moves(motions: Motions, paths: Sequence[ToolPath], dialect: Dialect) -> MoveRows:
    """The row of all paths that each move of a program leads to."""
    source = compare_moves(motions, paths, dialect, Tolerances()).source
    return MoveRows(np.where(source >= 0, source, np.maximum(-2 - source, 0)), source >= 0, source == -1)


def of_rows(
    motions: Motions, paths: Sequence[ToolPath], leads: MoveRows
) -> tuple[Int[ndarray, " n"], Float[ndarray, "n 3"]]:
    """The kind of each move and the place where its ball touches the level (its tip where it does not cut), from the
    row of the paths that it leads to; moves that are away from all rows are rapids."""
    rows = leads.rows
    radius = np.repeat([path.cutter.centre_height for path in paths], [len(path.tips) for path in paths])[rows]
    tips, axes, contacts = (
        np.vstack([getattr(path, name) for path in paths])[rows] for name in ("tips", "axes", "contacts")
    )
    kinds = np.concatenate([_kinds(path) for path in paths])[rows]
    kinds = np.where(leads.away, int(MoveKind.RAPID), kinds)
    outward = tips + radius[:, None] * axes - contacts
    touches = motions.tips + radius[:, None] * motions.axes - outward
    at_level = (kinds != MoveKind.RAPID) & np.isfinite(touches).all(1)
    return kinds, np.where(at_level[:, None], touches, motions.tips)


def _kinds(path: ToolPath) -> Int[ndarray, " n"]:
    """The kind of each move of a path; the move to the first contact of a pass is a link to look at."""
    cutting = path.kinds == MoveKind.CUT
    goes_on = np.r_[False, cutting[:-1] & (path.pass_index[1:] == path.pass_index[:-1])]
    return np.where(cutting & ~goes_on, int(MoveKind.LINK), path.kinds).astype(np.int64)


def of_text(motions: Motions) -> tuple[Int[ndarray, " n"], Float[ndarray, "n 3"]]:
    """The kind of each move, links by the comments LINK of the text, and the tips."""
    feeds = np.where(motions.links, int(MoveKind.LINK), int(MoveKind.CUT))
    return np.where(motions.rapid, int(MoveKind.RAPID), feeds), motions.tips
