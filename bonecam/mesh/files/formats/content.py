"""What is common to the formats of mesh files: what a file holds, what may be wrong with it, its lines."""

import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite

import numpy as np
from jaxtyping import Float, Int64
from numpy import ndarray

from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.text.faults import shortened

ANEW = "export it again"
CUT_SHORT = "copy or export it again"
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
        if not _is_number(word):
            raise ContentError(f"{shortened(word, 40)!r} is not a number", line=line)
    if len(words) < size:
        raise ContentError(f"{len(words)} numbers are no point", line=line)
    raise ContentError(f"a coordinate of {max(coordinates, key=abs):.3g}", line=line)


def _is_number(word: str) -> bool:
    try:
        return isfinite(float(word)) and "_" not in word
    except ValueError:
        return False


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
    return (f"left out of its file: {named}",) if named else ()


def refuse_others(counts: Mapping[str, int]) -> None:
    """ContentError where a file holds cells, counted by their names, that may be faces of the part and are not read, or
    are none."""
    named = named_counts(counts)
    if named:
        raise ContentError(f"holds {named}, which are no faces that are read", TRIANGLES)
