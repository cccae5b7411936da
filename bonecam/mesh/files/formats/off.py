"""OFF as text: `OFF`, the counts, a vertex a line, then a face a line: `k i1 .. ik`, counted from 0, with
nothing or a colour of 3 or 4 numbers behind. What follows x y z of a vertex is left out."""

from array import array
from itertools import islice

from bonecam.mesh.files.formats.content import (
    CUT_SHORT,
    Content,
    ContentError,
    filled,
    numbered_words,
    point,
    whole_numbers,
)

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
        polygon = _corners(words, number, vertices)
        corners.extend(polygon)
        counts.append(len(polygon))
    line, words = next(lines, (0, []))
    if words:
        raise ContentError(f"goes on after the {faces} faces that it tells of", CUT_SHORT, line=line)
    if len(counts) < faces or len(points) < 3 * vertices:
        raise ContentError(f"is cut short: {faces} faces are told of, {len(counts)} are there", CUT_SHORT)
    return filled(points, corners, counts)


def _corners(words: list[str], line: int, vertices: int) -> list[int]:
    count = whole_numbers(words[:1], line)[0]
    corners = whole_numbers(words[1 : 1 + max(0, count)], line)
    if count < 3 or len(words) - 1 - count not in COLOUR:
        raise ContentError(f"{len(words) - 1} numbers are no face of {count} corners", line=line)
    if min(corners) < 0 or max(corners) >= vertices:
        raise ContentError(f"a face names a vertex outside 0..{vertices - 1}", line=line)
    return corners
