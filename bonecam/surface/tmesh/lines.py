"""The T-mesh as lines on the surface, to be drawn: edges as runs of parameters, vertices as places.

The rows of a row-structured surface are joined by no edges; each of their knots is drawn half-way to the rows
beside it.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import SurfaceError
from bonecam.surface.tmesh.general import TMesh
from bonecam.surface.tmesh.local_knot_vectors import knots_of_lines
from bonecam.surface.tmesh.row_tmesh import RowTMesh


@dataclass(frozen=True, eq=False)
class TMeshLines:
    """Parameters (s, t) of the ends of straight pieces (n, 2, 2) and of the vertices (m, 2)."""

    pieces: Float[ndarray, "n 2 2"]
    vertices: Float[ndarray, "m 2"]


def tmesh_lines(tmesh: Any) -> TMeshLines:
    """The T-mesh of a closed row-structured or a general surface; pieces end at index lines, so they are
    short."""
    if isinstance(tmesh, RowTMesh):
        return _of_rows(tmesh)
    if isinstance(tmesh, TMesh):
        return _of_grid(tmesh)
    raise SurfaceError("only closed rows and general T-meshes are drawn as lines")


def _of_rows(tmesh: RowTMesh) -> TMeshLines:
    t = tmesh.t_knots[2:-2]
    middle = np.concatenate([t[:1], (t[1:] + t[:-1]) / 2, t[-1:]])
    pieces = []
    vertices = []
    for j, knots in enumerate(tmesh.s_knots):
        if len(knots) > 1:
            ends = np.append(knots, knots[0] + 1)
            pieces.append(np.stack([_places(ends[:-1], t[j]), _places(ends[1:], t[j])], axis=1))
            pieces.append(np.stack([_places(knots, middle[j]), _places(knots, middle[j + 1])], axis=1))
        vertices.append(_places(knots, t[j]))
    return TMeshLines(np.concatenate(pieces), np.concatenate(vertices))


def _places(s: ndarray, t: float) -> ndarray:
    return np.column_stack([s, np.full(len(s), t)])


def _of_grid(tmesh: TMesh) -> TMeshLines:
    pieces = []
    for axis, edges in enumerate((tmesh.along_s, tmesh.along_t)):
        index = np.argwhere(edges)
        ends = []
        for step in (0, 1):
            lines = index.copy()
            lines[:, axis] += step
            s, t = (
                knots_of_lines(lines[:, [d]], (tmesh.s_lines, tmesh.t_lines)[d], tmesh.period[d])[:, 0]
                for d in (0, 1)
            )
            ends.append(np.column_stack([s, t]))
        pieces.append(np.stack(ends, axis=1))
    segments = np.concatenate(pieces)
    long = (segments[:, 0] != segments[:, 1]).any(axis=1)
    vertices = np.column_stack([tmesh.s_lines[tmesh.vertices[:, 0]], tmesh.t_lines[tmesh.vertices[:, 1]]])
    return TMeshLines(segments[long], vertices)
