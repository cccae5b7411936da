"""VTK's surfaces: legacy files (.vtk, DATASET POLYDATA, versions to 4.2 and 5.1, text or binary) and XML files (.vtp).

meshio reads VTK's unstructured grids only. Of a legacy file points and polygons are read here: their sizes stand before
them. The head of a .vtp is rewritten as that of an unstructured grid of polygons, whose data meshio decodes.
"""

import re
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.mesh.files.formats.content import CUT_SHORT, Content, ContentError
from bonecam.runtime.temporary import temporary_folder

TYPES = {b"float": ">f4", b"double": ">f8", b"int": ">i4", b"vtktypeint64": ">i8", b"long": ">i8"}
"""Numbers of a binary legacy file, the high byte first, by the words for them."""
SURFACE = "save the surface as PolyData with polygons"
VTK_POLYGON = "7"
"""The type of a cell that is a polygon, in VTK's numbers."""


def parse_vtk(data: bytes) -> Content:
    """The vertices and polygons of a legacy file."""
    if not data.startswith(b"# vtk DataFile"):
        raise ContentError("is no VTK file", "give a VTK file, or name the file by its true kind")
    head = re.match(rb"[^\n]*\n[^\n]*\n\s*(ASCII|BINARY)\s+DATASET\s+(\w+)", data)
    if head is None or head[2] != b"POLYDATA":
        raise ContentError(f"holds no surface but {head[2].decode() if head else 'nothing'}", SURFACE)
    binary = head[1] == b"BINARY"
    points, end = _numbers(data, rb"POINTS\s+(\d+)\s+(\w+)", head.end(), binary, 3)
    polygons = re.compile(rb"\sPOLYGONS\s+(\d+)\s+(\d+)[^\S\n]*\n").search(data, end)
    if polygons is None:
        raise ContentError("holds no polygons", SURFACE)
    if data.startswith(b"OFFSETS", polygons.end()):
        offsets, end = _numbers(
            data, rb"OFFSETS\s+()(\w+)", polygons.end(), binary, 1, count=int(polygons[1])
        )
        corners, _ = _numbers(data, rb"CONNECTIVITY\s+()(\w+)", end, binary, 1, count=int(polygons[2]))
        return _content(points, corners.astype(np.int64), np.diff(offsets.astype(np.int64)))
    rows, _ = _values(data, polygons.end(), binary, b"int", int(polygons[2]))
    return _content(points, *_unrolled(rows.astype(np.int64), int(polygons[1])))


def _numbers(
    data: bytes, pattern: bytes, start: int, binary: bool, size: int, count: int | None = None
) -> tuple[ndarray, int]:
    """The numbers behind a keyword with its count (unless that is known) and type, `size` each, and where they end."""
    match = re.compile(pattern + rb"[^\S\n]*\n").search(data, start)
    if match is None:
        raise ContentError("is cut short: points or corners are missing", CUT_SHORT)
    return _values(data, match.end(), binary, match[2], size * (int(match[1]) if count is None else count))


def _values(data: bytes, start: int, binary: bool, kind: bytes, count: int) -> tuple[ndarray, int]:
    if kind not in TYPES:
        raise ContentError(f"has numbers of the type {kind.decode(errors='replace')!r}")
    if binary:
        number = np.dtype(TYPES[kind])
        end = start + number.itemsize * count
        if end > len(data):
            raise ContentError("is cut short", CUT_SHORT)
        return np.frombuffer(data, number, count, start), end
    words = data[start:].split(None, count)[:count]
    try:
        values = np.array(words).astype(np.float64)
    except ValueError as error:
        raise ContentError(f"has a word where a number should stand ({error})") from error
    if len(values) < count:
        raise ContentError("is cut short", CUT_SHORT)
    return values, start


def _unrolled(rows: ndarray, number: int) -> tuple[ndarray, ndarray]:
    """Corners and counts of rows `count, corner ...` one after another."""
    counts = np.empty(number, dtype=np.int64)
    corner = np.ones(len(rows), dtype=bool)
    at = 0
    for polygon in range(number):
        if at >= len(rows):
            raise ContentError("is cut short: polygons are missing", CUT_SHORT)
        counts[polygon] = rows[at]
        corner[at] = False
        at += 1 + max(int(rows[at]), 0)
    return rows[corner], counts


def _content(points: ndarray, corners: ndarray, counts: ndarray) -> Content:
    if counts.size and (counts.min() < 3 or counts.sum() != len(corners)):
        raise ContentError("has polygons of less than 3 corners, or too few corners")
    return Content(points.astype(np.float64).reshape(-1, 3), corners, counts)


def parse_vtp(data: bytes) -> Content:
    """The vertices and polygons of an XML file. ContentError names the extra where meshio is not installed."""
    try:
        from meshio.vtu import read
    except ImportError as error:
        raise ContentError("reading VTP needs meshio", "pip install 'bonecam[formats]'") from error
    with temporary_folder() as folder:
        file = folder / "surface.vtu"
        file.write_bytes(_as_grid(data))
        grid = _read(read, file)
    cells = [block.data for block in grid.cells if block.data.shape[1] >= 3]
    corners = np.concatenate([block.ravel() for block in cells] or [np.empty(0)]).astype(np.int64)
    counts = np.concatenate([np.full(len(block), block.shape[1]) for block in cells] or [np.empty(0)])
    return _content(_in_space(grid.points), corners, counts.astype(np.int64))


def _in_space(points: Float[ndarray, "n d"]) -> ndarray:
    if points.ndim != 2 or points.shape[1] != 3:
        raise ContentError("has points that are not in space")
    return points


def _read(read: Any, file: Path) -> Any:
    """What meshio makes of a file; it raises errors of many kinds on damaged ones."""
    try:
        return read(str(file))
    except (Exception, SystemExit) as error:
        reason = " ".join(f"{type(error).__name__} {error}".split())[:200]
        remedy = "save it anew, its data in text or binary and not appended raw"
        raise ContentError(f"cannot be read as VTP ({reason})", remedy) from error


def _as_grid(data: bytes) -> bytes:
    """The bytes of a .vtp as those of a .vtu of polygons."""
    head, mark, appended = data.partition(b"<AppendedData")
    polygons = re.findall(rb'NumberOfPolys="(\d+)"', head)
    if b'type="PolyData"' not in head or not polygons:
        raise ContentError("is no VTP", "give a VTP, or name the file by its true kind")
    for name in (b"Verts", b"Lines", b"Strips", b"PointData", b"CellData", b"FieldData"):
        head = re.sub(rb"<%b\b[^>]*/>|<%b\b.*?</%b>" % (name, name, name), b"", head, flags=re.DOTALL)
    head = head.replace(b"PolyData", b"UnstructuredGrid").replace(b"NumberOfPolys", b"NumberOfCells")
    head = head.replace(b"<Polys", b"<Cells")
    for number in polygons:
        types = " ".join([VTK_POLYGON] * int(number)).encode()
        array = b'<DataArray type="UInt8" Name="types" format="ascii">%b</DataArray></Cells>' % types
        head = head.replace(b"</Polys>", array, 1)
    return head + mark + appended
