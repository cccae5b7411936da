"""A wheel from files: tables of blade sections and of flow paths, CAD files, T-splines, and meshes.

Tables of blade sections, as rows of points about the Z axis: one file with a block for each section, or one file
for each.

    x y z            Cartesian, the machine's axis being one of the three (NASA Rotor 37)
    x r*theta r      along the machine's axis, arc, radius (NASA HECC):  (r cos theta, r sin theta, x)

Sections run round the blade, from the hub outward. Those that end where they began are closed; others end at a blunt
edge that the rows leave open, and are closed by half circles over it.

Flow paths of turbomachines: the meridional curve of a hub or a shroud as rows (radius, height).
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import unit
from bonecam.errors import SurfaceError, file_error
from bonecam.mesh import MeshLike
from bonecam.mesh.files.points import POINTS, read_blocks
from bonecam.mesh.units import mm_of
from bonecam.surface import TSpline, blade_solid
from bonecam.surface.files.surface_input import machined_surface, read_solid
from bonecam.surface.skinning import PointRows, nearly_closed, rows_of
from bonecam.wheels.wheel import COARSE, hub_profile, limits_beside, meridional, profile_over, stretch, thinned

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
        raise file_error(paths[0], "one section is no blade", "give two or more")
    if columns == POLAR:
        sections = [(path, _cartesian(block, path)) for path, block in sections]
        axis = axis.replace("x", "z")
    blocks = [scale * about_z(block, axis) for _, block in sections]
    rows = rows_of(blocks, paths[0])

    # Wound counter-clockwise seen along the way from the first to the last: S_s x S_t faces outward
    middles = np.array([row.mean(axis=0) for row in rows.rows])
    way = np.gradient(middles, axis=0)
    areas = [np.cross(row - m, np.roll(row, -1, axis=0) - m).sum(axis=0) / 2 for row, m in zip(rows.rows, middles)]
    inward = np.einsum("ri,ri->", np.array(areas), way) < 0
    outward = tuple(row[::-1] if inward else row for row in rows.rows)
    return PointRows(outward, rows.poles, rows.closed)


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
        what = f"point {row} of a section has the radius {r[row]:g}"
        raise file_error(path, what, "give x, r*theta and r", row=row)
    return np.column_stack([r * np.cos(arc / r), r * np.sin(arc / r), x])


INSERTED = 7
"""Points on each half circle."""


def widest_edge(rows: PointRows) -> float:
    """The largest distance between the two ends of an open section, mm; 0 of closed ones."""
    return 0.0 if rows.closed else max(float(np.linalg.norm(row[0] - row[-1])) for row in rows.rows)


def rounded_edge(rows: PointRows) -> PointRows:
    """The rows closed by half circles that stand out of their blunt edges by half of their widths; unchanged where they
    are closed, or where one is open by more than BLUNT of its length."""
    if rows.closed or not all(nearly_closed(row) for row in rows.rows):
        return rows
    return PointRows(tuple(_closed(row) for row in rows.rows), rows.poles, closed=True)


def _closed(row: Float[ndarray, "p 3"]) -> Float[ndarray, "q 3"]:
    """A row that goes on from its end to its start on a half circle, in the plane of that and the way it ends."""
    middle = (row[0] + row[-1]) / 2
    half = (row[-1] - row[0]) / 2
    size = float(np.linalg.norm(half))
    ends = unit(np.array([row[-1] - row[-2], row[0] - row[1]])).sum(axis=0)
    across = half / size
    out = unit((ends - (ends @ across) * across)[None])[0]
    angle = np.pi * np.arange(1, INSERTED + 1)[:, None] / (INSERTED + 1)
    return np.vstack([row, middle + np.cos(angle) * half + np.sin(angle) * size * out])


MERIDIONAL = "x r"
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
        raise file_error(file, f"holds {len(blocks)} curves", "give one flow path a file")
    table = blocks[0]
    if len(table) < 2:
        raise file_error(file, "one point is no curve", "give two or more")
    radius = np.hypot(table[:, 1], table[:, 2]) if table.shape[1] == 3 else table[:, 1]
    height = -table[:, 0] if axis == "-x" else table[:, 0]
    rows = scale * np.column_stack([radius, height])
    # FileError where a radius is not positive, or two points are one
    if not (rows[:, 0] > 0).all():
        row = int(np.argmin(rows[:, 0] > 0))
        what = f"point {row} has the radius {rows[row, 0]:g}"
        raise file_error(file, what, "give the axial place and the radius", row=row)
    steps = np.linalg.norm(np.diff(rows, axis=0), axis=1)
    if not (steps > 0).all():
        row = int(np.argmin(steps > 0))
        raise file_error(file, f"points {row} and {row + 1} coincide", "remove one", row=row)
    return rows


BACK = 4.0
"""A hub that is given by its flow path is solid, with a back of so many mm."""
HUB_CHORD = 0.005
"""Chord tolerance of the hub's profile, mm."""
BladeFile = str | Path | TSpline | Sequence[str | Path]
"""A blade: a file, several files of sections, or the surface itself."""


def read_blade(
    blade: BladeFile, units: str, tolerance: float, *, columns: str = CARTESIAN, axis: str = "z"
) -> tuple[TSpline, float]:
    """The surface of a blade, mm, about the Z axis, and how wide the blunt edge is that was rounded (0: none): tables
    of sections (`columns` and `axis` as in `read_sections`) are skinned within `tolerance` mm, blunt edges rounded;
    other files are those of `machined_surface`."""
    if isinstance(blade, TSpline):
        return blade, 0.0
    files = [blade] if isinstance(blade, str | Path) else list(blade)
    if len(files) == 1 and Path(files[0]).suffix.lower() not in POINTS:
        return machined_surface(files[0], units, tolerance), 0.0
    given = read_sections(files, columns=columns, axis=axis, scale=mm_of(units))
    rows = rounded_edge(given)
    try:
        return rows.skin(tolerance), widest_edge(given) if rows.closed else 0.0
    except (ValueError, SurfaceError) as error:
        raise SurfaceError(f"{files[0]}: {error}", file=str(files[0])) from error


def read_hub(
    hub: str | Path | MeshLike, blade: TSpline, units: str, *, columns: str = MERIDIONAL, axis: str = "z"
) -> Float[ndarray, "n 2"]:
    """The profile of a solid hub, mm: that of a closed mesh of revolution, or of a table of its flow path (`columns` as
    in `read_flow_path`, whose first column runs along the machine's axis, down where `axis` has a -), cut off beside
    the blade."""
    if isinstance(hub, str | Path) and Path(hub).suffix.lower() in POINTS:
        along = "-x" if axis.startswith("-") else "x"
        curve = read_flow_path(hub, columns=columns, axis=along, scale=mm_of(units))
        points = meridional(blade_solid(blade, COARSE).vertices)
        return profile_over(thinned(stretch(curve, *limits_beside(curve, points)), HUB_CHORD), BACK)
    return hub_profile(read_solid(hub, units), str(hub) if isinstance(hub, str | Path) else "the hub")
