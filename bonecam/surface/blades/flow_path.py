"""Flow paths of turbomachines: the meridional curve of a hub or a shroud as rows (radius, height)."""

from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import FileError
from bonecam.mesh.files.point_files import read_blocks

MERIDIONAL = "x r"
CARTESIAN = "x y z"
COLUMNS = {MERIDIONAL: "xr", CARTESIAN: "xyz"}


def read_flow_path(
    path: str | Path, *, columns: str = MERIDIONAL, axis: str = "x", scale: float = 1.0
) -> Float[ndarray, "n 2"]:
    """The rows (radius, height) of a hub or shroud in the order of the file, mm, the machine's axis being +Z.

    `columns`: `x r` (along the axis, radius), or `x y z`, of which the first is along the axis. `axis` is `x`, or
    `-x` where that points down; `scale` is mm a unit of the file. FileError names what is wrong with the table.
    """
    file = Path(path)
    if columns not in COLUMNS:
        raise ValueError(f"columns {columns!r}: give one of {', '.join(map(repr, COLUMNS))}")
    if axis not in ("x", "-x"):
        raise ValueError(f"axis {axis!r}: give x, or -x where it points down")
    blocks = read_blocks(file, COLUMNS[columns])
    if len(blocks) > 1:
        raise FileError(f"{file}: holds {len(blocks)} curves: give one flow path a file", file=str(file))
    table = blocks[0]
    if len(table) < 2:
        raise FileError(f"{file}: one point is no curve: give two or more", file=str(file))
    radius = np.hypot(table[:, 1], table[:, 2]) if table.shape[1] == 3 else table[:, 1]
    height = -table[:, 0] if axis == "-x" else table[:, 0]
    rows = scale * np.column_stack([radius, height])
    _check(rows, file)
    return rows


def _check(curve: Float[ndarray, "n 2"], file: Path) -> None:
    """FileError where a radius is not positive, or two points are one."""
    if not (curve[:, 0] > 0).all():
        row = int(np.argmin(curve[:, 0] > 0))
        raise FileError(
            f"{file}: point {row} has the radius {curve[row, 0]:g}: give the axial place and the radius",
            file=str(file),
            row=row,
        )
    steps = np.linalg.norm(np.diff(curve, axis=0), axis=1)
    if not (steps > 0).all():
        row = int(np.argmin(steps > 0))
        raise FileError(f"{file}: points {row} and {row + 1} coincide: remove one", file=str(file), row=row)
