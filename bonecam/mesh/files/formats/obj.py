"""OBJ: `v x y z` and `f i1[/t1[/n1]] .. ik[/..]` anywhere, counted from 1; negative ones count back.

Texture corners and normals are counted and left out, lines (l) and points (p) too, which is noted; files that an
OBJ names (mtllib) are never opened.
"""

from array import array

from bonecam.mesh.files.formats.content import (
    Content,
    ContentError,
    filled,
    left_out_note,
    numbered_words,
    point,
    whole_numbers,
)

NAMES = {"v": "vertex", "vt": "texture corner", "vn": "normal"}
"""What faces name, in the order of the numbers of a corner."""
OTHERS = frozenset("vp l p g o s mg usemtl mtllib usemap maplib lod bevel c_interp d_interp".split())
"""Words that may begin a line besides those of NAMES and f."""
LEFT_OUT = {"l": "lines", "p": "points"}
"""Elements that are no faces."""
MAY_STAND_ALONE = frozenset("g o s usemtl".split())


def parse_obj(data: bytes) -> Content:
    """The vertices and polygons of an OBJ, of all its groups and objects."""
    points = array("d")
    corners = array("q")
    counts = array("q")
    totals = dict.fromkeys(NAMES, 0)
    highest = dict.fromkeys(NAMES, (0, 0))
    left_out = dict.fromkeys(LEFT_OUT, 0)
    for line, words in numbered_words(data.replace(b"\\\n", b"  ").replace(b"\\\r\n", b"   ")):
        kind = words[0]
        if kind in NAMES:
            totals[kind] += 1
            if kind == "v":
                points.extend(point(words[1:], line))
        elif kind == "f":
            for table, named in _columns(words[1:], line, totals):
                highest[table] = max(highest[table], (max(named), line))
                if table == "v":
                    corners.extend(index - 1 for index in named)
                    counts.append(len(named))
        elif kind not in OTHERS or (len(words) < 2 and kind not in MAY_STAND_ALONE):
            raise ContentError(f"{' '.join(words)[:40]!r} is nothing of an OBJ", line=line)
        elif kind in left_out:
            left_out[kind] += 1
    for table, (index, line) in highest.items():
        if index > totals[table]:
            raise ContentError(f"a face names {NAMES[table]} {index} of {totals[table]}", line=line)
    notes = left_out_note({LEFT_OUT[kind]: count for kind, count in left_out.items()})
    return filled(points, corners, counts, notes)


def _columns(words: list[str], line: int, totals: dict[str, int]) -> list[tuple[str, list[int]]]:
    """The vertices of a face, and the texture corners and normals where it names them, counted from 1."""
    parts = [word.split("/") for word in words] if "/" in "".join(words) else [[word] for word in words]
    if any(len(part) > len(NAMES) or not part[0] for part in parts):
        raise ContentError(f"has a word where a number should stand ({' '.join(words)[:40]!r})", line=line)
    columns = []
    for k, table in enumerate(NAMES):
        texts = [part[k] for part in parts if len(part) > k and part[k]]
        named = [i if i >= 0 else i + totals[table] + 1 for i in whole_numbers(texts, line)]
        if min(named, default=1) < 1:
            raise ContentError("a face names a vertex before the first", line=line)
        if k == 0 and (len(named) < 3 or len(set(named)) < len(named) > 3):
            what = f"a face of {len(named)} corners, {len(set(named))} of them different"
            raise ContentError(what, line=line)
        if named:
            columns.append((table, named))
    return columns
