"""Tables of blade sections, as rows of points about the Z axis: one file with a block for each section, or one file
for each.

    x y z            Cartesian, the machine's axis being one of the three (NASA Rotor 37)
    x r*theta r      along the machine's axis, arc, radius (NASA HECC):  (r cos theta, r sin theta, x)

Sections run round the blade, from the hub outward. Those that end where they began are closed; others end at a blunt
edge that the rows leave open.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import FileError
from bonecam.mesh.files.point_files import read_blocks
from bonecam.surface.skinning.point_rows import PointRows, rows_of

CARTESIAN = "x y z"
POLAR = "x r*theta r"
AXES = {"x": (1, 2, 0), "y": (2, 0, 1), "z": (0, 1, 2)}
"""The coordinates that become x, y and z where this one is the machine's axis."""


def read_sections(
    files: str | Path | Sequence[str | Path], *, columns: str = CARTESIAN, axis: str = "z", scale: float = 1.0
) -> PointRows:
    """The sections of a blade in one file or several, mm, about the Z axis, wound so that a skin faces outward.

    `columns` as above; `axis` is the one that becomes +Z, with `-` before it where it points down; `scale` is mm a
    unit of the file. FileError names the file and the line or row that is wrong.
    """
    paths = [Path(files)] if isinstance(files, str | Path) else [Path(file) for file in files]
    if columns not in (CARTESIAN, POLAR):
        raise ValueError(f"columns {columns!r}: give {CARTESIAN!r} or {POLAR!r}")
    names = "".join(word[0] for word in columns.split())
    sections = [(path, block) for path in paths for block in read_blocks(path, names)]
    if len(sections) < 2:
        raise FileError(f"{paths[0]}: one section is no blade: give two or more", file=str(paths[0]))
    if columns == POLAR:
        sections = [(path, _cartesian(block, path)) for path, block in sections]
        axis = axis.replace("x", "z")
    blocks = [scale * about_z(block, axis) for _, block in sections]
    rows = rows_of(blocks, paths[0])
    return PointRows(_outward(rows.rows), rows.poles, rows.closed)


def about_z(points: Float[ndarray, "n 3"], axis: str) -> Float[ndarray, "n 3"]:
    """The points turned so that an axis (x, y, z, -x, -y or -z) becomes +Z. ValueError for another one."""
    name = axis.removeprefix("-")
    if name not in AXES:
        raise ValueError(f"axis {axis!r}: give x, y or z, with - before it where it points down")
    turned = points[:, AXES[name]]
    return turned * [1.0, -1.0, -1.0] if axis.startswith("-") else turned


def _cartesian(table: Float[ndarray, "n 3"], path: Path) -> Float[ndarray, "n 3"]:
    """Points of (x, r theta, r) about the Z axis; FileError where a radius is not positive."""
    x, arc, r = table.T
    if not (r > 0).all():
        row = int(np.argmin(r > 0))
        raise FileError(
            f"{path}: point {row} of a section has the radius {r[row]:g}: give x, r*theta and r",
            file=str(path),
            row=row,
        )
    return np.column_stack([r * np.cos(arc / r), r * np.sin(arc / r), x])


def _outward(rows: Sequence[Float[ndarray, "_ 3"]]) -> tuple[Float[ndarray, "_ 3"], ...]:
    """Rows wound counter-clockwise seen along the way from the first to the last: S_s x S_t faces outward."""
    middles = np.array([row.mean(axis=0) for row in rows])
    way = np.gradient(middles, axis=0)
    areas = [np.cross(row - m, np.roll(row, -1, axis=0) - m).sum(axis=0) / 2 for row, m in zip(rows, middles)]
    if np.einsum("ri,ri->", np.array(areas), way) < 0:
        return tuple(row[::-1] for row in rows)
    return tuple(rows)
