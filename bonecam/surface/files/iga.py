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

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import FileError
from bonecam.files import input_bytes, write_whole
from bonecam.surface.tmesh.extracted import ExtractedTMesh
from bonecam.surface.tspline import LARGEST, TSpline
from bonecam.text.faults import shown
from bonecam.text.numbers import number

EXACT = 2.0**53
"""From here on whole numbers are not all told apart."""
LARGEST_DEGREE = 9
LARGEST_COEFFICIENT = 100.0
"""Bernstein coefficients of blending functions lie in 0 .. 1; this leaves room for functions of another scale."""


def read_iga(path: str | Path) -> TSpline[ExtractedTMesh]:
    """The surface of an .iga file. Raises FileError with the line where the file departs from the form
    above."""
    path = Path(path)
    try:
        text = input_bytes(path).decode("utf-8", errors="replace")
    except OSError as error:
        raise FileError(f"{path} cannot be read as text: {error}", file=str(path)) from error
    numbered = [(n, line.split("#", 1)[0].split()) for n, line in enumerate(text.splitlines(), 1)]
    return _Reader(path, [(n, words) for n, words in numbered if words]).surface()


def write_iga(surface: TSpline, path: str | Path) -> None:
    """Write the Bezier elements of any T-spline; `read_iga` gives points, weights and coefficients back bit
    for bit."""
    elements = surface.elements()
    lines = [
        f"type {'surface' if surface.control_points[:, 2].any() else 'plane'}",
        f"nodeN {len(surface.weights)}",
    ]
    lines += [f"elemN {len(elements.boxes)}"] + [
        f"node {_words((*p, w))}" for p, w in zip(surface.control_points, surface.weights)
    ]
    for first, last in zip(elements.starts[:-1], elements.starts[1:]):
        lines += [
            f"belem {last - first} {elements.degree} {elements.degree}",
            " ".join(str(f) for f in elements.functions[first:last]),
        ]
        lines += [_words(row) for row in elements.coefficients[first:last]]
    write_whole(path, "\n".join([*lines, ""]))


def _words(values: Iterable[float]) -> str:
    return " ".join(repr(float(x)) for x in values)


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


class _Reader:
    """Takes the lines one by one; every complaint names the line."""

    def __init__(self, path: Path, lines: list[tuple[int, list[str]]]) -> None:
        self.path = path
        self.lines = lines
        self.next = 0

    def surface(self) -> TSpline[ExtractedTMesh]:
        nodes: list[ndarray] = []
        elements: list[tuple[ndarray, ndarray]] = []
        counts: dict[str, int] = {}
        while self.next < len(self.lines):
            n, words = self._take()
            if words[0] == "node":
                nodes.append(self._numbers(n, words[1:], 4))
                if not nodes[-1][3] > 0:
                    raise self._error(n, f"node {len(nodes) - 1}: weight {nodes[-1][3]} is not positive")
            elif words[0] == "belem":
                elements.append(self._element(n, words[1:]))
            elif words[0] in ("nodeN", "elemN"):
                counts[words[0]] = int(self._numbers(n, words[1:], 1)[0])
            elif words[0] == "type" and words[1:] not in (["plane"], ["surface"]):
                raise self._error(n, f"type {shown(' '.join(words[1:]))}: only plane and surface are read")
            elif words[0] == "domain":
                for _ in range(2 + int(self._numbers(n, words[1:], 2)[0])):
                    self._take()
            elif words[0] not in ("type", "set"):
                raise self._error(n, f"unknown record {shown(words[0])}")
        if not elements or counts.get("nodeN") != len(nodes) or counts.get("elemN") != len(elements):
            raise self._error(
                None, f"{len(nodes)} nodes and {len(elements)} elements, but it announces {counts or 'none'}"
            )
        return _assembled(self, np.array(nodes), elements)

    def _element(self, n: int, words: list[str]) -> tuple[ndarray, ndarray]:
        """Function numbers and coefficients [function, t, s] of one element."""
        count, p, q = (int(x) for x in self._numbers(n, words, 3))
        if count < 1 or not 1 <= min(p, q) <= max(p, q) <= LARGEST_DEGREE:
            raise self._error(n, f"an element of {count} functions of degrees {p} and {q}")
        line, ids = self._take()
        functions = self._numbers(line, ids, count)
        if (
            (functions != np.floor(functions)).any()
            or functions.min() < 0
            or functions.max() >= EXACT
            or len(np.unique(functions)) < count
        ):
            raise self._error(
                line, "function numbers must be whole, not negative and different from one another"
            )
        rows = [self._numbers(*self._take(), (p + 1) * (q + 1)) for _ in range(count)]
        largest = float(np.abs(rows).max())
        if largest > LARGEST_COEFFICIENT:
            raise self._error(
                line, f"a coefficient of {largest:g}: those of blending functions lie in 0 .. 1"
            )
        order = np.argsort(functions)
        return functions[order].astype(np.int64), np.array(rows)[order].reshape(count, q + 1, p + 1)

    def _take(self) -> tuple[int, list[str]]:
        if self.next == len(self.lines):
            raise self._error(None, "the file ends inside an element")
        self.next += 1
        return self.lines[self.next - 1]

    def _numbers(self, n: int, words: list[str], count: int) -> ndarray:
        try:
            values = np.array([number(word) for word in words])
        except ValueError as error:
            raise self._error(n, str(error)) from error
        if len(values) != count or not (np.abs(values) < LARGEST).all():
            raise self._error(n, f"expected {count} finite numbers below {LARGEST:g}, found {len(values)}")
        return values

    def _error(self, line: int | None, message: str) -> FileError:
        return FileError(
            f"{self.path}{f' line {line}' if line else ''}: {message}", file=str(self.path), line=line
        )


def _assembled(
    reader: _Reader, nodes: ndarray, elements: list[tuple[ndarray, ndarray]]
) -> TSpline[ExtractedTMesh]:
    functions = np.concatenate([ids for ids, _ in elements])
    if functions.max() >= len(nodes):
        element = int(np.argmax([ids.max() >= len(nodes) for ids, _ in elements]))
        raise reader._error(
            None, f"element {element} names function {functions.max()}: there are {len(nodes)} nodes"
        )
    degree = max(3, *(max(c.shape[1:]) - 1 for _, c in elements))
    coefficients = np.concatenate([raise_degree(c, degree).reshape(len(ids), -1) for ids, c in elements])
    starts = np.concatenate([[0], np.cumsum([len(ids) for ids, _ in elements])]).astype(np.int64)
    try:
        return TSpline(ExtractedTMesh(len(nodes), starts, functions, coefficients), nodes[:, :3], nodes[:, 3])
    except ValueError as error:
        raise reader._error(None, str(error)) from error
