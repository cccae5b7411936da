"""PLY through plyfile: ASCII, binary of either byte order, polygons and triangle strips.

plyfile makes room for as many elements as the header tells of, so the header is held against the size of the
file first.
"""

import io
import re
import warnings
from typing import Any

import numpy as np
from numpy import ndarray

from bonecam.mesh.files.formats.content import CUT_SHORT, TRIANGLES, Content, ContentError, left_out_note
from bonecam.mesh.files.formats.polygons import strip_triangles
from bonecam.text.faults import shortened

INDICES = ("vertex_indices", "vertex_index")
"""Names of the property that holds the corners of a face or strip."""
READ = ("vertex", "face", "tristrips")
"""Elements that are read."""
END = re.compile(rb"end_header[ \t]*(\r\n|\n|\r)")
WORDS = (b"ply", b"format", b"comment", b"obj_info", b"element", b"property")
REMARKS = (b"comment", b"obj_info")
LONGEST_REASON = 200
"""Most characters told of plyfile's word on a file, which may quote all of a line."""
LONGEST_HEADER = 2**20
"""Most bytes of a header without its remarks: plyfile takes half a second for so many."""


class _Stream(io.BytesIO):
    """Bytes of which no negative number can be read: plyfile would take the rest of the file for a list of -1
    numbers."""

    def read(self, size: int | None = -1, /) -> bytes:
        if size is not None and size < 0:
            raise ValueError(f"a list of {size} bytes")
        return super().read(size)


def _reason(error: Exception) -> str:
    """What an error says, in one short line."""
    return shortened(" ".join(str(error).split()), LONGEST_REASON)


def parse_ply(data: bytes) -> Content:
    """The vertices, polygons and triangle strips of a PLY. Faces of fewer than three corners and other elements are
    left out, and noted; ContentError where one of these lists vertices, or the file goes on after what its header tells
    of."""
    import plyfile

    header, body = _header_of(data)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # numpy's, of empty lists and of numbers beyond their type
        if b"format ascii" in header:
            body = b"\n".join(line for line in body.splitlines() if line.strip())
        stream = _Stream(header + body)
        try:
            ply = plyfile.PlyData.read(stream)
        except plyfile.PlyParseError as error:
            raise ContentError(f"is no readable PLY file ({_reason(error)})", CUT_SHORT) from error
        except (ValueError, OverflowError, TypeError) as error:
            raise ContentError(f"has a word where a number should stand ({_reason(error)})") from error
    if _goes_on(ply, body, stream):
        raise ContentError("goes on after all that its header tells of: a count in it is too small", CUT_SHORT)
    tables = {element.name: element for element in ply.elements}
    if "vertex" not in tables or not {"x", "y", "z"} <= set(tables["vertex"].data.dtype.names or ()):
        raise ContentError("holds no vertices with x, y and z")
    columns = [tables["vertex"].data[axis] for axis in "xyz"]
    if any(column.dtype.kind == "O" for column in columns):
        raise ContentError("has lists where coordinates should stand")
    with np.errstate(invalid="ignore"):  # of a signalling NaN
        vertices = np.column_stack(columns).astype(np.float64)
    bad = np.flatnonzero(~np.isfinite(vertices).all(axis=1))
    if len(bad):
        what = f"has {len(bad)} of {len(vertices)} vertices with coordinates that are not numbers"
        raise ContentError(f"{what}, first vertex {bad[0]}")
    others = {name: table for name, table in tables.items() if name not in READ and table.count}
    for name, table in others.items():
        if set(INDICES) & set(table.data.dtype.names or ()):
            raise ContentError(f"holds {table.count} of the element {name!r}, which lists vertices", TRIANGLES)
    polygons = [*_lists(tables.get("face")), *strip_triangles(_lists(tables.get("tristrips")))]
    counts = np.array([len(polygon) for polygon in polygons], dtype=np.int64)
    joined = np.concatenate([*polygons, np.empty(0, dtype=np.int64)])
    if not (joined == np.rint(joined)).all():
        raise ContentError("has faces whose corners are no whole numbers")
    corners = joined.clip(-1, len(vertices)).astype(np.int64)
    kept = counts >= 3
    left_out = {f"of {name!r}": table.count for name, table in others.items()}
    left_out["faces of fewer than 3 corners"] = int((~kept).sum())
    return Content(vertices, corners[np.repeat(kept, counts)], counts[kept], notes=left_out_note(left_out))


def _goes_on(ply: Any, body: bytes, stream: io.BytesIO) -> bool:
    """Whether more than blanks follows the elements that plyfile read."""
    if not ply.text:
        return bool(stream.getvalue()[stream.tell() :].strip(b"\0\t\r\n "))
    return sum(bool(line.strip()) for line in body.splitlines()) > sum(table.count for table in ply.elements)


def _header_of(data: bytes) -> tuple[bytes, bytes]:
    """The header with single blanks and line feeds and empty remarks, and what follows it; ContentError names what is
    wrong with a line, or tells that the file is too short for what the header tells of."""
    match = END.search(data)
    if not match:
        raise ContentError("is no PLY, or cut short: its header has no end", CUT_SHORT)
    lines = [b" ".join(line.split()) for line in data[: match.start()].splitlines()]
    lines = [b"comment" if line.split(b" ", 1)[0] in REMARKS else line for line in lines]
    room = len(data) - match.end()  # a value takes one byte or more
    count = 0
    reported = 0
    for number, line in enumerate(lines, 1):
        words = line.split()
        kind = words[0] if words else b""
        if kind == b"element":
            if len(words) != 3 or not words[2].isdigit():
                raise ContentError("an element without its name or number", line=number)
            count = int(words[2][:20])
            reported = number
        if kind == b"property" and len(words) != (5 if words[1:2] == [b"list"] else 3):
            raise ContentError("a property without its type or name", line=number)
        if kind not in WORDS:
            raise ContentError(f"{kind[:40].decode(errors='replace')!r} is no word of a PLY header", line=number)
        room -= count if kind == b"property" else 0
        if min(room, len(data) - count) < 0:
            what = f"is cut short: line {reported} tells of more elements than the file has bytes"
            raise ContentError(what, CUT_SHORT)
    header = b"\n".join([*lines, b"end_header", b""])
    if len(header) > LONGEST_HEADER:
        raise ContentError(f"has a header of {len(header)} bytes, {LONGEST_HEADER} are allowed")
    return header, data[match.end() :]


def _lists(element: Any) -> list[ndarray]:
    """The lists of vertex numbers of an element; none where there is no such element."""
    if element is None or not element.count:
        return []
    name = next((name for name in INDICES if name in (element.data.dtype.names or ())), None)
    if name is None or element.data[name].dtype.kind != "O":
        raise ContentError(f"its element {element.name!r} has no list {INDICES[0]!r}")
    return list(element.data[name])
