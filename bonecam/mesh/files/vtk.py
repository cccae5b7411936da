"""VTK's surfaces: legacy files (.vtk, versions to 4.2 and 5.1, text or binary) and XML files (.vtp, .vtu).

Legacy files are read here: sizes stand before what they tell of. meshio decodes the data of a .vtu; the head of a .vtp
is rewritten as that of an unstructured grid of polygons, and once more for its strips. Cells that are no faces are
counted and refused.
"""

import io
import re
from collections import Counter
from contextlib import redirect_stderr
from importlib import import_module
from typing import Any

import numpy as np
from jaxtyping import Int64
from numpy import ndarray

from bonecam.mesh.files.polygons import CUT_SHORT, Content, ContentError, refuse_others, strip_triangles
from bonecam.runtime.staging import temporary_folder

TYPES = {b"float": ">f4", b"double": ">f8", b"int": ">i4", b"vtktypeint64": ">i8", b"long": ">i8"}
"""Numbers of a binary legacy file, the high byte first, by the words for them."""
SURFACE = "save the surface as PolyData with polygons"
VTK_POLYGON = 7
"""The type of a cell that is a polygon, in VTK's numbers."""
CORNERS = {5: 3, VTK_POLYGON: 0, 9: 4}
"""Corners of the types of cells that are faces, 0 for any number."""
OTHERS = ("vertices", "lines")
"""Sections of a legacy surface that are no faces."""
PARTS = (b"Verts", b"Lines", b"Strips", b"Polys")
"""Elements of a .vtp that list cells."""
FACES = ("triangle", "quad")
"""Cells of a grid that are faces, as meshio names them, beside polygons, whose names have their number of corners."""

Cells = tuple[Int64[ndarray, " _"], Int64[ndarray, " _"]]
"""Corners of cells, one after another, and how many each has."""


def parse_vtk(data: bytes) -> Content:
    """The vertices and faces of a legacy file."""
    if not data.startswith(b"# vtk DataFile"):
        raise ContentError("is no VTK file", "give a VTK file, or name the file by its true kind")
    head = re.match(rb"[^\n]*\n[^\n]*\n\s*(ASCII|BINARY)\s+DATASET\s+(\w+)", data, re.IGNORECASE)
    dataset = head[2].upper() if head else b"nothing"
    if head is None or dataset not in (b"POLYDATA", b"UNSTRUCTURED_GRID"):
        raise ContentError(f"holds no surface but {dataset.decode()}", SURFACE)
    binary = head[1].upper() == b"BINARY"
    numbers, end = _numbers(data, rb"POINTS\s+(\d+)\s+(\w+)", head.end(), binary, 3)
    points = numbers.reshape(-1, 3)
    others = {name: _compiled(rb"(?<!\w)%b\s+(\d+)" % name.encode()).search(data, end) for name in OTHERS}
    refuse_others({name: int(match[1]) for name, match in others.items() if match})
    grid = dataset == b"UNSTRUCTURED_GRID"
    polygons = _section(data, b"CELLS" if grid else b"POLYGONS", end, binary, typed=grid)
    strips = _section(data, b"TRIANGLE_STRIPS", end, binary)
    if polygons is None and strips is None:
        raise ContentError("holds no polygons", SURFACE)
    return _content(points, polygons, strips)


def _compiled(pattern: bytes) -> re.Pattern[bytes]:
    return re.compile(pattern, re.IGNORECASE)  # as VTK reads its words


def _section(data: bytes, word: bytes, start: int, binary: bool, typed: bool = False) -> Cells | None:
    """Corners and counts of the cells behind the `word`, whose types follow if they are `typed`; None where it is not
    there."""
    heads = list(_compiled(rb"(?<!\w)%b\s+(\d+)\s+(\d+)[^\S\n]*\n" % word).finditer(data, start))
    if not heads:
        return None
    if len(heads) > 1:
        raise ContentError(f"has {len(heads)} sections {word.decode()}", SURFACE)
    head = heads[0]
    if data.startswith(b"OFFSETS", head.end()):
        offsets, end = _numbers(data, rb"OFFSETS\s+()(\w+)", head.end(), binary, 1, count=int(head[1]))
        corners, end = _numbers(data, rb"CONNECTIVITY\s+()(\w+)", end, binary, 1, count=int(head[2]))
        cells: Cells = corners.astype(np.int64), np.diff(offsets.astype(np.int64))
    else:
        rows, end = _values(data, head.end(), binary, b"int", int(head[2]))
        if (rows != np.rint(rows)).any():
            raise ContentError("has corners that are no whole numbers")
        # rows `count, corner ...` one after another
        rows = rows.astype(np.int64)
        counts = np.empty(int(head[1]), dtype=np.int64)
        corner = np.ones(len(rows), dtype=bool)
        at = 0
        for polygon in range(len(counts)):
            if at >= len(rows):
                raise ContentError("is cut short: polygons are missing", CUT_SHORT)
            counts[polygon] = rows[at]
            corner[at] = False
            at += 1 + max(int(rows[at]), 0)
        cells = rows[corner], counts
    ends = [end]
    if typed:
        types, end = _numbers(data, rb"CELL_TYPES\s+(\d+)()", end, binary, 1)
        ends.append(end)
        others = Counter(types[~np.isin(types, list(CORNERS))].astype(np.int64).tolist())
        refuse_others({f"cells of type {kind}": count for kind, count in others.items()})
        told = np.array([CORNERS[kind] for kind in types])
        if len(told) != len(cells[1]) or (told * (told != cells[1])).any():
            raise ContentError(f"tells of {len(cells[1])} cells whose {len(told)} types do not fit", CUT_SHORT)
    for end in ends:
        if not re.compile(rb"\s*([A-Za-z]|\Z)").match(data, end):
            raise ContentError(f"goes on after the {int(head[1])} {word.decode()} that it tells of", CUT_SHORT)
    return cells


def _numbers(
    data: bytes, pattern: bytes, start: int, binary: bool, size: int, count: int | None = None
) -> tuple[ndarray, int]:
    """The numbers behind a keyword with its count (unless that is known) and type, `size` each, and where they end."""
    match = _compiled(pattern + rb"[^\S\n]*\n").search(data, start)
    if match is None:
        raise ContentError("is cut short: points or corners are missing", CUT_SHORT)
    return _values(
        data, match.end(), binary, match[2].lower() or b"int", size * (int(match[1]) if count is None else count)
    )


def _values(data: bytes, start: int, binary: bool, kind: bytes, count: int) -> tuple[ndarray, int]:
    if kind not in TYPES:
        raise ContentError(f"has numbers of the type {kind.decode(errors='replace')!r}")
    if binary:
        number = np.dtype(TYPES[kind])
        end = start + number.itemsize * count
        if end > len(data):
            raise ContentError("is cut short", CUT_SHORT)
        return np.frombuffer(data, number, count, start), end
    words = data[start:].split(None, count)
    rest = words.pop() if len(words) > count else b""
    try:
        values = np.array(words).astype(np.float64)
    except ValueError as error:
        raise ContentError(f"has a word where a number should stand ({error})") from error
    if len(values) < count:
        raise ContentError("is cut short", CUT_SHORT)
    return values, len(data) - len(rest)


def _content(points: ndarray, polygons: Cells | None, strips: Cells | None = None) -> Content:
    """Points, polygons and the triangles of strips. ContentError where points are not in space, or cells have too few
    corners."""
    if points.ndim != 2 or points.shape[1] != 3:
        raise ContentError("has points that are not in space")
    nothing = np.empty(0, dtype=np.int64)
    for corners, counts in filter(None, (polygons, strips)):
        if counts.size and (counts.min() < 3 or counts.sum() != len(corners)):
            raise ContentError("has polygons of less than 3 corners, or too few corners")
    corners, counts = polygons or (nothing, nothing)
    if strips:
        triangles = strip_triangles(np.split(strips[0], np.cumsum(strips[1])[:-1]))
        corners = np.concatenate([corners, *triangles])
        counts = np.concatenate([counts, np.full(len(triangles), 3)])
    return Content(points.astype(np.float64), corners, counts)


def parse_vtu(data: bytes) -> Content:
    """The vertices and faces of an XML file of an unstructured grid."""
    points, cells = _read(data, "VTU", sum(_told(data.partition(b"<AppendedData")[0], b"Cells")))
    return _content(points, cells)


def parse_vtp(data: bytes) -> Content:
    """The vertices and faces of an XML file of a surface. ContentError names the extra where meshio is not
    installed."""
    head = data.partition(b"<AppendedData")[0]
    if b'type="PolyData"' not in head or b"NumberOfPolys" not in head:
        raise ContentError("is no VTP", "give a VTP, or name the file by its true kind")
    totals = {name: sum(_told(head, name)) for name in PARTS}
    for name, total in totals.items():
        inside = re.findall(rb"<%b\b[^>]*>(.*?)</%b>" % (name, name), head, re.DOTALL)
        words = re.sub(rb"<[^>]*>", b" ", b"".join(inside)).split()
        if total > len(data) or (words and not total and all(map(bytes.isdigit, words))):
            raise ContentError(f"tells of {total} {name.decode()}, which are not those that are there", CUT_SHORT)
    refuse_others({"vertices": totals[b"Verts"], "lines": totals[b"Lines"]})
    grids = {name: _read(_as_grid(data, name), "VTP", totals[name]) for name in (b"Polys", b"Strips") if totals[name]}
    if not grids:
        raise ContentError("holds no polygons", SURFACE)
    points = next(iter(grids.values()))[0]
    return _content(points, *(grids[name][1] if name in grids else None for name in (b"Polys", b"Strips")))


def _told(head: bytes, part: bytes) -> list[int]:
    """How many cells of a kind the head of an XML file tells of, in each piece."""
    return list(map(int, re.findall(rb"NumberOf%b\s*=\s*[\"'](\d+)[\"']" % part, head)))


def _read(data: bytes, name: str, total: int) -> tuple[ndarray, Cells]:
    """The points, and corners and counts of all cells, that meshio finds in the bytes of a .vtu, called `name`, that
    tells of `total` cells; it raises errors of many kinds on damaged ones. ContentError where it has cells that are no
    faces."""
    try:
        library = import_module("meshio.vtu")._vtu.VtuReader
    except ImportError as error:
        raise ContentError(f"reading {name} needs meshio", "pip install 'bonecam[formats]'") from error
    named = 0

    def read_data(reader: Any, element: Any) -> Any:
        nonlocal named
        values = library.read_data(reader, element)
        named += len(values) if element.get("Name") == "connectivity" else 0
        return values.astype(np.int64) if element.get("Name") in ("connectivity", "offsets") else values

    with temporary_folder() as folder, redirect_stderr(io.StringIO()):
        file = folder / "surface.vtu"
        file.write_bytes(data)
        try:
            grid = type("Reader", (library,), {"read_data": read_data})(str(file))
        except (Exception, SystemExit) as error:
            reason = " ".join(f"{type(error).__name__} {error}".split())[:200]
            remedy = "save it anew, its data in text or binary and not appended raw"
            raise ContentError(f"cannot be read as {name} ({reason})", remedy) from error
    others = [block for block in grid.cells if block.type not in FACES and not block.type.startswith("polygon")]
    refuse_others({f"{block.type} cells": len(block.data) for block in others})
    blocks = [block.data for block in grid.cells]
    counts = np.concatenate([np.full(len(block), block.shape[1]) for block in blocks] or [np.empty(0)])
    corners = np.concatenate([block.ravel() for block in blocks] or [np.empty(0)])
    if (len(counts), len(corners)) != (total, named):
        what = f"tells of {total} cells and {named} corners, {len(counts)} and {len(corners)} are there"
        raise ContentError(what, CUT_SHORT)
    return grid.points, (corners.astype(np.int64), counts.astype(np.int64))


def _as_grid(data: bytes, part: bytes) -> bytes:
    """The bytes of a .vtp as those of a .vtu whose cells are its polygons, or its strips as if these were polygons."""
    head, mark, appended = data.partition(b"<AppendedData")
    numbers = _told(head, part)
    for name in {*PARTS, b"PointData", b"CellData", b"FieldData"} - {part}:
        head = re.sub(rb"<%b\b[^>]*/>|<%b\b.*?</%b>" % (name, name, name), b"", head, flags=re.DOTALL)
    head = head.replace(b"PolyData", b"UnstructuredGrid").replace(b"NumberOf" + part, b"NumberOfCells")
    head = head.replace(b"<" + part, b"<Cells")
    for number in numbers:
        types = " ".join([str(VTK_POLYGON)] * number).encode()
        array = b'<DataArray type="UInt8" Name="types" format="ascii">%b</DataArray></Cells>' % types
        head = head.replace(b"</%b>" % part, array, 1)
    return head + mark + appended
