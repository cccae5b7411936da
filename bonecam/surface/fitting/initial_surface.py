"""A surface on a T-mesh before any step of the fit: the first one through the rows' loops, and one like the surface
on another T-mesh.
"""

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float
from numpy import ndarray

from bonecam.mesh.sections.harmonic_rows import Rows
from bonecam.surface.basis.gauss import element_points
from bonecam.surface.basis.periodic import FEWEST
from bonecam.surface.fitting.quadratic import Form, Term
from bonecam.surface.tmesh.row_tmesh import RowTMesh
from bonecam.surface.tspline import TSpline

LOOP_DAMPING = 1e-9
"""Weight of a control point's place between the rows' points, where these do not reach it."""

TRANSFER_DAMPING = 1e-6
"""Weight of a control point's place at its anchor, shared among them, where a surface moves to a T-mesh."""


def first_tmesh(spans: int, knots: int) -> RowTMesh:
    """Even spans in t, `knots` even knots a row, four in the rows next to the poles."""
    t_knots = np.concatenate([np.zeros(3), np.linspace(0, 1, spans + 1), np.ones(3)])
    rows = [np.arange(knots) / knots for _ in range(spans + 3)]
    rows[0] = rows[-1] = np.zeros(1)
    rows[1] = rows[-2] = np.arange(FEWEST) / FEWEST
    return RowTMesh.from_rows(t_knots, rows)


def through_loops(rows: Rows, tmesh: RowTMesh) -> TSpline:
    """The surface that meets the rows' loops and poles best, each at its parameters; faintly held by them at
    its anchors."""
    loops, count = rows.guides.shape[:2]
    order = np.arange(1, loops + 1) * (len(rows.heights) + 1) / (loops + 1)
    heights = np.interp(order, np.arange(len(rows.heights) + 2), [0.0, *rows.heights, 1.0])
    s = np.tile(np.arange(count) / count, loops)
    t = np.repeat(heights, count)
    weights = np.repeat(np.gradient(heights), count)
    basis = tmesh.blending(np.append(s, [0.0, 0.0]), np.append(t, [0.0, 1.0]), 0)[0]
    weighted = sp.diags_array(np.append(weights, [1.0, 1.0])) @ basis
    points = np.vstack([rows.guides.reshape(-1, 3), rows.poles])
    nets = np.concatenate(
        [np.repeat(rows.poles[:1, None], count, axis=1), rows.guides, np.repeat(rows.poles[1:, None], count, axis=1)]
    )
    anchor_s, anchor_t = anchors(tmesh)
    column = np.rint(anchor_s * count).astype(int) % count
    place = np.interp(anchor_t, [0.0, *heights, 1.0], np.arange(loops + 2))
    level = np.minimum(place.astype(int), loops)
    share = (place - level)[:, None]
    held = nets[level, column] * (1 - share) + nets[level + 1, column] * share
    normal = (basis.T @ weighted).toarray() + LOOP_DAMPING * np.eye(tmesh.size)
    return TSpline(tmesh, np.linalg.solve(normal, weighted.T @ points + LOOP_DAMPING * held), np.ones(tmesh.size))


def transfer(surface: TSpline, tmesh: RowTMesh) -> TSpline:
    """A surface on `tmesh` like `surface`: least squares in the Gauss points, faintly held at the anchors."""
    size = tmesh.size
    draft = TSpline(tmesh, surface.positions(*anchors(tmesh)), np.ones(size))
    s, t, share = element_points(draft.elements().boxes, 2)
    data = Term(draft.basis(s, t)[0], share[:, None, None] * np.eye(3), surface.positions(s, t))
    held = Term(
        sp.eye_array(size, format="csr"),
        np.broadcast_to(TRANSFER_DAMPING / size * np.eye(3), (size, 3, 3)),
        draft.control_points,
    )
    return TSpline(tmesh, Form.of([data, held], size).least(), np.ones(size))


def anchors(tmesh: RowTMesh) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"]]:
    """(s, t) of each control point: its knot and its row's Greville point."""
    t = [tmesh.t_knots[j + 1 : j + 4].mean() for j in range(len(tmesh.s_knots))]
    return np.concatenate(tmesh.s_knots), np.repeat(t, [len(row) for row in tmesh.s_knots])
