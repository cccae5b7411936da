"""What is common to the formats of mesh files: what a file holds, what may be wrong with it, its lines.

Triangles of polygons: a fan from the first corner where it lies inside the polygon, else ear clipping
(Meisters 1975).

OFF as text: `OFF`, the counts, a vertex a line, then a face a line: `k i1 .. ik`, counted from 0, with
nothing or a colour of 3 or 4 numbers behind. What follows x y z of a vertex is left out.

OBJ: `v x y z` and `f i1[/t1[/n1]] .. ik[/..]` anywhere, counted from 1; negative ones count back.

Texture corners and normals are counted and left out, lines (l) and points (p) too, which is noted; files that an
OBJ names (mtllib) are never opened.

STL, binary and ASCII: triangles that share no vertices. Coordinates have single precision in both.

PLY through plyfile: ASCII, binary of either byte order, polygons and triangle strips.

plyfile makes room for as many elements as the header tells of, so the header is held against the size of the
file first.
"""

import io
import re
import warnings
from array import array
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from math import isfinite
from typing import Any

import numpy as np
from jaxtyping import Float, Int64
from numpy import ndarray

from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.text.numbers import shortened

ANEW = "export it again"
CUT_SHORT = "copy or export it again"
LEFT_OUT = "left out of its file: "
"""How the note on elements that are no faces begins."""
TRIANGLES = "save its surface alone, as triangles"


class ContentError(ValueError):
    """What is wrong with the content of a file, and the remedy; `evidence` holds `line` (from 1) where it is
    known."""

    def __init__(self, what: str, remedy: str = ANEW, line: int = 0) -> None:
        super().__init__(f"line {line}: {what}: {remedy}" if line else f"{what}: {remedy}")
        self.evidence = {"line": line} if line else {}


@dataclass(frozen=True, eq=False)
class MeshFile:
    """The mesh of a file, in the `unit` that the file or its format states, its own where that is empty. `notes` name
    what the file holds and the mesh has not."""

    mesh: TriangleMesh
    unit: str = ""
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Content:
    """Vertices in the file's own unit, and polygons: `corners` are the vertices of one after another, each as
    many as `counts` says. `unit` is that of the vertices where the file or its format states one, `notes` name what
    the file holds and the polygons have not.

    Nothing is checked yet: coordinates may be infinite, corners may name vertices that are not there.
    """

    vertices: Float[ndarray, "n 3"]
    corners: Int64[ndarray, " c"]
    counts: Int64[ndarray, " p"]
    unit: str = ""
    notes: tuple[str, ...] = ()


def numbered_words(data: bytes) -> Iterator[tuple[int, list[str]]]:
    """(line number from 1, words) of each line that has words before its comment (#). Lines end in LF, CR or
    both; bytes beyond ASCII become the replacement character."""
    text = io.TextIOWrapper(io.BytesIO(data), encoding="ascii", errors="replace", newline=None)
    for number, line in enumerate(text, 1):
        words = (line.split("#", 1)[0] if "#" in line else line).split()
        if words:
            yield number, words


def point(words: Sequence[str], line: int, size: int = 3) -> list[float]:
    """The first `size` words as finite numbers; ContentError names the line and the word."""
    try:
        coordinates = list(map(float, words[:size]))
    except ValueError:
        coordinates = []
    if len(coordinates) == size and isfinite(sum(coordinates)) and not any("_" in word for word in words[:size]):
        return coordinates
    for word in words[:size]:
        try:
            is_number = isfinite(float(word)) and "_" not in word
        except ValueError:
            is_number = False
        if not is_number:
            raise ContentError(f"{shortened(word, 40)!r} is not a number", line=line)
    if len(words) < size:
        raise ContentError(f"{len(words)} numbers are no point", line=line)
    raise ContentError(f"a coordinate of {max(coordinates, key=abs):.3g}", line=line)


def whole_numbers(words: Sequence[str], line: int) -> list[int]:
    """The words as whole numbers of at most 64 bits; ContentError names the line and the word."""
    numbers = []
    for word in words:
        if len(word) > 18 or not word.removeprefix("-").removeprefix("+").isdigit():
            raise ContentError(f"has a word where a number should stand ({word[:40]!r})", line=line)
        numbers.append(int(word))
    return numbers


def finite_numbers(words: Sequence[str], line: int, count: int | None = None) -> Float[ndarray, " n"]:
    """The words as finite numbers, `count` of them if it is given; ContentError names the line and the word."""
    if count not in (None, len(words)):
        raise ContentError(f"expected {count} numbers, {len(words)} are there", line=line)
    return np.array(point(words, line, len(words)))


def filled(
    points: Sequence[float], corners: Sequence[int], counts: Sequence[int], notes: tuple[str, ...] = ()
) -> Content:
    """The content of coordinates, corners and counts that were collected one by one."""
    vertices = np.array(points).astype(np.float64).reshape(-1, 3)
    corner_numbers = np.array(corners).astype(np.int64)
    return Content(vertices, corner_numbers, np.array(counts).astype(np.int64), notes=notes)


def named_counts(counts: Mapping[str, int]) -> str:
    """`12 lines, 3 points`, without what there is none of."""
    return ", ".join(f"{count} {name}" for name, count in counts.items() if count)


def left_out_note(counts: Mapping[str, int]) -> tuple[str, ...]:
    """What is told of elements, counted by their names, that are no faces."""
    named = named_counts(counts)
    return (f"{LEFT_OUT}{named}",) if named else ()


def refuse_others(counts: Mapping[str, int]) -> None:
    """ContentError where a file holds cells, counted by their names, that may be faces of the part and are not read, or
    are none."""
    named = named_counts(counts)
    if named:
        raise ContentError(f"holds {named}, which are no faces that are read", TRIANGLES)


LARGEST_POLYGON = 2000
"""Most corners of a polygon: ear clipping takes time with their square (measured: 0.1 s for 1000)."""


def triangles_of(content: Content) -> Int64[ndarray, "m 3"]:
    """The triangles of all polygons, in their order. ContentError where a corner names no vertex of the
    content, or a polygon is too large."""
    corners = content.corners
    counts = content.counts
    starts = np.cumsum(counts) - counts
    wrong = np.flatnonzero((corners < 0) | (corners >= len(content.vertices)))
    if len(wrong):
        face = int(np.searchsorted(starts, wrong[0], side="right")) - 1
        raise ContentError(f"face {face} names a vertex outside 0..{len(content.vertices) - 1}")
    if (counts == 3).all():
        return corners.reshape(-1, 3)
    if counts.max() > LARGEST_POLYGON:
        what = f"face {int(counts.argmax())} has {counts.max()} corners, {LARGEST_POLYGON} are allowed"
        raise ContentError(what, "triangulate the mesh and export it again")

    polygon = np.repeat(np.arange(len(counts)), counts - 2)
    step = np.arange(len(polygon)) - np.repeat(np.cumsum(counts - 2) - (counts - 2), counts - 2)
    first = starts[polygon]
    triangles = np.stack([corners[first], corners[first + step + 1], corners[first + step + 2]], axis=1)
    # Which triangles of a fan face away from their polygon, whose area vector is the sum of theirs
    count = len(counts)
    a, b, c = (content.vertices[triangles[:, k]] for k in range(3))
    areas = np.cross(b - a, c - a)
    sums = np.stack([np.bincount(polygon, areas[:, k], count) for k in range(3)], axis=1)
    turned = np.unique(polygon[(np.einsum("mi,mi->m", areas, sums[polygon]) < 0)])
    for item in turned:
        own = corners[starts[item] : starts[item] + counts[item]]
        triangles[polygon == item] = _ears(content.vertices, own)
    return triangles


def strip_triangles(strips: list[ndarray]) -> list[ndarray]:
    """The triangles of strips of vertex numbers; -1 begins a strip anew, every other triangle is turned."""
    triangles = []
    for strip in strips:
        pieces = np.split(strip, np.flatnonzero(strip == -1))
        for piece in pieces:
            run = piece[piece != -1]
            for k in range(len(run) - 2):
                triangles.append(run[k : k + 3] if k % 2 == 0 else run[[k + 1, k, k + 2]])
    return triangles


def _ears(vertices: Float[ndarray, "n 3"], corners: Int64[ndarray, " k"]) -> Int64[ndarray, "m 3"]:
    """The triangles of one polygon, ears cut off one by one in its mean plane; where no ear is left, which
    happens where it crosses itself, the next corner is cut."""
    points = vertices[corners] - vertices[corners[0]]
    normal = np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0)
    axis = int(np.abs(normal).argmax())
    flat = np.delete(points, axis, axis=1)
    if (normal[axis] < 0) != (axis == 1):
        flat = flat * [1.0, -1.0]
    left = list(range(len(corners)))
    triangles = []
    at = 0
    tried = 0
    while len(left) > 3:
        trio = [left[at - 1], left[at], left[(at + 1) % len(left)]]
        a, b, c = flat[trio]
        is_ear = tried >= len(left)
        if not is_ear and _side(a, b, c) > 0:  # it turns left: no other corner that is left may lie in its triangle
            others = flat[[k for k in left if k not in trio]]
            inside = (_side(a, b, others) >= 0) & (_side(b, c, others) >= 0) & (_side(c, a, others) >= 0)
            is_ear = not inside.any()
        if is_ear:
            triangles.append(trio)
            del left[at]
            tried = 0
        else:
            at += 1
            tried += 1
        at %= len(left)
    return corners[np.array([*triangles, left])]


def _side(a: ndarray, b: ndarray, points: ndarray) -> ndarray:
    """Twice the signed area of the triangles a, b, points: positive to the left of the way from a to b."""
    across = (b[0] - a[0]) * (points[..., 1] - a[1]) - (b[1] - a[1]) * (points[..., 0] - a[0])
    return np.asarray(across)


COLOUR = (0, 3, 4)
"""Numbers that may stand behind the corners of a face."""


def parse_off(data: bytes) -> Content:
    """The vertices and polygons of an OFF."""
    lines = numbered_words(data)
    line, words = next(lines, (0, [""]))
    if not words[0].endswith("OFF") or set(words[0]) & {"4", "n"}:
        raise ContentError("does not begin with OFF", "give an OFF, or name the file by its true kind")
    if not words[1:]:
        line, words = next(lines, (0, []))
        words = ["OFF", *words]
    if len(words) < 3:
        raise ContentError("is cut short: the counts behind OFF are missing", CUT_SHORT)
    vertices, faces = whole_numbers(words[1:3], line)
    points = array("d")
    corners = array("q")
    counts = array("q")
    for number, words in islice(lines, max(0, vertices)):
        points.extend(point(words, number))
    for number, words in islice(lines, max(0, faces)):
        count = whole_numbers(words[:1], number)[0]
        polygon = whole_numbers(words[1 : 1 + max(0, count)], number)
        if count < 3 or len(words) - 1 - count not in COLOUR:
            raise ContentError(f"{len(words) - 1} numbers are no face of {count} corners", line=number)
        if min(polygon) < 0 or max(polygon) >= vertices:
            raise ContentError(f"a face names a vertex outside 0..{vertices - 1}", line=number)
        corners.extend(polygon)
        counts.append(len(polygon))
    line, words = next(lines, (0, []))
    if words:
        raise ContentError(f"goes on after the {faces} faces that it tells of", CUT_SHORT, line=line)
    if len(counts) < faces or len(points) < 3 * vertices:
        raise ContentError(f"is cut short: {faces} faces are told of, {len(counts)} are there", CUT_SHORT)
    return filled(points, corners, counts)


NAMES = {"v": "vertex", "vt": "texture corner", "vn": "normal"}
"""What faces name, in the order of the numbers of a corner."""
OTHERS = frozenset("vp l p g o s mg usemtl mtllib usemap maplib lod bevel c_interp d_interp".split())
"""Words that may begin a line besides those of NAMES and f."""
NO_FACES = {"l": "lines", "p": "points"}
"""Elements that are no faces."""
NO_CONTINUATION = re.compile(rb"^((?:[^#\n]*#|[ \t]*mtllib).*)\\(?=\r?\n)", re.MULTILINE)
"""Lines whose \\ at the end is part of a path: the next line is no part of them."""
MAY_STAND_ALONE = frozenset("g o s usemtl".split())


def parse_obj(data: bytes) -> Content:
    """The vertices and polygons of an OBJ, of all its groups and objects."""
    points = array("d")
    corners = array("q")
    counts = array("q")
    totals = dict.fromkeys(NAMES, 0)
    highest = dict.fromkeys(NAMES, (0, 0))
    left_out = dict.fromkeys(NO_FACES, 0)
    data = NO_CONTINUATION.sub(rb"\1", data).replace(b"\\\n", b"  ").replace(b"\\\r\n", b"   ")
    for line, words in numbered_words(data):
        kind = words[0]
        if kind in NAMES:
            totals[kind] += 1
            if kind == "v":
                points.extend(point(words[1:], line))
        elif kind == "f":
            # the vertices, and the texture corners and normals where it names them, counted from 1
            parts = [word.split("/") for word in words[1:]]
            if any(len(part) > len(NAMES) or not part[0] for part in parts):
                message = f"has a word where a number should stand ({' '.join(words[1:])[:40]!r})"
                raise ContentError(message, line=line)
            for k, table in enumerate(NAMES):
                texts = [part[k] for part in parts if len(part) > k and part[k]]
                named = [i if i >= 0 else i + totals[table] + 1 for i in whole_numbers(texts, line)]
                if min(named, default=1) < 1:
                    raise ContentError("a face names a vertex before the first", line=line)
                if k == 0:
                    if len(named) < 3 or len(set(named)) < len(named) > 3:
                        what = f"a face of {len(named)} corners, {len(set(named))} of them different"
                        raise ContentError(what, line=line)
                    corners.extend(index - 1 for index in named)
                    counts.append(len(named))
                highest[table] = max(highest[table], (max(named, default=0), line))
        elif kind not in OTHERS or (len(words) < 2 and kind not in MAY_STAND_ALONE):
            raise ContentError(f"{' '.join(words)[:40]!r} is nothing of an OBJ", line=line)
        elif kind in left_out:
            left_out[kind] += 1
    for table, (index, line) in highest.items():
        if index > totals[table]:
            raise ContentError(f"a face names {NAMES[table]} {index} of {totals[table]}", line=line)
    notes = left_out_note({NO_FACES[kind]: count for kind, count in left_out.items()})
    return filled(points, corners, counts, notes)


HEADER = 84
"""Bytes before the triangles of a binary STL: text of 80, and their number."""
FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", 9), ("rest", "<u2")])
"""A triangle of a binary STL."""
WORDS = {"facet": 5, "outer": 2, "vertex": 4, "endloop": 1, "endfacet": 1}
"""Words that lines of an ASCII STL begin with, and how many they have."""
NAMED = ("solid", "endsolid")
"""Words that names follow."""


def parse_stl(data: bytes) -> Content:
    """The triangles of an STL, each with vertices of its own. A binary one may begin with `solid` too: its
    size tells."""
    count = int(np.frombuffer(data, "<u4", 1, 80)[0]) if len(data) >= HEADER else 0
    named_ascii = data.lstrip()[:5].lower() == b"solid" and b"facet" in data[:4096].lower()
    if named_ascii and len(data) != HEADER + FACET.itemsize * count:
        return _parse_ascii(data)
    if not count or (len(data) - HEADER) // FACET.itemsize != count:
        if all(byte in b"\t\n\r" or 32 <= byte < 127 for byte in data[:512]):
            raise ContentError("is text but no STL", "give an STL, or name the file by its true kind")
        there = max(0, (len(data) - HEADER) // FACET.itemsize)
        what = f"is no whole STL: its header tells of {count} triangles, {there} are there"
        raise ContentError(what, f"{CUT_SHORT}, or name it by its true kind")
    facets = np.frombuffer(data, FACET, count, HEADER)
    bad = np.flatnonzero(~np.isfinite(facets["corners"]).all(1))
    if len(bad):
        raise ContentError(
            f"has coordinates that are not numbers in {len(bad)} of {count} triangles, first in triangle {bad[0]}"
        )
    return _separate_triangles(facets["corners"])


def _parse_ascii(data: bytes) -> Content:
    points = array("f")
    facets = 0
    ended = False
    odd = ""
    for line, words in numbered_words(data):
        word = words[0].lower()
        facets += word == "facet"
        if odd:
            raise ContentError(f"{odd!r} is nothing of an STL", line=line - 1)
        if len(words) != WORDS.get(word, len(words)) or word not in (*WORDS, *NAMED):
            odd = " ".join(words)[:40]  # which the end of a file that is cut short may be
        ended = word == "endsolid"
        if word == "vertex":
            try:
                points.extend(point(words[1:], line))
            except OverflowError as error:
                raise ContentError(f"{' '.join(words[1:4])!r} is too large", line=line) from error
        elif word == "endloop" and len(points) != 9 * facets:
            raise ContentError("a triangle without three corners ends there", line=line)
    if not ended or len(points) != 9 * facets:
        raise ContentError("is cut short: it does not end in endsolid", CUT_SHORT)
    return _separate_triangles(np.array(points))


def _separate_triangles(coordinates: np.ndarray) -> Content:
    vertices = coordinates.astype(np.float64).reshape(-1, 3)
    return Content(vertices, np.arange(len(vertices)), np.full(len(vertices) // 3, 3))


INDICES = ("vertex_indices", "vertex_index")
"""Names of the property that holds the corners of a face or strip."""
READ = ("vertex", "face", "tristrips")
"""Elements that are read."""
END = re.compile(rb"end_header[ \t]*(\r\n|\n|\r)")
PLY_WORDS = (b"ply", b"format", b"comment", b"obj_info", b"element", b"property")
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
    if ply.text:
        goes_on = sum(bool(line.strip()) for line in body.splitlines()) > sum(table.count for table in ply.elements)
    else:
        goes_on = bool(stream.getvalue()[stream.tell() :].strip(b"\0\t\r\n "))
    if goes_on:
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
        if kind not in PLY_WORDS:
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
    names = [name for name in INDICES if name in (element.data.dtype.names or ())]
    if len(names) != 1 or element.data[names[0]].dtype.kind != "O":
        raise ContentError(f"its element {element.name!r} has {len(names) or 'no'} lists {INDICES[0]!r}")
    return list(element.data[names[0]])
