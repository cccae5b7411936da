"""Checks of the bytes of a mesh file before MeshLab reads it.

MeshLab drops vertices that are not numbers without a message, and reads a word as the number 0. A face of an
OFF or OBJ file with a vertex that does not exist, an OFF face cut short or a damaged PLY header end the whole
process (measured with pymeshlab 2025.7). All of them are found here first.
"""

import math
import re
from collections.abc import Iterable, Iterator

import numpy as np

Trouble = tuple[str, str]
"""What is wrong with a file, and the remedy."""
_STL_HEADER = 84
"""Bytes before the triangles of a binary STL."""
_STL_FACET = 50
"""Bytes of a triangle in a binary STL."""
_STL_VERTEX = re.compile(rb"^[ \t]*vertex\b([^\n]*)", re.IGNORECASE | re.MULTILINE)
_NOT_A_NUMBER = re.compile(rb"(?<![\w./#-])[+-]?(nan|inf|infinity)(?![\w./-])", re.IGNORECASE)
_OBJ_NAMES = {b"v": "vertex", b"vt": "texture corner", b"vn": "normal"}
_OBJ_WORDS = tuple(b"vp l p g o s mg usemtl mtllib usemap maplib".split())
_CUT_SHORT = "copy or export it again"
_ANEW = "export the mesh again"


def trouble_in(ending: str, data: bytes) -> Trouble | None:
    """What is wrong with the bytes of a mesh file with this lower-case ending, or None."""
    try:
        return {
            ".stl": _trouble_in_stl,
            ".ply": _trouble_in_ply,
            ".off": _trouble_in_off,
            ".obj": _trouble_in_obj,
        }[ending](data)
    except ValueError as error:
        return f"has a word where a number should stand ({error})", _ANEW


def _trouble_in_stl(data: bytes) -> Trouble | None:
    if not (data.lstrip()[:5].lower() == b"solid" and b"facet" in data[:4096].lower()):
        return _trouble_in_binary_stl(data)
    for match in _STL_VERTEX.finditer(data):
        if what := _no_point(match[1].split()):
            return f"line {_line_at(data, match.start())}: {what}", _ANEW
    return None


def _trouble_in_binary_stl(data: bytes) -> Trouble | None:
    count = int(np.frombuffer(data, "<u4", 1, 80)[0]) if len(data) >= _STL_HEADER else 0
    if count == 0 or len(data) < _STL_HEADER + _STL_FACET * count:
        if all(byte in b"\t\n\r" or 32 <= byte < 127 for byte in data[:512]):
            return "is text but no STL", "give an STL, or name the file by its true kind"
        found = max(0, (len(data) - _STL_HEADER) // _STL_FACET)
        return (
            f"is no whole STL: its header tells of {count} triangles, {found} are there",
            f"{_CUT_SHORT}, or name it by its true kind",
        )
    facets = np.frombuffer(
        data, np.dtype([("normal", "<f4", 3), ("corners", "<f4", 9), ("rest", "<u2")]), count, _STL_HEADER
    )
    bad = np.flatnonzero(~np.isfinite(facets["corners"]).all(1))
    if len(bad):
        what = f"has coordinates that are not numbers in {len(bad)} of {count} triangles, first in triangle {bad[0]}"
        return what, "export it again"
    return None


def _trouble_in_ply(data: bytes) -> Trouble | None:
    """Checks every line of a PLY header, and that it names no more elements than the file has bytes."""
    end = data.find(b"end_header")
    if end < 0:
        return "is no PLY, or cut short: its header has no end", _CUT_SHORT
    for number, words in enumerate((line.split() for line in data[:end].splitlines()), 1):
        kind = words[0] if words else b""
        if kind == b"element" and not (len(words) == 3 and words[2].isdigit()):
            return f"line {number}: an element without its name or number", _ANEW
        if kind == b"property" and len(words) != (5 if words[1:2] == [b"list"] else 3):
            return f"line {number}: a property without its type or name", _ANEW
        if kind not in (b"element", b"property", b"ply", b"format", b"comment", b"obj_info", b""):
            return f"line {number}: {kind[:40].decode(errors='replace')!r} is no word of a PLY header", _ANEW
        if kind == b"element" and int(words[2]) > len(data):
            return f"is cut short: line {number} tells of more elements than the file has bytes", _CUT_SHORT
    if b"format ascii" in data[:end] and (match := _NOT_A_NUMBER.search(data, end)):
        return f"line {_line_at(data, match.start())}: {match[0].decode()!r} is not a number", _ANEW
    return None


def _line_at(data: bytes, place: int) -> int:
    """The number of the line, from 1, that the byte at `place` is in."""
    return data.count(b"\n", 0, place) + 1


def _no_point(words: Iterable[bytes], size: int = 3) -> str | None:
    """A phrase for words that are not `size` finite numbers, or None."""
    texts = [word.decode(errors="replace") for word in words][:size]
    for text in texts:
        try:
            if not math.isfinite(float(text)):
                return f"{text!r} is not a number"
        except ValueError:
            return f"{text!r} is not a number"
    return None if len(texts) == size else f"{len(texts)} numbers are no point"


def _numbered_words(data: bytes) -> Iterator[tuple[int, list[bytes]]]:
    """(line number, words) of each line that has words before its comment."""
    for number, line in enumerate(data.splitlines(), 1):
        if words := line.split(b"#")[0].split():
            yield number, words


def _trouble_in_off(data: bytes) -> Trouble | None:
    """Checks an OFF. Its faces follow the vertices: `k i1 .. ik`, counted from 0, then nothing or a colour of
    3 or 4 numbers."""
    lines = _numbered_words(data)
    _, words = next(lines, (0, []))
    if not words or not words[0].endswith(b"OFF"):
        return "does not begin with OFF", "give an OFF, or name the file by its true kind"
    counts = words[1:] or next(lines, (0, []))[1]
    if len(counts) < 2:
        return "is cut short: the counts behind OFF are missing", _CUT_SHORT
    vertices = max(0, int(counts[0]))
    faces = max(0, int(counts[1]))
    body = list(lines)
    for number, words in body[:vertices]:
        if what := _no_point(words):
            return f"line {number}: {what}", _ANEW
    if len(body) < vertices + faces:
        return (
            f"is cut short: {faces} faces are told of, {max(0, len(body) - vertices)} are there",
            _CUT_SHORT,
        )
    for number, words in body[vertices : vertices + faces]:
        count = int(words[0])
        corners = [int(word) for word in words[1 : 1 + count]]
        if not corners or len(words) - 1 - count not in (0, 3, 4):
            return f"line {number}: {len(words) - 1} numbers are no face of {count} corners", _ANEW
        if min(corners) < 0 or max(corners) >= vertices:
            return f"line {number}: a face names a vertex outside 0..{vertices - 1}", _ANEW
        _ = [float(word) for word in words[1 + count :]]
    return None


def _trouble_in_obj(data: bytes) -> Trouble | None:
    """Checks an OBJ. Its faces stand anywhere: `f i1[/t1[/n1]] .. ik[/..]`, counted from 1; negative ones
    count back."""
    found = {b"v": 0, b"vt": 0, b"vn": 0}
    highest = dict.fromkeys(found, (0, 0))
    for number, words in _numbered_words(data):
        kind = words[0]
        if kind in found:
            found[kind] += 1
            if what := _no_point(words[1:], 2 if kind == b"vt" else 3):
                return f"line {number}: {what}", _ANEW
        elif kind == b"f":
            for table, column in zip(found, _columns_of(words[1:])):
                named = [
                    int(word) + (found[table] + 1 if word.startswith(b"-") else 0) for word in column if word
                ]
                if min(named, default=1) < 1:
                    return f"line {number}: a face names a vertex before the first", _ANEW
                if table == b"v" and (len(named) < 3 or len(set(named)) < len(named) > 3):
                    return (
                        f"line {number}: a face of {len(named)} corners, {len(set(named))} of them different",
                        _ANEW,
                    )
                highest[table] = max(highest[table], (max(named, default=0), number))
        elif kind not in _OBJ_WORDS or (len(words) < 2 and kind not in (b"g", b"o", b"s")):
            return (
                f"line {number}: {b' '.join(words)[:40].decode(errors='replace')!r} is nothing of an OBJ",
                _ANEW,
            )
    for table, (index, number) in highest.items():
        if index > found[table]:
            return f"line {number}: a face names {_OBJ_NAMES[table]} {index} of {found[table]}", _ANEW
    return None


def _columns_of(corners: list[bytes]) -> list[list[bytes]]:
    """The first, second and third numbers of the corners of a face of an OBJ."""
    parts = [[*corner.split(b"/"), b"", b""] for corner in corners]
    if any(len(part) > 5 for part in parts):
        raise ValueError(b" ".join(corners)[:40].decode(errors="replace"))
    return [[part[k] for part in parts] for k in range(3)]
