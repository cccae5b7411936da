"""Points from text files: XYZ, CSV, ASC, PTS, TXT, DAT.

One point a line, x y z first (normals, colours and what else follows are left out), separated by blanks,
tabs, commas or semicolons; where semicolons or blanks alone separate, a comma is a decimal comma. Blocks of points are
separated by empty lines or comments (# or //), or headed by a line with their number (and `3`). One line of
column names may stand before them; they must begin with x, y, z (tables of blades have other columns).

One block is a point cloud; several blocks are the rows of a surface (`bonecam.surface.skinning.point_rows`).
"""

import re
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import FileError
from bonecam.files import input_text
from bonecam.mesh.triangle_mesh import LARGEST_COORDINATE
from bonecam.text.numbers import number

POINTS = (".xyz", ".csv", ".asc", ".pts", ".txt", ".dat")
"""Endings of text files of points."""
DECIMAL = re.compile(r"[-+]?\d+(,\d+)?(e[-+]?\d+)?", re.IGNORECASE)
"""A number without a decimal point; a comma in it is a decimal comma."""


def read_blocks(path: str | Path, columns: str = "xyz") -> tuple[Float[ndarray, "_ c"], ...]:
    """The blocks of points of a text file, in the file's unit. FileError names the file, the line and what is
    wrong with it.

    `columns` are the letters that the names of the columns begin with; as many numbers of a line are taken.
    """
    file = Path(path)
    blocks: list[list[list[float]]] = [[]]
    names = False
    for at, line in enumerate(_lines_of(file), 1):
        words = _words(line)
        if not words:
            blocks.append([])
            continue
        try:
            values = [number(word) for word in words]
        except ValueError as error:
            if not names and not any(blocks) and _names_columns(words, columns):
                names = True
                continue
            raise _refusal(
                file,
                at,
                f"{line.strip()[:40]!r} is no point",
                f"write {' '.join(columns)} in columns of that order",
            ) from error
        if not np.isfinite(values[: len(columns)]).all():
            raise _refusal(file, at, f"{line.strip()[:40]!r} is not finite", "export the points again")
        if max(map(abs, values[: len(columns)])) > LARGEST_COORDINATE:
            what = f"a coordinate of {max(values[: len(columns)], key=abs):.3g}"
            raise _refusal(file, at, what, "export the points again")
        if len(values) < len(columns):
            if not _is_head(values):
                asked = f"write {' '.join(columns)}"
                raise _refusal(file, at, f"{len(values)} numbers are no point", asked)
            blocks.append([])
        else:
            blocks[-1].append(values[: len(columns)])
    arrays = tuple(np.array(block) for block in blocks if block)
    if not arrays:
        raise FileError(
            f"{file}: holds no points: write {' '.join(columns)}, one point a line", file=str(file)
        )
    return arrays


def _lines_of(file: Path) -> list[str]:
    """The lines of a text file."""
    try:
        return input_text(file).splitlines()
    except OSError as error:
        raise FileError(
            f"{file}: cannot be read ({error.strerror}): give the path of a readable file", file=str(file)
        ) from error
    except UnicodeDecodeError as error:
        raise FileError(
            f"{file}: is no text: give points as text, or name the file by its true kind", file=str(file)
        ) from error


def _words(line: str) -> list[str]:
    """The words of a line, decimal commas made points; none for a comment."""
    text = line.strip()
    if text.startswith(("#", "//")):
        return []
    if ";" in text or ("," in text and _has_decimal_commas(text.split())):
        return text.replace(",", ".").replace(";", " ").split()
    return text.replace(",", " ").split()


def _has_decimal_commas(words: list[str]) -> bool:
    """Whether words that blanks separate are the numbers of a point already, commas in them their decimal commas."""
    return len(words) > 2 and all(DECIMAL.fullmatch(word) for word in words)


def _names_columns(words: list[str], columns: str) -> bool:
    """Whether column names, units between them left out, begin with these letters."""
    bare = [word.strip("\"'").lower() for word in words]
    names = [name for name in bare if name[:1].isalpha()]
    return [name[0] for name in names[: len(columns)]] == list(columns)


def _is_head(values: list[float]) -> bool:
    """Whether a line is the head of a block: the number of points that follow, alone or before the dimension
    3."""
    return values[0] == int(values[0]) and values[0] > 0 and values[1:] in ([], [3.0])


def _refusal(file: Path, line: int, what: str, remedy: str) -> FileError:
    return FileError(f"{file} line {line}: {what}: {remedy}", file=str(file), line=line)
