"""STL, binary and ASCII: triangles that share no vertices. Coordinates have single precision in both."""

from array import array

import numpy as np

from bonecam.mesh.files.formats.content import CUT_SHORT, Content, ContentError, numbered_words, point

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
        raise _no_stl(data, count)
    facets = np.frombuffer(data, FACET, count, HEADER)
    bad = np.flatnonzero(~np.isfinite(facets["corners"]).all(1))
    if len(bad):
        raise ContentError(
            f"has coordinates that are not numbers in {len(bad)} of {count} triangles, first in triangle {bad[0]}"
        )
    return _separate_triangles(facets["corners"])


def _no_stl(data: bytes, count: int) -> ContentError:
    if all(byte in b"\t\n\r" or 32 <= byte < 127 for byte in data[:512]):
        return ContentError("is text but no STL", "give an STL, or name the file by its true kind")
    facets = max(0, (len(data) - HEADER) // FACET.itemsize)
    return ContentError(
        f"is no whole STL: its header tells of {count} triangles, {facets} are there",
        f"{CUT_SHORT}, or name it by its true kind",
    )


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
