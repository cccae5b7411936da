"""Rows of points from a file, skinned as they are: section curves of a bone or a blade (Gan et al. 2014 start
from 17 rows x 100 points).

A text file of blocks (`mesh.point_files`), one row a block. A first and a last block of one point are the
poles; rows between poles are closed. Rows without poles are closed where every row ends on the point it began
with, else open. Closed rows are turned counter-clockwise seen along the direction from row to row, so that
the surface faces outward, and rotated to one seam where they twist.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import FileError
from bonecam.mesh.files.point_files import POINTS, read_blocks
from bonecam.surface.skinning.row_curves import FEWEST_CLOSED, FEWEST_OPEN
from bonecam.surface.skinning.skin import skin
from bonecam.surface.tspline import TSpline

SAME = 1e-9
"""Share of the size: points nearer than this are one."""

TWISTED = 1.2
"""A row is rotated where that brings it nearer to the row before by this factor."""

COMPARED = 64
"""Points of two rows that are compared."""

TRIED = 512
"""Points that a row is tried to begin with at most."""


@dataclass(frozen=True, eq=False)
class PointRows:
    """Rows (p, 3), each with its own number of points, from the lower pole up where there are `poles` (2,
    3)."""

    rows: tuple[Float[ndarray, "_ 3"], ...]
    poles: Float[ndarray, "2 3"] | None
    closed: bool

    def scaled(self, factor: float) -> "PointRows":
        """The rows with all coordinates multiplied by a factor."""
        return PointRows(
            tuple(row * factor for row in self.rows), None if self.poles is None else self.poles * factor, self.closed
        )

    def skin(self, tolerance: float, max_control_points: int | None = None) -> TSpline:
        """The T-spline through the rows: see `surface.skin`."""
        return skin(self.rows, tolerance, closed=self.closed, poles=self.poles, max_control_points=max_control_points)


def holds_rows(path: str | Path) -> bool:
    """Whether a file is a text file of two or more blocks of points."""
    return Path(path).suffix.lower() in POINTS and len(read_blocks(path)) > 1


def read_rows(path: str | Path) -> PointRows:
    """The rows of points in a file, in the file's unit. FileError names the row that is wrong."""
    return rows_of(list(read_blocks(path)), Path(path))


def rows_of(blocks: list[Float[ndarray, "_ 3"]], path: Path) -> PointRows:
    """The rows of the blocks of points that came from a file. FileError names the row that is wrong."""
    poles = _poles(blocks, path)
    rows = blocks if poles is None else blocks[1:-1]
    if len(rows) < 2:
        held = f"holds one block of {len(blocks[0])} points" if poles is None else _between_poles(len(rows))
        raise FileError(f"{path}: {held}: give two rows or more, an empty line between them", file=str(path))
    least = SAME * float(np.linalg.norm(np.ptp(np.vstack(blocks), axis=0)))
    touching = [len(row) > 3 and np.linalg.norm(row[0] - row[-1]) <= least for row in rows]
    closed = poles is not None or all(touching)
    rows = [row[:-1] if closed and touches else row for row, touches in zip(rows, touching)]
    fewest = FEWEST_CLOSED if closed else FEWEST_OPEN
    for number, row in enumerate(rows):
        steps = np.linalg.norm(np.roll(row, -1, axis=0) - row, axis=1)[: None if closed else -1]
        if len(row) < fewest:
            remedy = f"give {fewest} or more"
            raise FileError(f"{path}: row {number} has {len(row)} points: {remedy}", file=str(path), row=number)
        if steps.min() <= least:
            place = int(np.argmin(steps))
            raise FileError(
                f"{path}: row {number}: points {place} and the next coincide: remove one", file=str(path), row=number
            )
    return PointRows(tuple(_oriented(rows, poles) if closed else rows), poles, closed)


def _poles(blocks: list[ndarray], file: Path) -> Float[ndarray, "2 3"] | None:
    """The first and the last block where both are one point."""
    single = [len(block) == 1 for block in (blocks[0], blocks[-1])]
    if any(single) and not all(single):
        raise FileError(
            f"{file}: has one pole only: give the other as the {'last' if single[0] else 'first'} block", file=str(file)
        )
    return np.vstack([blocks[0], blocks[-1]]) if all(single) and len(blocks) > 1 else None


def _between_poles(count: int) -> str:
    rows = "no row" if not count else "one row only"
    return f"has {rows} between its poles, the first and the last block of one point"


def _oriented(rows: list[ndarray], poles: Float[ndarray, "2 3"] | None) -> list[ndarray]:
    """Closed rows turned one way round and begun on one seam."""
    middles = np.array([row.mean(axis=0) for row in rows])
    ends = middles[[0, -1]] if poles is None else poles
    way = np.gradient(np.vstack([ends[:1], middles, ends[1:]]), axis=0)[1:-1]
    areas = np.array(
        [
            np.cross(row - middle, np.roll(row, -1, axis=0) - middle).sum(axis=0) / 2
            for row, middle in zip(rows, middles)
        ]
    )
    if np.einsum("ri,ri->", areas, way) < 0:
        rows = [np.roll(row[::-1], 1, axis=0) for row in rows]
    oriented = rows[:1]
    for row in rows[1:]:
        # The point of a row to begin with, so that it runs beside the row before; 0 where that does not bring it
        # clearly nearer
        before = oriented[-1]
        target = _even(before) - before.mean(axis=0)
        moved = row - row.mean(axis=0)
        starts = np.linspace(0, len(row), min(len(row), TRIED), endpoint=False).astype(np.int64)
        away = np.array([np.linalg.norm(_even(np.roll(moved, -k, axis=0)) - target) for k in starts])
        best = int(np.argmin(away))
        oriented.append(np.roll(row, -(int(starts[best]) if away[0] > TWISTED * away[best] else 0), axis=0))
    return oriented


def _even(row: ndarray) -> ndarray:
    """Points of a closed row at equal arc lengths from its first."""
    chain = np.vstack([row, row[:1]])
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(chain, axis=0), axis=1))])
    wanted = along[-1] * np.arange(COMPARED) / COMPARED
    return np.column_stack([np.interp(wanted, along, chain[:, axis]) for axis in range(3)])
