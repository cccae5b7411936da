"""A closed surface round a point cloud: normals from neighbours, then screened Poisson reconstruction
(Kazhdan, Hoppe 2013).

The cloud must cover the part all round, densely: what comes out is measured against the points, and refused
where it misses them.

Points from text files: XYZ, CSV, ASC, PTS, TXT, DAT.

One point a line, x y z first (normals, colours and what else follows are left out), separated by blanks,
tabs, commas or semicolons; where semicolons or blanks alone separate, a comma is a decimal comma. Blocks of points are
separated by empty lines or comments (# or //), or headed by a line with their number (and `3`), which is held against
the block. One line of column names may stand before them, one for each column: those with the names x, y and z are
taken, or the first ones where these begin with x, y, z (tables of blades have other columns).

One block is a point cloud; several blocks are the rows of a surface (`bonecam.surface.skinning`).
"""

import re
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import FileError, MeshError, file_error
from bonecam.files import required_text
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.meshlab import from_meshset, meshlab
from bonecam.mesh.triangle_mesh import LARGEST_COORDINATE, TriangleMesh
from bonecam.text.numbers import number

FEWEST = 200
"""Least number of points of a cloud."""
NEIGHBOURS = 12
"""Number of neighbours that the normal of a point is fitted to."""
DEPTH = 8
"""Depth of the octree of the reconstruction."""
MAX_DISTANCE = 0.02
"""Largest distance of a point from the surface, share of the diagonal: a surface that misses more is
refused."""


def reconstruct(points: Float[ndarray, "n 3"]) -> TriangleMesh:
    """The closed, outward surface through a dense cloud, in the cloud's unit. MeshError where the points are
    too few or missed."""
    points = np.unique(points, axis=0)
    if len(points) < FEWEST:
        raise MeshError(
            f"{len(points)} different points are too few for a surface: give {FEWEST} or more, or rows of points",
            points=len(points),
        )
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    if not size > 0:
        raise MeshError("the points are so close together that they have no size: export them in mm")
    middle = points.mean(axis=0)
    meshset = meshlab().MeshSet()
    meshset.add_mesh(meshlab().Mesh((points - middle) / size))
    meshset.compute_normal_for_point_clouds(k=NEIGHBOURS)
    meshset.generate_surface_reconstruction_screened_poisson(depth=DEPTH, preclean=True, threads=1)
    unit_mesh = from_meshset(meshset)
    faces = unit_mesh.faces if unit_mesh.volume >= 0 else unit_mesh.faces[:, ::-1]
    mesh = TriangleMesh(unit_mesh.vertices * size + middle, faces)
    distances = MeshDistance(mesh).unsigned(points) if len(mesh.faces) else np.full(1, np.inf)
    if not distances.max() <= MAX_DISTANCE * size:
        place = points[np.argmax(distances)] if len(mesh.faces) else middle
        what = f"the surface round the points misses one by {distances.max():.3g} at {np.round(place, 3).tolist()}"
        raise MeshError(f"{what}: give a denser cloud that covers the whole part, or a mesh", place=place)
    return mesh


POINTS = (".xyz", ".csv", ".asc", ".pts", ".txt", ".dat")
"""Endings of text files of points."""
DECIMAL = re.compile(r"[-+]?\d+(,\d+)?(e[-+]?\d+)?", re.IGNORECASE)
"""A number without a decimal point; a comma in it is a decimal comma."""


def read_blocks(path: str | Path, columns: str = "xyz") -> tuple[Float[ndarray, "_ c"], ...]:
    """The blocks of points of a text file, in the file's unit. FileError names the file, the line and what is
    wrong with it.

    `columns` are the names of the columns that are taken, a letter each; without a line of names they are the first.
    """
    file = Path(path)
    blocks: list[list[list[float]]] = [[]]
    heads: list[tuple[int, int, list[list[float]]]] = []
    named = None
    for at, line in enumerate(required_text(file, "points as text").splitlines(), 1):
        fields = _fields(line)
        if not fields:
            blocks += [[]] if blocks[-1] else []
            continue
        try:
            values = [number(word) for field in fields for word in field.split() or [field]]
        except ValueError as error:
            if not named and not any(blocks):
                named = _named_columns(fields, columns)
                if named:
                    continue
            raise _refusal(
                file, at, f"{line.strip()[:40]!r} is no point", f"write {' '.join(columns)} in columns of that order"
            ) from error
        count, places = named or (len(values), range(len(columns)))
        place = [values[k] for k in places] if len(values) > max(places) else values
        if not np.isfinite(place).all():
            raise _refusal(file, at, f"{line.strip()[:40]!r} is not finite", "export the points again")
        if max(map(abs, place)) > LARGEST_COORDINATE:
            what = f"a coordinate of {max(place, key=abs):.3g}"
            raise _refusal(file, at, what, "export the points again")
        if len(values) < len(columns):
            if not (values[0] == int(values[0]) and values[0] > 0 and values[1:] in ([], [3.0])):
                asked = f"write {' '.join(columns)}"
                raise _refusal(file, at, f"{len(values)} numbers are no point", asked)
            blocks.append([])
            heads.append((at, int(values[0]), blocks[-1]))
        elif len(values) != count:
            what = f"{len(values)} numbers under the names of {count} columns"
            raise _refusal(file, at, what, "name every column, or none")
        else:
            blocks[-1].append(place)
    for at, count, block in heads:
        if len(block) != count:
            what = f"tells of {count} points, {len(block)} follow it in one block"
            raise _refusal(file, at, what, "export the points again, or leave that line out")
    arrays = tuple(np.array(block) for block in blocks if block)
    if not arrays:
        raise file_error(file, "holds no points", f"write {' '.join(columns)}, one point a line")
    return arrays


def _fields(line: str) -> list[str]:
    """What commas, or semicolons, separate in a line, decimal commas made points; nothing for a comment."""
    text = line.strip().rstrip(",; \t")
    if not text or (text.startswith(("#", "//")) and text[1:2] not in (",", ";")):
        return []
    words = text.split()
    if ";" in text or ("," in text and (len(words) > 2 and all(DECIMAL.fullmatch(word) for word in words))):
        return text.replace(",", ".").split(";")
    return text.split(",")


def _named_columns(fields: list[str], columns: str) -> tuple[int, list[int]] | None:
    """How many columns names tell of, and the places of those that have these letters for names, units behind them
    left out, or begin with them; None where there are none."""
    words = fields if len(fields) > 1 else fields[0].split()
    names = [word.strip("\"' \t").lower() for word in words]
    if len(fields) == 1:
        names = [name for name in names if name[:1].isalpha()]
    bare = [re.split("[^a-z_]", name)[0] for name in names]
    if all(bare.count(letter) == columns.count(letter) == 1 for letter in columns):
        return len(names), list(map(bare.index, columns))
    first = bare[: len(columns)]
    begin = [name[:1] for name in first] == list(columns) and "norm" not in "".join(first)
    return (len(names), list(range(len(columns)))) if begin else None


def _refusal(file: Path, line: int, what: str, remedy: str) -> FileError:
    return FileError(f"{file} line {line}: {what}: {remedy}", file=str(file), line=line)
