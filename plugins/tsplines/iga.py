"""Bezier extraction files (.iga): control points, and per element the functions on it with their Bernstein
coefficients.

    type plane | surface
    nodeN N, elemN E
    node X Y Z W                    control points, not homogeneous, numbered from 0
    belem N P Q                     an element of degrees P, Q; a line of N function numbers; N lines of
    (P+1)(Q+1) coefficients, s fastest set ..., domain E B ...         named sides and points, parts for
    solvers (2 + E lines each): skipped

Elements of lower degree are raised to the highest of the file (at least 3), which is exact. Format: Scott,
T-splines plug-in for Rhino.
"""

from collections import deque
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import numpy as np
from bonecam_plugins.tsplines.extracted import ExtractedTMesh
from jaxtyping import Float, Int64
from numpy import ndarray

from bonecam.errors import FileError, SurfaceError
from bonecam.files import write_whole
from bonecam.mesh import CUT_SHORT, ContentError, TriangleMesh, bytes_of, finite_numbers, numbered_words, whole_numbers
from bonecam.plugins import Reader
from bonecam.surface import TSpline, tessellate
from bonecam.text.numbers import number_words, shown

LARGEST_DEGREE = 9
LARGEST_COEFFICIENT = 100.0
"""Bernstein coefficients of blending functions lie in 0 .. 1; this leaves room for functions of another scale."""


def read_iga(path: str | Path) -> TSpline[ExtractedTMesh]:
    """The surface of an .iga file. Raises FileError with the line where the file departs from the form
    above."""
    try:
        # The surface in the bytes of an .iga file
        data = bytes_of(Path(path))
        nodes: list[ndarray] = []
        elements: list[tuple[ndarray, ndarray]] = []
        counts: dict[str, float] = {}
        lines = numbered_words(data)
        for line, (word, *values) in lines:
            if word == "node":
                nodes.append(finite_numbers(values, line, 4))
                if not nodes[-1][3] > 0:
                    raise ContentError(f"node {len(nodes) - 1}: weight {nodes[-1][3]} is not positive", line=line)
            elif word == "belem":
                elements.append(_element(finite_numbers(values, line, 3), line, lines))
            elif word in ("nodeN", "elemN"):
                counts[word] = finite_numbers(values, line, 1)[0]
            elif word == "type" and values not in (["plane"], ["surface"]):
                what = f"type {shown(' '.join(values))}: only plane and surface are read"
                raise ContentError(what, line=line)
            elif word == "domain":
                count = 2 + finite_numbers(values, line, 2)[0]
                deque(islice(lines, int(np.clip(count, 0, len(data)))), maxlen=0)
            elif word not in ("type", "set"):
                raise ContentError(f"unknown record {shown(word)}", line=line)
        if not elements or counts != {"nodeN": len(nodes), "elemN": len(elements)}:
            what = f"{len(nodes)} nodes and {len(elements)} elements, but it announces {counts or 'none'}"
            raise ContentError(what)
        points = np.array(nodes)
        functions = np.concatenate([ids for ids, _ in elements])
        if functions.max() >= len(points):
            element = int(np.argmax([ids.max() >= len(points) for ids, _ in elements]))
            what = f"element {element} names function {functions.max()}: there are {len(points)} nodes"
            raise ContentError(what)
        degree = max(3, *(max(c.shape[1:]) - 1 for _, c in elements))
        coefficients = np.concatenate([raise_degree(c, degree).reshape(len(ids), -1) for ids, c in elements])
        starts = np.concatenate([[0], np.cumsum([len(ids) for ids, _ in elements])]).astype(np.int64)
        try:
            return TSpline(ExtractedTMesh(len(points), starts, functions, coefficients), points[:, :3], points[:, 3])
        except ValueError as error:
            raise ContentError(str(error)) from error
    except ContentError as error:
        raise FileError(f"{path}: {error}", file=str(path), **error.evidence) from error


def write_iga(surface: TSpline, path: str | Path) -> None:
    """Write the Bezier elements of any T-spline; `read_iga` gives points, weights and coefficients back bit
    for bit."""
    elements = surface.elements()
    lines = [f"type {'surface' if surface.control_points[:, 2].any() else 'plane'}", f"nodeN {len(surface.weights)}"]
    lines += [f"elemN {len(elements.boxes)}"] + [
        f"node {number_words((*p, w))}" for p, w in zip(surface.control_points, surface.weights)
    ]
    for first, last in zip(elements.starts[:-1], elements.starts[1:]):
        lines += [
            f"belem {last - first} {elements.degree} {elements.degree}",
            " ".join(str(f) for f in elements.functions[first:last]),
        ]
        lines += [number_words(row) for row in elements.coefficients[first:last]]
    write_whole(path, "\n".join([*lines, ""]))


def raise_degree(coefficients: Float[ndarray, "k p q"], degree: int) -> Float[ndarray, "k r r"]:
    """Bernstein coefficients [function, t, s] of unchanged polynomials at a higher degree in s and t."""
    for axis in (1, 2):
        for count in range(coefficients.shape[axis], degree + 1):
            share = np.arange(count + 1).reshape([-1 if a == axis else 1 for a in range(3)]) / count
            end = np.zeros_like(coefficients.take([0], axis=axis))
            before = np.concatenate([end, coefficients], axis=axis)
            after = np.concatenate([coefficients, end], axis=axis)
            coefficients = share * before + (1 - share) * after
    return coefficients


def _element(
    head: ndarray, line: int, lines: Iterator[tuple[int, list[str]]]
) -> tuple[Int64[ndarray, " k"], Float[ndarray, "k q p"]]:
    """Function numbers and coefficients [function, t, s] of the element that has this head in this line."""
    count, p, q = map(int, head)
    if count < 1 or not 1 <= min(p, q) <= max(p, q) <= LARGEST_DEGREE:
        raise ContentError(f"an element of {count} functions of degrees {p} and {q}", line=line)
    line, ids = next(lines, (line, []))
    functions = np.array(whole_numbers(ids, line))
    if len(functions) != count or functions.min() < 0 or len(np.unique(functions)) < count:
        what = f"expected {count} function numbers, not negative and different from one another"
        raise ContentError(what, line=line)
    rows = [finite_numbers(row, n, (p + 1) * (q + 1)) for n, row in islice(lines, count)]
    if len(rows) < count:
        raise ContentError("ends inside an element", CUT_SHORT, line)
    largest = float(np.abs(rows).max())
    if largest > LARGEST_COEFFICIENT:
        raise ContentError(f"a coefficient of {largest:g}: those of blending functions lie in 0 .. 1", line=line)
    order = np.argsort(functions)
    return functions[order], np.array(rows)[order].reshape(count, q + 1, p + 1)


CHORD = 5e-4
"""Chord tolerance of the mesh that stands for a part's surface, share of its size: that of CAD files."""
MOST_VERTICES = 3000
"""So many vertices a control point may that mesh have: 800 are enough for pebbles, damaged files took minutes."""


def _mesh_of(path: Path) -> TriangleMesh:
    """The triangles of an .iga file: its elements share no parameters that passes could follow."""
    surface = read_iga(path)
    chord = CHORD * float(np.linalg.norm(np.ptp(surface.control_points, axis=0)))
    try:
        return tessellate(surface, chord, most_vertices=MOST_VERTICES * surface.tmesh.size).mesh
    except (SurfaceError, ValueError) as error:
        evidence = getattr(error, "evidence", {})
        raise SurfaceError(f"{path}: {error}", **{**evidence, "file": str(path)}) from error


READER = Reader("mesh", _mesh_of, write_iga)
"""What bonecam reads and writes .iga files with."""
