"""What the bytes of a mesh file tell before MeshLab reads it.

MeshLab drops vertices that are not numbers without a word, and a face of an OFF or OBJ file that names a vertex that is
not there ends the whole process (measured with pymeshlab 2025.7). So both are looked for here. `trouble_in` answers
(what is wrong, the remedy), or None.
"""

import re
from collections.abc import Iterator

import numpy as np

Trouble = tuple[str, str]
_STL_HEADER, _STL_FACET = 84, 50
_NOT_A_NUMBER = re.compile(rb"(?<![\w./#-])[+-]?(nan|inf|infinity)(?![\w./-])", re.IGNORECASE)
_CUT_SHORT = "copy or export it again"


def trouble_in(ending: str, data: bytes) -> Trouble | None:
    """What is wrong with the bytes of a mesh file with this lower-case ending, or None."""
    if ending == ".stl" and not _is_ascii_stl(data):
        return _trouble_in_binary_stl(data)
    if ending == ".ply" and b"format ascii" not in data[:256]:
        return None
    if match := _NOT_A_NUMBER.search(_without_comments(data)):
        line = data[: match.start()].count(b"\n") + 1
        return f"line {line}: {match[0].decode()!r} is not a number", "export the mesh again"
    try:
        return {".off": _trouble_in_off, ".obj": _trouble_in_obj}.get(ending, lambda _: None)(data)
    except ValueError as error:
        return f"has a word where a number should stand ({error})", "export the mesh again"


def _is_ascii_stl(data: bytes) -> bool:
    return data.lstrip()[:5].lower() == b"solid" and b"facet" in data[:4096].lower()


def _without_comments(data: bytes) -> bytes:
    """The same bytes, equally long, with names and comments blanked: they may contain any word."""
    lines = re.compile(rb"^[ \t]*(solid|endsolid|comment|obj_info|#|o |g |usemtl|mtllib)[^\n]*", re.IGNORECASE | re.MULTILINE)
    return lines.sub(lambda match: b" " * len(match[0]), data)


def _trouble_in_binary_stl(data: bytes) -> Trouble | None:
    count = int(np.frombuffer(data, "<u4", 1, 80)[0]) if len(data) >= _STL_HEADER else 0
    if count == 0 or len(data) < _STL_HEADER + _STL_FACET * count:
        if all(byte in b"\t\n\r" or 32 <= byte < 127 for byte in data[:512]):
            return "is text but no STL", "give an STL, or name the file by its true kind"
        found = max(0, (len(data) - _STL_HEADER) // _STL_FACET)
        return f"is cut short: its header tells of {count} triangles, {found} are there", _CUT_SHORT
    facets = np.frombuffer(data, np.dtype([("normal", "<f4", 3), ("corners", "<f4", 9), ("rest", "<u2")]), count, _STL_HEADER)
    bad = np.flatnonzero(~np.isfinite(facets["corners"]).all(1))
    if len(bad):
        what = f"has coordinates that are not numbers in {len(bad)} of {count} triangles, first in triangle {bad[0]}"
        return what, "export it again"
    return None


def _numbered_words(data: bytes) -> Iterator[tuple[int, list[bytes]]]:
    """(line number, words) of each line that has words before its comment."""
    for number, line in enumerate(data.splitlines(), 1):
        if words := line.split(b"#")[0].split():
            yield number, words


def _trouble_in_off(data: bytes) -> Trouble | None:
    """Faces behind the vertices: `k i1 .. ik`, from 0."""
    lines = _numbered_words(data)
    _, words = next(lines, (0, []))
    if not words or not words[0].endswith(b"OFF"):
        return "does not begin with OFF", "give an OFF, or name the file by its true kind"
    counts = words[1:] or next(lines, (0, []))[1]
    if len(counts) < 2:
        return "is cut short: the counts behind OFF are missing", _CUT_SHORT
    vertices, faces = int(counts[0]), int(counts[1])
    body = list(lines)[vertices:]
    if len(body) < faces:
        return f"is cut short: {faces} faces are told of, {len(body)} are there", _CUT_SHORT
    for number, words in body[:faces]:
        corners = [int(word) for word in words[1 : 1 + int(words[0])]]
        if not corners or min(corners) < 0 or max(corners) >= vertices:
            return f"line {number}: a face names a vertex outside 0..{vertices - 1}", "export the mesh again"
    return None


def _trouble_in_obj(data: bytes) -> Trouble | None:
    """Faces anywhere: `f i1[/..] .. ik[/..]`, from 1; negative ones count back."""
    vertices = 0
    named: list[tuple[int, int]] = []
    for number, words in _numbered_words(data):
        if words[0] == b"v":
            vertices += 1
        elif words[0] == b"f":
            corners = [int(word.split(b"/")[0]) for word in words[1:]]
            low = min((corner + vertices + 1 if corner < 0 else corner for corner in corners), default=0)
            if low < 1:
                return f"line {number}: a face names a vertex before the first", "export the mesh again"
            named.append((max(corners), number))
    highest, number = max(named, default=(0, 0))
    return (f"line {number}: a face names vertex {highest} of {vertices}", "export the mesh again") if highest > vertices else None
