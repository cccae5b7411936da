"""Refinement that leaves the surface what it is: the faces that hold given samples are cut in the middle
(exact local knot insertion)."""

from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import SurfaceError
from bonecam.surface.refinement.local import refine_locally
from bonecam.surface.refinement.row_refinement import refine_rows
from bonecam.surface.tmesh.cutting import Draft
from bonecam.surface.tmesh.general import TMesh
from bonecam.surface.tmesh.open_rows import OpenRowTMesh
from bonecam.surface.tmesh.row_tmesh import RowTMesh
from bonecam.surface.tmesh.surface import S

SNAP = 1e-9
"""Share of the knots' range: a middle as near as this to a knot is that knot."""


def refine(surface: S, s: Float[ndarray, " n"], t: Float[ndarray, " n"], directions: str = "st") -> S:
    """The unchanged surface with more control points near the samples.

    Each face that holds a sample is cut in its middle, across s ("s"), across t ("t") or both. In a row-
    structured surface the rows that act at a sample get a knot ("s"), and the t-span gets a row ("t"). In a
    general T-mesh old control points keep their numbers. Raises ValueError for samples outside the domain.
    """
    if directions not in ("s", "t", "st", "ts"):
        raise ValueError(f"directions must be 's', 't' or 'st', not {directions!r}")
    place, s, t = surface.elements().place(s, t)
    tmesh: Any = surface.tmesh
    if isinstance(tmesh, RowTMesh | OpenRowTMesh):
        return refine_rows(surface, s, t, directions)
    if not isinstance(tmesh, TMesh):
        raise SurfaceError(
            "Bezier elements without a T-mesh (.iga) cannot be refined: read the surface from a .tsm "
            "or .tspline file"
        )
    middle = surface.elements().boxes[place]
    chosen = sorted(
        {_face_at(tmesh, a, b) for a, b in zip(middle[:, :2].mean(axis=1), middle[:, 2:].mean(axis=1))}
    )
    return _cut(surface, chosen, directions)


def _face_at(tmesh: TMesh, s: float, t: float) -> int:
    boxes = tmesh.face_boxes
    return int(
        np.flatnonzero((boxes[:, 0] < s) & (s < boxes[:, 1]) & (boxes[:, 2] < t) & (t < boxes[:, 3]))[0]
    )


def _cut(surface: S, chosen: list[int], directions: str) -> S:
    tmesh = surface.tmesh
    draft = Draft.of(tmesh)
    boxes = tmesh.face_boxes[chosen]
    middles = [boxes[:, :2].mean(axis=1), boxes[:, 2:].mean(axis=1)]
    numbers = [np.arange(len(tmesh.s_lines)), np.arange(len(tmesh.t_lines))]
    for axis in (0, 1):
        if "st"[axis] in directions:
            # Knots for values that differ from them by rounding only; values that equal one another likewise become
            # one
            values = middles[axis]
            knots = draft.knots[axis]
            snapped = values.copy()
            for k, x in enumerate(values):
                known = np.concatenate([knots, snapped[:k]])
                nearest = known[np.argmin(np.abs(known - x))]
                if abs(nearest - x) <= SNAP * np.ptp(knots):
                    snapped[k] = nearest
            middles[axis] = snapped

            numbers[axis] = draft.insert_lines(axis, np.setdiff1d(middles[axis], draft.knots[axis]))
    for box, s, t in zip(boxes, *middles):
        if "s" in directions:
            draft.cut(0, draft.line_at(0, s), _piece(draft.knots[1], box[2], box[3], t, upper=False))
        if "t" in directions:
            for piece in {_piece(draft.knots[0], box[0], box[1], s, upper=upper) for upper in (False, True)}:
                draft.cut(1, draft.line_at(1, t), piece)
        if directions in ("st", "ts"):
            draft.cut(0, draft.line_at(0, s), _piece(draft.knots[1], box[2], box[3], t, upper=True))
    return refine_locally(surface, draft, (numbers[0], numbers[1]))


def _piece(knots: ndarray, low: float, high: float, middle: float, upper: bool) -> int:
    """A piece that is not empty inside [low, high], below its middle or above."""
    k = int(np.searchsorted(knots, middle, side="left"))
    return k if upper and k < len(knots) and knots[k] == middle else k - 1
